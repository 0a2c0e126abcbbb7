"""What is to be made of a library: which files are one map, which is looked at, what is written."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

from .options import LibraryOptions
from .scan import MapFile, Scan
from .sizes import is_size, name_without_size, size_name


@dataclass(frozen=True)
class Output:
    """A conversion to write: its folder in the output's, with slashes ("." for itself), what its
    files' names begin with, and how wide its residual is at most (None: as the settings say)."""

    folder: str
    stem: str
    width: int | None = None


@dataclass(frozen=True)
class PlannedMap:
    """A map of a library. file: what is looked at. others: further sizes of it. outputs: at least
    one."""

    file: MapFile
    others: tuple[MapFile, ...]
    outputs: tuple[Output, ...]

    @property
    def name(self) -> str:
        """Of no other map in a library: where the record of its conversion lies."""
        first = self.outputs[0]
        return first.stem if first.folder == "." else f"{first.folder}/{first.stem}"


def plan(found: Scan, options: LibraryOptions) -> tuple[PlannedMap, ...]:
    """Group the files of a library into maps, in the order of their names."""
    planned = [_planned(files, options) for files in _groups(found.files)]
    return _with_names_of_their_own(sorted(planned, key=lambda each: each.file.path))


def _groups(files: Iterable[MapFile]) -> list[list[MapFile]]:
    """Files of one map, the narrowest first. Two of the same width are two maps, as nothing tells
    which of them belongs to the others."""
    by_name: dict[tuple[str, str], list[MapFile]] = defaultdict(list)
    for file in files:
        by_name[_name_of(file)].append(file)
    groups = []
    for group in by_name.values():
        by_width = Counter(file.width for file in group)
        if max(by_width.values()) == 1 and 0 not in by_width:
            groups.append(sorted(group, key=lambda file: file.width))
        else:
            groups += [[file] for file in group]
    return groups


def _name_of(file: MapFile) -> tuple[str, str]:
    """Folder and stem without sizes."""
    path = PurePosixPath(file.path)
    folders = [part for part in path.parent.parts if not is_size(part, file.width)]
    return "/".join(folders), name_without_size(path.stem, file.width)


def _planned(files: Sequence[MapFile], options: LibraryOptions) -> PlannedMap:
    """files: the narrowest first. What is wider than the limit is only read if nothing else is
    there."""
    read = [file for file in files if file.width <= options.largest] or files[:1]
    chosen = read[-1]
    others = tuple(file for file in files if file is not chosen)
    return PlannedMap(chosen, others, _outputs(read, chosen, options))


def _outputs(
    files: Sequence[MapFile], chosen: MapFile, options: LibraryOptions
) -> tuple[Output, ...]:
    """The widest first."""
    of_width = {file.width: file for file in files}
    widths = of_width.keys() if options.sizes == "all" else options.sizes
    widths = [width for width in sorted(widths, reverse=True) if _is_part(width, chosen.width)]
    if not widths:
        width = chosen.width if options.sizes and chosen.width else None
        return (_output(chosen, width, chosen),)
    return tuple(_output(of_width.get(width), width, chosen) for width in widths)


def _is_part(width: int, whole: int) -> bool:
    return 0 < width <= whole and whole % width == 0


def _output(file: MapFile | None, width: int | None, chosen: MapFile) -> Output:
    """Named after the file of that width, or after the map."""
    path = PurePosixPath((file or chosen).path)
    stem = path.stem
    if file is None and width is not None:
        stem = f"{name_without_size(stem, chosen.width)}_{size_name(width)}"
    return Output(path.parent.as_posix(), stem, width)


def _with_names_of_their_own(planned: Sequence[PlannedMap]) -> tuple[PlannedMap, ...]:
    """Where two conversions would have one name, on a drive that tells no cases apart either, they
    get those of their files with the ending; and numbers, if that is not enough."""
    taken = Counter(_key(output) for each in planned for output in each.outputs)
    used: set[tuple[str, str]] = set()
    result = []
    for each in planned:
        outputs = []
        for output in each.outputs:
            if taken[_key(output)] > 1:
                ending = PurePosixPath(each.file.path).suffix
                output = replace(output, stem=f"{output.stem}{ending}")
            plain, number = output, 1
            while _key(output) in used:
                number += 1
                output = replace(plain, stem=f"{plain.stem} ({number})")
            used.add(_key(output))
            outputs.append(output)
        result.append(replace(each, outputs=tuple(outputs)))
    return tuple(result)


def _key(output: Output) -> tuple[str, str]:
    return output.folder.casefold(), output.stem.casefold()
