"""Table 1 as pictures: error and time as in the paper's Figure 4, and what was rendered."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from PIL import Image, ImageDraw, ImageFont

if TYPE_CHECKING:
    from tests.benchmarks.table1 import Table

OURS, PAPER, EXTRA = "#0072b2", "#e69f00", "#009e73"
"""Told apart by readers with any colour vision (Okabe and Ito)."""


def draw(table: Table) -> None:
    folder, results = table.options.output, table.results
    base = results[0]
    errors = np.array([table.error(r) for r in results]) / table.error(base)
    biases = np.array([table.bias(r) for r in results]) / table.error(base)
    times = np.array([np.median(r.seconds) for r in results]) / np.median(base.seconds)
    papers = np.array([r.row.paper or (math.nan, math.nan) for r in results]) / base.row.paper
    figure = bars(table, errors, papers[:, 0], "RMS error, IS 64 = 1", biases)
    figure.savefig(folder / "table1-error.png", dpi=100)
    figure = bars(table, times, papers[:, 1], "render time, IS 64 = 1")
    figure.savefig(folder / "table1-time.png", dpi=100)
    contact_sheet(table).save(folder / "table1-renders.png", optimize=True)


def bars(
    table: Table,
    ours: np.ndarray,
    papers: np.ndarray,
    title: str,
    biases: np.ndarray | None = None,
) -> Figure:
    """Two bars for each row, the first row on top; a tick where the bias is."""
    figure = Figure(figsize=(9, 7.5), layout="constrained")
    axes = figure.subplots()
    own = np.array([r.row.paper is None for r in table.results])
    # Sunsplit's own rows stand apart from the paper's.
    y = np.arange(len(ours)) + 0.6 * own
    keys = []  # in the legend's order; by itself it would begin with the ticks
    for where, shift, values, colour, label in (
        (~own, -0.2, ours, OURS, "Cycles"),
        (~own, 0.2, papers, PAPER, "PBRT (paper)"),
        (own, 0, ours, EXTRA, "Cycles, not in the paper"),
    ):
        keys.append(axes.barh(y[where] + shift, values[where], 0.38, color=colour, label=label))
        axes.bar_label(keys[-1], fmt="%.2f", padding=3, fontsize=8)
    if biases is not None and np.isfinite(biases).all():
        style = {"color": "black", "linestyle": "none", "marker": "|", "markersize": 11}
        where = y - 0.2 * ~own
        keys += axes.plot(biases, where, **style, markeredgewidth=2, label="of which bias")
    axes.set_yticks(y, [str(r.row) for r in table.results])
    axes.invert_yaxis()
    axes.set_xlabel(title)
    axes.margins(x=0.08, y=0.01)
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(handles=keys, loc="outside upper center", ncols=4, frameon=False)
    return figure


def contact_sheet(table: Table, columns: int = 6, size: int = 220) -> Image.Image:
    """The reference and the first render of each row, all toned alike."""
    labels = [f"reference {table.options.reference}", *(str(r.row) for r in table.results)]
    images = [table.reference, *(r.images[0] for r in table.results)]
    line = 20
    height = math.ceil(len(images) / columns) * (size + line)
    sheet = Image.new("RGB", (columns * (size + 4) - 4, height), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(13)
    scale = 0.8 / max(float(np.quantile(table.reference[table.surface], 0.95)), 1e-9)
    for number, (image, label) in enumerate(zip(images, labels, strict=True)):
        row, column = divmod(number, columns)
        corner = column * (size + 4), row * (size + line)
        draw.text((corner[0] + 2, corner[1] + 2), label, "black", font)
        toned = (np.clip(image * scale, 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)
        picture = Image.fromarray(toned).resize((size, size), Image.Resampling.NEAREST)
        sheet.paste(picture, (corner[0], corner[1] + line))
    return sheet
