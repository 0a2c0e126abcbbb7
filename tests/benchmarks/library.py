"""A library's conversion: what workers bring, what it costs besides converting, memory, kills.

    python -m tests.benchmarks.library MAP ... [-o FOLDER] [--parts scaling overhead ...]

scaling: maps of mixed size by one worker and by two, in turns. overhead: maps 1,024 wide by one
worker and by a warm process that does nothing else, in turns. memory: the largest sum of what all
processes hold, under several limits. kills: runs that were killed at random moments and begun
again, against an undisturbed one, byte by byte. many: 2,000 maps.
Maps are made of the given ones, see `varied`. Times are of one run: read ratios.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np
import psutil

from sunsplit.core.files.maps import load
from sunsplit.core.library.processes import ONE_CORE
from tests.benchmarks.large_maps import KINDS, make
from tests.killing import kills, undisturbed
from tests.libraries import contents, write_maps

MIXED = {1024: 40, 2048: 10, 4096: 6, 8192: 3, 16384: 1}
"""So many maps of each width: 60."""

LIMITS = ("600M", "1G", "2G", "4G")

ALONE = """
import gc, sys, time
from pathlib import Path
from sunsplit.core import convert, load, save
out, *maps = sys.argv[1:]
save(convert(load(maps[0])), out)
gc.collect()
gc.freeze()
began = time.perf_counter()
for path in maps:
    save(convert(load(path)), out)
    gc.collect()  # else memory grows, which takes time, too
print(time.perf_counter() - began)
gc.unfreeze()
"""
"""What a warm process takes for maps and nothing else."""

COMMAND = [sys.executable, "-c", "import sys; from sunsplit.core.cli import main; sys.exit(main())"]


@dataclass(frozen=True)
class Found:
    """A part's lines for people, and its numbers for machines."""

    lines: list[str]
    numbers: dict[str, object]


def varied(sources: Sequence[Path], folder: Path, count: int, width: int = 1024) -> list[Path]:
    """Maps of this width made of real ones: each turned about the vertical by another angle and as
    bright as no other; wider ones have a grain of their own. Half of them .hdr, half .exr."""
    import OpenImageIO as oiio

    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for number in range(count):
        source, ending = sources[number % len(sources)], ("hdr", "exr")[number // 2 % 2]
        path = folder / f"{source.stem} {width} {number:04}.{ending}"
        paths.append(path)
        if width > 1024:
            make(source, width, KINDS[0] if ending == "hdr" else KINDS[1], path)
            continue
        pixels = load(source).radiance
        pixels = np.roll(pixels, 37 * number, axis=1) * np.float32(0.97 ** (number % 40))
        spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "float")
        spec["compression"] = "zip"
        out = oiio.ImageOutput.create(str(path))
        if not out or not out.open(str(path), spec):
            raise OSError(oiio.geterror())
        out.write_image(np.ascontiguousarray(pixels))
        out.close()
    return paths


def timed(library: Path, out: Path, *arguments: str) -> float:
    """Seconds of a whole `sunsplit library`, from its start; what was written is removed."""
    began = time.perf_counter()
    _library(library, out, *arguments)
    seconds = time.perf_counter() - began
    shutil.rmtree(out)
    return seconds


def _library(library: Path, out: Path, *arguments: str) -> dict[str, object]:
    command = [*COMMAND, "library", str(library), "-o", str(out), "--json", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def scaling(sources: Sequence[Path], folder: Path, few: bool) -> Found:
    """One worker against two, in turns."""
    mixed = {1024: 3, 2048: 1} if few else MIXED
    for width, count in mixed.items():
        varied(sources, folder / "maps" / str(width), count, width)
    times: dict[int, list[float]] = {1: [], 2: []}
    for repeat in range(1 if few else 3):
        for workers in (1, 2) if repeat % 2 else (2, 1):
            times[workers].append(timed(folder / "maps", folder / "out", "--workers", str(workers)))
    one, two = median(times[1]), median(times[2])
    count = sum(mixed.values())
    sizes = ", ".join(f"{number} of {width}" for width, number in mixed.items())
    lines = [
        f"{count} maps ({sizes} pixels' width), {os.cpu_count()} cores, medians of "
        f"{len(times[1])}: one worker {one:.1f} s, two {two:.1f} s: **{one / two:.2f} times** as "
        "fast, start of all processes included."
    ]
    return Found(lines, {"one": times[1], "two": times[2], "ratio": one / two})


def overhead(sources: Sequence[Path], folder: Path, few: bool) -> Found:
    """A library of maps 1,024 wide by one worker, against a process that only converts them."""
    maps = varied(sources, folder / "maps", 4 if few else 90)
    alone: list[float] = []
    whole: list[float] = []
    for repeat in range(1 if few else 3):
        for way in ("alone", "library") if repeat % 2 else ("library", "alone"):
            if way == "alone":
                command = [sys.executable, "-c", ALONE, str(folder / "alone"), *map(str, maps)]
                done = subprocess.run(
                    command, capture_output=True, text=True, check=True, env=os.environ | ONE_CORE
                )
                alone.append(float(done.stdout))
            else:
                whole.append(timed(folder / "maps", folder / "out", "--workers", "1"))
    each, base = (1000 * median(times) / len(maps) for times in (whole, alone))
    lines = [
        f"{len(maps)} maps 1,024 wide, medians of {len(whole)}: {each:.0f} ms a map by one worker, "
        "start of all processes, report and records included; "
        f"{base:.0f} ms in a warm process that only converts: **{100 * (each / base - 1):.1f} %** "
        "more."
    ]
    return Found(lines, {"library": whole, "alone": alone, "overhead": each / base - 1})


class Watch:
    """Looks at what a process and all that it has started hold, until the block ends."""

    def __init__(self, process: int, pause: float = 0.01) -> None:
        self.highest, self.most_workers = 0, 0
        self._process, self._pause, self._end = psutil.Process(process), pause, threading.Event()
        self._thread = threading.Thread(target=self._look)

    def __enter__(self) -> Watch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def _look(self) -> None:
        while not self._end.wait(self._pause):
            try:
                inner = self._process.children(recursive=True)
                held = [process.memory_info().rss for process in (self._process, *inner)]
            except psutil.Error:
                continue
            self.highest = max(self.highest, sum(held))
            self.most_workers = max(self.most_workers, len(inner))


def memory(sources: Sequence[Path], folder: Path, few: bool) -> Found:
    """What all processes hold at once, at most, under limits; two workers for each core."""
    for width, count in ({1024: 3} if few else {1024: 12, 4096: 4, 8192: 4, 16384: 4}).items():
        varied(sources, folder / "maps" / str(width), count, width)
    lines = [
        "| --memory | most in use | of the limit | most workers at once | seconds | failed |",
        "|---:|---:|---:|---:|---:|---:|",
    ]
    numbers: dict[str, object] = {}
    for limit in LIMITS[:1] if few else LIMITS:
        arguments = ["--workers", "4", "--memory", limit, "--residual-width", "own", "--json"]
        command = [*COMMAND, "library", str(folder / "maps"), "-o", str(folder / "out")]
        process = subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, text=True)
        with Watch(process.pid) as watch:
            end = json.loads(process.communicate()[0].splitlines()[-1])
        allowed = float(limit[:-1]) * {"M": 1, "G": 1024}[limit[-1]]
        most = watch.highest / 1024**2
        lines.append(
            f"| {limit} | {most:,.0f} MB | {most / allowed:.2f} | {watch.most_workers} "
            f"| {end['seconds']:.1f} | {end['failed']} |"
        )
        numbers[limit] = {"most": most, "of the limit": most / allowed, "failed": end["failed"]}
        shutil.rmtree(folder / "out")
    return Found(lines, numbers)


def killing(sources: Sequence[Path], folder: Path, few: bool) -> Found:
    """Runs that are killed at random moments, and then begun again."""
    library = folder / "maps"
    write_maps(library, 4 if few else 24, width=256)
    seconds = undisturbed(library, folder / "whole")
    whole = contents(folder / "whole")
    same = hits = 0
    number = 2 if few else 20
    for out, _, hit in kills(library, folder, seconds, number, seed=1):
        same += contents(out) == whole
        hits += hit
    lines = [
        f"{number} runs over {len(whole)} files, killed at random moments of the {seconds:.1f} s "
        f"that an undisturbed one takes ({hits} before its end; every other time only the process "
        f"that the user has started) and begun again: {same} of {number} results are the same, "
        "byte by byte, the seconds in the report apart."
    ]
    return Found(lines, {"runs": number, "same": same, "hits": hits})


def many(sources: Sequence[Path], folder: Path, few: bool) -> Found:
    """2,000 maps, and the same again with nothing to do."""
    count = 10 if few else 2000
    varied(sources, folder / "maps", count)
    with_report: dict[str, object] = {}
    first = _library(folder / "maps", folder / "out", "--workers", "2")
    began = time.perf_counter()
    second = _library(folder / "maps", folder / "out", "--workers", "2")
    again = time.perf_counter() - began
    with_report = {"first": first, "second": second, "again": again}
    size = sum(p.stat().st_size for p in (folder / "out").rglob("report.html")) / 1e6
    lines = [
        f"{count:,} maps 1,024 wide by two workers: {first['seconds']:,.0f} s, "
        f"{first['failed']} failed; again, with nothing to do: {again:.1f} s, "
        f"{second['known']:,} known. The report has {size:.1f} MB."
    ]
    return Found(lines, with_report)


PARTS: dict[str, Callable[[Sequence[Path], Path, bool], Found]] = {
    "scaling": scaling,
    "overhead": overhead,
    "memory": memory,
    "kills": killing,
    "many": many,
}


def main(arguments: Sequence[str] | None = None) -> dict[str, Found]:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("maps", nargs="+", type=Path, metavar="MAP")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"), metavar="FOLDER")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--few", action="store_true", help="a small version, that tells nothing")
    parser.add_argument("--name", default="library", help="of the table")
    chosen = parser.parse_args(arguments)
    chosen.output.mkdir(parents=True, exist_ok=True)
    found = {}
    for name in chosen.parts:
        with tempfile.TemporaryDirectory() as folder:
            found[name] = PARTS[name](chosen.maps, Path(folder), chosen.few)
        print("\n".join([f"## {name}", *found[name].lines]), flush=True)
    lines = ["# Libraries", ""]
    for name, part in found.items():
        lines += [f"## {name.capitalize()}", "", *part.lines, ""]
    page = chosen.output / f"{chosen.name}.md"
    page.write_text("\n".join(lines), encoding="utf-8")
    return found


if __name__ == "__main__":
    main()
