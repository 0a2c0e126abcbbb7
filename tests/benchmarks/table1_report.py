"""Table 1 as Markdown: what was measured beside what the paper says."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import bpy
import numpy as np

if TYPE_CHECKING:
    from tests.benchmarks.table1 import Result, Table

FINDINGS = "## What follows"
"""From this line on a report is written by hand, and kept."""

COLUMNS = (
    "method",
    "spp",
    "lamps",
    "cells",
    "world sampling",
    "error",
    "bias",
    "noise",
    "mean",
    "worst",
    "s",
    "conversion s",
    "error / IS 64",
    "paper's",
    "time / IS 64",
    "paper's",
)


PREAMBLE = """\
# Table 1 of the paper, measured again in Cycles

Zang and Velho compare ways to light a figurine with an HDRI in PBRT (Table 1, Figure 4). The
same rows in Cycles, made by `.venv-5.2/bin/python -m tests.benchmarks.table1`. Each map goes
through the add-on, as a user's would.

- Blender {blender} on the CPU, {size} pixels, map `{map}`. Direct light only (0 bounces), no
  adaptive sampling, denoising or clamping, light threshold 0; all else as Blender sets it up,
  the light tree included.
- **spp**: the paper's "amostras por pixel", which are shadow rays: PBRT sends one to each lamp.
  Cycles picks one light for each camera ray, so here they are camera rays with one shadow ray
  each.{scaled}
- **error**: RMS of (render - reference) over the channels of the {pixels} pixels that show
  nothing but surfaces, relative to the reference's mean; median of {repeats}, each with its own
  seed.
- The reference is the plain HDRI at {reference} spp, two seeds of half as many; its own noise
  is {noise}.
- **bias**: the part of the error that no number of samples takes away, from products of
  differences that have no render in common; 0 where these came out negative. IS has none: what
  its rows show says how well it is known. **noise**: the error without bias and the reference's
  noise. **mean**: of the surfaces, against the reference. **worst**: the largest error of the
  repeats; where it is far above the median, a firefly was in one of them.
- **s**: wall seconds of the render call, Cycles' own preparation included; median of
  one run, the rows in turn. Only ratios can be compared with the paper's. **conversion s**:
  once per map.
- **lamps**: may be fewer than asked for, as none are nearer than a pixel to another.
- **IS**: the plain HDRI. **FHIS**: its Voronoi map of {cells} Penrose samples. **FHIS +
  D.L.(OS)**: half of the light as at most 64 point lamps, region B as a Voronoi map M_BV.
  **D.L.**: all of it as lamps.
- The paper lists two rows of FHIS + D.L.(OS) a second time with other figures and does not say
  what differs. Here the second pair (**M_B**) keeps region B as the map itself, section 3's
  other way.
- The last two rows are Sunsplit's own, not the paper's: a conversion with the default settings.
"""
_SCALED = " Here all were divided by {}."


def write(table: Table) -> str:
    """Write table1.md, and give what was written without what was kept."""
    path = table.options.output / "table1.md"
    kept = ""
    if path.exists():
        _, heading, kept = path.read_text().partition(FINDINGS)
        kept = heading + kept
    report = "\n".join(_lines(table)) + "\n"
    path.write_text(f"{report}\n{kept}" if kept else report)
    return report


def _lines(table: Table) -> Iterator[str]:
    yield PREAMBLE.format(
        blender=bpy.app.version_string,
        map=table.map_name,
        size=f"{table.options.size} x {table.options.size}",
        scaled=_SCALED.format(table.options.scale) if table.options.scale > 1 else "",
        pixels=f"{table.surface.sum():,}",
        repeats=table.options.repeats,
        reference=f"{table.options.reference:,}",
        noise=f"{table.reference_noise():.4f}",
        cells=table.options.cells,
    )
    yield "| " + " | ".join(COLUMNS) + " |"
    yield "| --- " * len(COLUMNS) + "|"
    for result in table.results:
        yield "| " + " | ".join(_cells(table, result)) + " |"
    yield "\n![Error of each row](table1-error.png)\n\n![Time of each row](table1-time.png)\n"
    yield "![Renders of each row](table1-renders.png)"


def _cells(table: Table, result: Result) -> Iterator[str]:
    row, base = result.row, table.results[0]
    yield row.method
    yield str(max(row.samples // table.options.scale, 1))
    yield str(result.prepared.lamps or "")
    yield str(result.prepared.cells or "")
    yield result.prepared.sampling
    yield f"{table.error(result):.4f}"
    yield _number(table.bias(result))
    yield _number(table.noise(result))
    yield f"{table.brightness(result):+.2%}"
    yield f"{max(table.errors(result)):.4f}"
    yield f"{np.median(result.seconds):.2f}"
    yield f"{result.prepared.seconds:.2f}" if row.settings else ""
    yield f"{table.error(result) / table.error(base):.2f}"
    yield f"{row.paper[0] / base.row.paper[0]:.2f}" if row.paper else ""
    yield f"{np.median(result.seconds) / np.median(base.seconds):.2f}"
    yield f"{row.paper[1] / base.row.paper[1]:.2f}" if row.paper else ""


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.4f}"
