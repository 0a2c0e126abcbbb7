"""Killed at any moment, a library's conversion goes on as if nothing had been."""

from __future__ import annotations

import random

from tests.killing import killed, kills, undisturbed
from tests.libraries import contents, write_maps

TRIALS = 3
"""By hand there are more: `python -m tests.benchmarks.library`."""


def test_killed_and_started_again_gives_the_same_bytes(tmp_path):
    library = tmp_path / "library"
    library.mkdir()
    write_maps(library, 16)
    seconds = undisturbed(library, tmp_path / "whole")
    whole = contents(tmp_path / "whole")
    assert len(whole) >= 3 * 16
    hits = 0
    for out, _, hit in kills(library, tmp_path, seconds, TRIALS, seed=8):
        assert contents(out) == whole
        hits += hit
    assert hits, "no run was met before its end"


def test_killed_again_and_again_it_comes_to_its_end(tmp_path):
    library = tmp_path / "library"
    library.mkdir()
    write_maps(library, 16)
    seconds = undisturbed(library, tmp_path / "whole")
    lots = random.Random(9)
    for number in range(4):
        killed(library, tmp_path / "out", lots.uniform(0.3, 1.0) * seconds, number % 2 == 0)
    undisturbed(library, tmp_path / "out")
    assert contents(tmp_path / "out") == contents(tmp_path / "whole")
