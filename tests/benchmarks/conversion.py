"""What a conversion costs against reading the file: seconds by stage, memory, growth with size.

    python -m tests.benchmarks.conversion MAP ... [-o FOLDER] [--widths 1024 ...] [--repeat 5]

Each map is enlarged (see `large_maps`) and stored in every way. In a process of its own for each
file, warm but for the file, reading by OpenImageIO, reading by OpenEXR and the whole of `sunsplit
convert` take turns; medians count. Memory is the peak of another process that only converts.
Times are of one run: read ratios.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import geometric_mean, median

import numpy as np

from tests.benchmarks.large_maps import KINDS, Kind, make

WIDTHS = (1024, 2048, 4096, 8192, 16384)
LIGHTS = (1, 4, 16, 64, 256)
STAGES = ("reading", "strata", "region A", "suns", "residual", "account", "writing")
"""As the pipeline names them to whoever listens to its progress."""


@dataclass(frozen=True)
class Cost:
    """Of one file: seconds, medians. stages: of the conversion. peak: bytes of a process that does
    nothing else."""

    name: str
    width: int
    kind: str
    bytes: int
    by_oiio: float
    by_openexr: float
    whole: float
    stages: dict[str, float]
    suns: int
    peak: int

    @property
    def read(self) -> float:
        """By the faster of the two libraries."""
        return min(one for one in (self.by_oiio, self.by_openexr) if one > 0)

    @property
    def ratio(self) -> float:
        return self.whole / self.read

    @property
    def ratio_to_oiio(self) -> float:
        return self.whole / self.by_oiio

    @property
    def memory_ratio(self) -> float:
        """Against the bytes of the map's pixels as float32 RGB."""
        return self.peak / (self.width**2 / 2 * 12)


class StageClock:
    """Listens to progress; seconds of each stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._stage, self._since = "", 0.0

    def __call__(self, stage: str, _: float) -> None:
        now = time.perf_counter()
        if self._stage:
            self.seconds[self._stage] = self.seconds.get(self._stage, 0) + now - self._since
        self._stage, self._since = stage, now


def converted(path: Path, folder: str, lights: int | None = None) -> tuple[dict[str, float], int]:
    """All that `sunsplit convert` does: seconds by stage, and how many suns."""
    from sunsplit.core.conversion import convert
    from sunsplit.core.files.conversion import save
    from sunsplit.core.files.maps import load
    from sunsplit.core.report import conversion_lines
    from sunsplit.core.settings import ConversionSettings

    clock = StageClock()
    environment = load(path, progress=clock)
    conversion = convert(environment, ConversionSettings(lights=lights), clock)
    clock("writing", 0.0)
    files = save(conversion, folder)
    conversion_lines(conversion, files)  # reads the account again from the files
    clock("", 1.0)
    return {name: clock.seconds.get(name, 0.0) for name in STAGES}, len(conversion.suns)


def read_by_oiio(path: Path) -> None:
    import OpenImageIO as oiio

    source = oiio.ImageInput.open(str(path))
    source.read_image(oiio.FLOAT)
    source.close()


def read_by_openexr(path: Path) -> None:
    import OpenEXR

    with OpenEXR.File(str(path)):
        pass


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def measure(path: Path, repeat: int) -> dict[str, object]:
    """In this process: see the module."""
    is_exr = path.suffix == ".exr"
    oiio, openexr, whole, stages, suns = [], [], [], [], 0
    with tempfile.TemporaryDirectory() as folder:
        converted(path, folder)  # imports everything, and brings the file into memory
        for _ in range(repeat):
            oiio.append(seconds(lambda: read_by_oiio(path)))
            openexr.append(seconds(lambda: read_by_openexr(path)) if is_exr else 0.0)
            found, suns = converted(path, folder)
            stages.append(found)
            whole.append(sum(found.values()))
    return {
        "by_oiio": median(oiio),
        "by_openexr": median(openexr),
        "whole": median(whole),
        "stages": {name: median(one[name] for one in stages) for name in STAGES},
        "suns": suns,
    }


def peak_memory(path: Path) -> dict[str, object]:
    """Of this process, after one conversion."""
    with tempfile.TemporaryDirectory() as folder:
        converted(path, folder)
    # Not by getrusage, which counts what the parent had when it began this process.
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return {"peak": int(status.partition("VmHWM:")[2].split()[0]) * 1024}


def seconds_by_lights(path: Path, repeat: int) -> dict[str, object]:
    """Of a whole conversion with each number of lights."""
    with tempfile.TemporaryDirectory() as folder:
        converted(path, folder)
        runs = [
            [sum(converted(path, folder, count)[0].values()) for count in LIGHTS]
            for _ in range(repeat)
        ]
    return dict(zip(map(str, LIGHTS), np.median(runs, axis=0).tolist(), strict=True))


def in_a_process(what: str, path: Path, repeat: int) -> dict[str, object]:
    """The answer of a child process of this module."""
    command = [sys.executable, "-m", __spec__.name, "--child", what, str(path)]
    done = subprocess.run(
        [*command, "--repeat", str(repeat)], check=True, capture_output=True, text=True
    )
    return json.loads(done.stdout)


def costs(
    maps: list[Path], widths: list[int], kinds: list[Kind], repeat: int, folder: Path
) -> Iterator[Cost]:
    for source in maps:
        for width in widths:
            for kind in kinds:
                path = folder / f"{source.stem}_{width}.{kind.ending}"
                make(source, width, kind, path)
                times = in_a_process("times", path, repeat)
                peak = in_a_process("peak", path, repeat)
                size = path.stat().st_size
                path.unlink()
                yield Cost(source.stem, width, kind.name, size, **times, **peak)


def table(found: list[Cost]) -> list[str]:
    """Of each size and kind of file, over the maps: markdown."""
    heads = ("width", "file", "OpenImageIO s", "OpenEXR s", "convert s", *STAGES)
    heads += ("convert / OpenImageIO", "convert / faster", "memory MB", "memory / float32 pixels")
    lines = ["| " + " | ".join(heads) + " |", "| " + "--- | " * len(heads)]
    for width in sorted({one.width for one in found}):
        for kind in dict.fromkeys(one.kind for one in found if one.width == width):
            same = [one for one in found if (one.width, one.kind) == (width, kind)]
            exr = median(one.by_openexr for one in same)
            seconds_of = [
                f"{median(one.by_oiio for one in same):.3f}",
                f"{exr:.3f}" if exr else "",
                f"{median(one.whole for one in same):.3f}",
                *(f"{median(one.stages[name] for one in same):.3f}" for name in STAGES),
            ]
            ratios = [
                f"{geometric_mean(values):.2f} ({max(values):.2f})"
                for values in (
                    [one.ratio_to_oiio for one in same],
                    [one.ratio for one in same],
                )
            ]
            memory = [
                f"{max(one.peak for one in same) / 1e6:.0f}",
                f"{max(one.memory_ratio for one in same):.2f}",
            ]
            lines.append(
                "| " + " | ".join([str(width), kind, *seconds_of, *ratios, *memory]) + " |"
            )
    return lines


def plot(found: list[Cost], by_lights: dict[str, float], path: Path) -> None:
    """Growth with the number of pixels, and with the number of lights."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for kind in dict.fromkeys(one.kind for one in found):
        same = [one for one in found if one.kind == kind]
        widths = sorted({one.width for one in same})
        colour = left.plot([], [])[0].get_color()
        for style, value in (("o-", "whole"), ("x:", "read")):
            of_width = [
                median(getattr(one, value) for one in same if one.width == width)
                for width in widths
            ]
            label = f"{kind}: {'convert' if value == 'whole' else 'only read'}"
            left.plot([w * w / 2e6 for w in widths], of_width, style, color=colour, label=label)
    first = [one for one in found if one.width == min(o.width for o in found)]
    start, most = first[0].width ** 2 / 2e6, max(one.width for one in found) ** 2 / 2e6
    level = median(one.whole for one in first)
    left.plot([start, most], [level, level * most / start], "k--", lw=1, label="linear in pixels")
    left.set(xscale="log", yscale="log", xlabel="million pixels", ylabel="seconds")
    figure.legend(fontsize=7, loc="outside left upper")
    right.plot([int(n) for n in by_lights], list(by_lights.values()), "o-")
    right.set(xscale="log", xlabel="lights asked for", ylabel="seconds of a whole conversion")
    right.set_ylim(bottom=0)
    figure.savefig(path, dpi=110)


def run(maps: list[Path], out: Path, widths: list[int], kinds: list[Kind], repeat: int) -> None:
    """Measure, and write a table and a plot."""
    with tempfile.TemporaryDirectory() as folder:
        found = []
        for cost in costs(maps, widths, kinds, repeat, Path(folder)):
            found.append(cost)
            print(
                f"{cost.name} {cost.width} {cost.kind}: {cost.ratio:.2f} of reading, "
                f"{cost.whole:.3f} s, {cost.suns} suns, {cost.peak / 1e6:.0f} MB",
                flush=True,
            )
        middle = Path(folder) / "lights.exr"
        make(maps[0], min(4096, max(widths)), KINDS[1], middle)
        by_lights = in_a_process("lights", middle, repeat)
    report(found, by_lights, min(4096, max(widths)), out)


def report(found: list[Cost], by_lights: dict[str, float], width: int, out: Path) -> None:
    """Figures, table and plot. by_lights: seconds of the first map, so wide, for each number."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "conversion.json").write_text(
        json.dumps([asdict(one) for one in found], indent=1) + "\n", encoding="utf-8"
    )
    lines = [
        "Medians of interleaved runs; ratios: geometric mean over the maps (worst map), to reading "
        "by OpenImageIO and by the faster library.",
        "",
        *table(found),
        "",
        f"Seconds of a whole conversion of {found[0].name}, {width} wide, by lights asked for: "
        + ", ".join(f"{n}: {s:.2f}" for n, s in by_lights.items())
        + ".",
        "",
    ]
    (out / "conversion.md").write_text("\n".join(lines), encoding="utf-8")
    plot(found, by_lights, out / "conversion.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("maps", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--widths", nargs="+", type=int, default=list(WIDTHS))
    parser.add_argument("--kinds", nargs="+", default=[kind.name for kind in KINDS])
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--child", choices=("times", "peak", "lights"))
    options = parser.parse_args()
    if options.child:
        path = options.maps[0]
        work = {
            "times": lambda: measure(path, options.repeat),
            "peak": lambda: peak_memory(path),
            "lights": lambda: seconds_by_lights(path, options.repeat),
        }
        print(json.dumps(work[options.child]()))
        return
    kinds = [kind for kind in KINDS if kind.name in options.kinds]
    run(options.maps, options.output, options.widths, kinds, options.repeat)


if __name__ == "__main__":
    main()
