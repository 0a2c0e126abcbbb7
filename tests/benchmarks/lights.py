"""The error of N lights under occluders, by every method: against N and against run time.

    python -m tests.benchmarks.lights MAP... [-o DIR] [--setups 600] [--seeds 1 2]
                                      [--lights 1 4 16 64 256]

The whole map becomes lights. Each is looked at by the same surfaces behind the same occluders (see
`occluders`), and what they get is compared with what they get of the map itself, in float64.
Errors are root mean squares in percent of the mean irradiance in the open. Seconds are of the
process, all cores together, so that other work on the machine counts little; run with
OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 they are seconds of one core.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sunsplit.core import ConversionSettings, EnvironmentMap, load
from sunsplit.core.environment import LUMINANCE_WEIGHTS
from sunsplit.core.patches import patches_of
from sunsplit.core.placement.edge import edge_suns
from sunsplit.core.placement.sampled import sampled_suns
from sunsplit.core.prediction import Prediction
from sunsplit.core.region import light_of_map
from sunsplit.core.strata import stratify
from tests.benchmarks.occluders import Occluders, draw_occluders, light_of, light_of_suns


@dataclass(frozen=True)
class Way:
    """A method and what its lights look like. by_authors: as its authors describe it."""

    name: str
    settings: ConversionSettings
    by_authors: bool = False


_WHOLE = ConversionSettings(share=1, residual="none")
_POINTS = replace(_WHOLE, shape="point")

WAYS = (
    *(
        Way(f"{method}, {shape}s", replace(_WHOLE, method=method, shape=shape), authors)
        for method in ("median-cut", "variance", "kmeans")
        for shape, authors in (("point", True), ("disc", False))
    ),
    Way("penrose, points at samples", replace(_POINTS, method="penrose", position="sample"), True),
    Way("penrose, points", replace(_POINTS, method="penrose")),
    Way("penrose, discs", replace(_WHOLE, method="penrose")),
    Way("edge, points", _POINTS),
    Way("edge, discs", _WHOLE),
)


@dataclass(frozen=True)
class Run:
    """One way to make lights of one map. Errors are parts of the mean irradiance."""

    map: str
    seed: int
    way: str
    lights: int
    made: int
    luminance: float
    worst_channel: float
    in_the_open: float
    predicted: float
    seconds: float


def runs_of(
    found: EnvironmentMap, seeds: Sequence[int], setups: int, numbers: Sequence[int]
) -> list[Run]:
    """All ways and numbers of lights for one map; each is built once and judged by every seed."""
    directions, flux = light_of(found)
    mean = flux.sum(axis=0) / 4
    judges = []
    for seed in seeds:
        hidden = draw_occluders(found, setups, seed)
        for occluders in (hidden, hidden.without_occluders()):
            judges.append((seed, occluders, occluders.irradiance(directions, flux)))
    light = light_of_map(found.radiance)
    light = light.part(light.luminous_flux > 0)
    strata = stratify(found, 1, 2)
    prediction = Prediction.of(patches_of(light, light.luminous_flux), strata.light)
    runs = []
    for count in numbers:
        for way in WAYS:
            start = time.process_time()
            settings = replace(way.settings, lights=count)
            if settings.method == "edge":
                patches = patches_of(light, strata.luminance.ravel()[light.pixels])
                suns = edge_suns(patches, strata, settings, count).suns
            else:
                suns = sampled_suns(light, strata, settings, count).suns
            seconds = time.process_time() - start
            predicted = prediction.error(suns)
            pieces = light_of_suns(suns)
            for (seed, hidden, truth), (_, opened, free) in zip(
                judges[::2], judges[1::2], strict=True
            ):
                runs.append(
                    Run(
                        found.name,
                        seed,
                        way.name,
                        count,
                        len(suns),
                        *_errors(hidden, pieces, truth, mean),
                        _errors(opened, pieces, free, mean)[0],
                        predicted,
                        seconds,
                    )
                )
    return runs


def _errors(
    occluders: Occluders, pieces: tuple[np.ndarray, np.ndarray], truth: np.ndarray, mean: np.ndarray
) -> tuple[float, float]:
    """Of luminance and of the worst channel."""
    wrong = occluders.irradiance(*pieces) - truth
    luminance = np.sqrt(np.mean((wrong @ LUMINANCE_WEIGHTS) ** 2)) / (mean @ LUMINANCE_WEIGHTS)
    lit = mean > 0
    channels = np.sqrt(np.mean(wrong[:, lit] ** 2, axis=0)) / mean[lit]
    return float(luminance), float(channels.max())


def main(arguments: Sequence[str] | None = None) -> list[Run]:
    from tests.benchmarks import lights_report

    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("maps", nargs="+", type=Path, metavar="MAP")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--setups", type=int, default=600)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--lights", type=int, nargs="+", default=[1, 4, 16, 64, 256])
    options = parser.parse_args(arguments)
    runs = []
    for path in options.maps:
        start = time.perf_counter()
        runs += runs_of(load(path), options.seeds, options.setups, options.lights)
        print(f"{path.stem}: {time.perf_counter() - start:.0f} s", flush=True)
    lights_report.write(runs, options.output)
    return runs


if __name__ == "__main__":
    main()
