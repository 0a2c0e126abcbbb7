"""Asset libraries: .blend files of what was converted, made by Blender in processes of its own."""

from __future__ import annotations

import hashlib
import json
import shutil
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..files.belonging import sha256
from ..settings import BadSetting
from ..version import version
from .catalogues import write_catalogues
from .events import AssetSettled
from .local import LocalWorkers, Task
from .memory import MEGABYTE
from .options import Assets
from .side_files import SideFacts
from .state import STATE, Known, times_of, write_state
from .work import MapJob

BLENDER = 700 * MEGABYTE
"""A Blender that renders a preview of a map 1,024 wide."""

PER_PIXEL = 24
"""Bytes for each pixel of a map that Blender loads to render it."""


@dataclass(frozen=True)
class Converted:
    """A map that was converted, and what is said of it beside it. pixels: of the map."""

    job: MapJob
    facts: SideFacts
    pixels: int

    def asset(self, pack: bool) -> dict[str, Any]:
        """What the worker is asked for, see `addon.asset_library.job.AssetJob`."""
        output, first = Path(self.job.output), self.job.outputs[0]
        folder = output / first.folder
        return {
            "map": str(self.job.source),
            "lights": str(folder / f"{first.stem}.lights.json"),
            "blend": str(folder / f"{first.stem}.blend"),
            "name": first.stem,
            "root": str(output),
            "catalogue": "" if first.folder == "." else first.folder,
            "tags": list(self.facts.tags),
            "author": self.facts.author,
            "licence": self.facts.licence,
            "copyright": self.facts.copyright,
            "description": self.facts.description,
            "pack": pack,
        }


def blender_command(blender: str | None) -> list[str]:
    """The command of a Blender that makes assets: the given program, this Python if it has Blender
    as a module, or the `blender` that is installed. Raises BadSetting."""
    worker = Path(__file__).parents[2] / "addon" / "asset_library" / "worker.py"
    if blender is None and find_spec("bpy") is not None:
        return [sys.executable, "-I", str(worker)]
    program = shutil.which(blender or "blender")
    if program is None:
        where = f"there is no program {blender}" if blender else "there is none here"
        raise BadSetting(f"--assets needs Blender, and {where}: say where by --blender PROGRAM.")
    quietly = ("--background", "--factory-startup", "--quiet", "--python-exit-code", "1")
    return [program, *quietly, "--python", str(worker)]


def make_assets(
    maps: Sequence[Converted],
    output: Path,
    kind: Assets,
    pack: bool,
    makers: LocalWorkers,
) -> Iterator[AssetSettled]:
    """Make .blend files of maps, but for those that are there already, and state their catalogues.

    kind: a file for "each" map, beside its conversion, or "one" in the output's folder, of its
    name. makers: processes of `blender_command`. Raises CannotWrite.
    """
    output = output.absolute()  # as the jobs have it
    catalogues = {asset["catalogue"] for asset in (each.asset(pack) for each in maps)}
    write_catalogues(output, sorted(filter(None, catalogues)))
    files = [_File.of([each], output, pack) for each in maps]
    if kind == "one":
        files = [_File.of(maps, output, pack, output / f"{output.resolve().name}.blend")]
    left, number = [], 0
    for file in files:
        if file.is_current():
            number += 1
            yield file.settled(True, "", number, len(files))
        else:
            left.append(file)
    tasks = [Task(file.job, file.memory) for file in left]
    of_task = {id(task): file for task, file in zip(tasks, left, strict=True)}
    with makers as pool:
        for done in pool.run(tasks):
            if done is None:
                continue
            file, number = of_task[id(done.task)], number + 1
            answer = done.answer or {"sentence": done.sentence, "left_out": []}
            if not answer["sentence"] and not answer["left_out"]:
                file.remember()
            sentence = " ".join([answer["sentence"], *answer["left_out"]]).strip()
            yield file.settled(False, sentence, number, len(files))


@dataclass(frozen=True)
class _File:
    """A .blend file to make. request: a digest of all that it is made of."""

    path: Path
    output: Path
    sources: tuple[str, ...]
    job: dict[str, Any]
    request: str
    memory: int

    @classmethod
    def of(
        cls, maps: Sequence[Converted], output: Path, pack: bool, path: Path | None = None
    ) -> _File:
        assets = [each.asset(pack) for each in maps]
        job = {"all": assets, "blend": str(path)} if path else assets[0]
        return cls(
            path or Path(assets[0]["blend"]),
            output,
            tuple(each.job.path for each in maps),
            job,
            _request(assets),
            BLENDER + PER_PIXEL * max(each.pixels for each in maps),
        )

    @property
    def _record(self) -> Path:
        name = self.path.relative_to(self.output).as_posix()
        return self.output / STATE / "assets" / f"{name}.json"

    def is_current(self) -> bool:
        """Whether it is there, made of the same."""
        try:
            stored = json.loads(self._record.read_text(encoding="utf-8"))
            times = stored["times"] and tuple(stored["times"])
            known = Known(stored["sha256"], times)
            return stored["request"] == self.request and known.fits(self.path)
        except (OSError, ValueError, KeyError, TypeError):
            return False

    def remember(self) -> None:
        known = Known(sha256(self.path), times_of(self.path))
        write_state(self._record, self.output, {"request": self.request, **asdict(known)})

    def settled(self, known: bool, sentence: str, number: int, total: int) -> AssetSettled:
        blend = self.path.relative_to(self.output).as_posix()
        return AssetSettled(blend, self.sources, known, sentence, number, total)


def _request(assets: Sequence[dict[str, Any]]) -> str:
    """The conversion's document states the digests of the other files that an asset is made of;
    where it lies and where the map is, the paths in the .blend file hang on."""
    digest = hashlib.sha256(version().encode())
    for asset in assets:
        digest.update(json.dumps(asset, sort_keys=True).encode())
        try:
            digest.update(Path(asset["lights"]).read_bytes())
        except OSError:  # it is gone since: the worker says so
            digest.update(b"?")
    return digest.hexdigest()
