"""A small version of each benchmark, so that none rots."""

from __future__ import annotations

import sys

from tests.benchmarks import region_a


def test_region_a(tmp_path, monkeypatch, sunrise):
    arguments = ["region_a", str(sunrise), "--width", "12", "--samples", "2", "--seeds", "2"]
    monkeypatch.setattr(sys, "argv", [*arguments, "-o", str(tmp_path)])
    region_a.main()
    lines = (tmp_path / "region_a.md").read_text().splitlines()
    rows = [line.split("|") for line in lines if line.startswith("| calm")]
    assert len(rows) == len(region_a.ROWS) - 1
    share = {row[1].strip(): float(row[2]) for row in rows}
    # The lower the border, the more light is in the suns.
    assert share["calm 100, NONE"] < share["calm 30, NONE"] < share["calm 10, NONE"]
    assert share["calm 30, as set"] == share["calm 30, 512"]
