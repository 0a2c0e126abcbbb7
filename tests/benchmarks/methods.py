"""Every method on every map: lights made of lights asked for, account, time.

    python -m tests.benchmarks.methods MAP... [-o DIR] [--lights 1 2 3 64 1000]

Each map is converted whole (share 1) and composite (share 0.5, Voronoi residual). A run ends with
an error where a promise is broken: too few lights without a stated reason, an account that does
not close, a number that is none, a warning.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import get_args

import numpy as np

from sunsplit.core import ConversionSettings, EnvironmentMap, convert, load
from sunsplit.core.settings import Method
from sunsplit.core.tolerances import ACCOUNT

METHODS = get_args(Method)

KINDS = {
    "whole": {"share": 1.0, "residual": "none"},
    "composite": {"share": 0.5, "residual": "voronoi"},
}


@dataclass(frozen=True)
class Run:
    """One conversion. reason: of fewer lights than asked for. error: of the account."""

    map: str
    kind: str
    method: str
    asked: int
    made: int
    reason: str
    error: float
    seconds: float


def run(found: EnvironmentMap, kind: str, method: str, lights: int) -> Run:
    """Convert once and check what every conversion promises."""
    settings = ConversionSettings(lights=lights, method=method, **KINDS[kind])
    start = time.perf_counter()
    conversion = convert(found, settings)
    seconds = time.perf_counter() - start
    made, reason = len(conversion.suns), " ".join(conversion.notes)
    numbers = [
        np.concatenate(
            [sun.to_light, sun.irradiance, sun.scalar_irradiance, [sun.angular_diameter]]
        )
        for sun in conversion.suns
    ]
    error = float(conversion.account.relative_error.max())
    where = f"{found.name}, {kind}, {method}, {lights} lights"
    stated = f"{made} of {lights} lights" in reason
    if made > lights or (made < lights and not stated):
        raise AssertionError(f"{where}: {made} lights without a reason")
    if not np.isfinite(numbers).all():
        raise AssertionError(f"{where}: a sun is not finite")
    if conversion.residual is not None and not np.isfinite(conversion.residual).all():
        raise AssertionError(f"{where}: the residual is not finite")
    if not error <= ACCOUNT:
        raise AssertionError(f"{where}: the account is off by {error:.1e}")
    return Run(found.name, kind, method, lights, made, reason, error, seconds)


def table(runs: Sequence[Run]) -> str:
    """A line for each kind, method and number of lights, over all maps."""
    maps = sorted({one.map for one in runs})
    lines = [
        f"{len(maps)} maps: {', '.join(maps)}.",
        "Seconds are of one conversion each on a shared machine: orders of magnitude.",
        "",
        "| map as | method | lights asked | lights made, fewest to most (maps with all) "
        "| largest error of the account | seconds, median (most) |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for kind in KINDS:
        for method in METHODS:
            for asked in sorted({one.asked for one in runs}):
                some = [r for r in runs if (r.kind, r.method, r.asked) == (kind, method, asked)]
                made = [one.made for one in some]
                whole = sum(count == asked for count in made)
                seconds = [one.seconds for one in some]
                lines.append(
                    f"| {kind} | {method} | {asked} | {min(made)} to {max(made)} ({whole}) "
                    f"| {max(one.error for one in some):.1e} "
                    f"| {median(seconds):.2f} ({max(seconds):.2f}) |"
                )
    fewer = [one for one in runs if one.made < one.asked]
    lines += ["", f"Fewer lights than asked for, {len(fewer)} of {len(runs)} runs, and why:", ""]
    lines += [
        "| map | as | method | asked | made | reason |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {r.map} | {r.kind} | {r.method} | {r.asked} | {r.made} | {r.reason} |" for r in fewer
    ]
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> list[Run]:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("maps", nargs="+", type=Path, metavar="MAP")
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--lights", type=int, nargs="+", default=[1, 2, 3, 64, 1000])
    options = parser.parse_args(arguments)
    warnings.simplefilter("error")
    runs = []
    for path in options.maps:
        found = load(path)
        for kind in KINDS:
            for lights in options.lights:
                for method in METHODS:
                    runs.append(run(found, kind, method, lights))
        print(f"{found.name}: {sum(one.seconds for one in runs if one.map == found.name):.1f} s")
    options.output.mkdir(parents=True, exist_ok=True)
    path = options.output / "methods.md"
    path.write_text(table(runs), encoding="utf-8")
    print(path)
    return runs


if __name__ == "__main__":
    main()
