"""Killed at any moment, a library's conversion goes on as if nothing had been."""

from __future__ import annotations

import random
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.killing import killed, kills, undisturbed
from tests.libraries import contents, write_maps

TRIALS = 3
"""By hand there are more: `python -m tests.benchmarks.library`."""


@dataclass(frozen=True)
class Whole:
    """A library of 16 maps; what an undisturbed run makes of it, and its seconds."""

    library: Path
    contents: dict[str, bytes]
    seconds: float


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Whole:
    folder = tmp_path_factory.mktemp("whole")
    library = folder / "library"
    library.mkdir()
    write_maps(library, 16)
    seconds = undisturbed(library, folder / "out")
    return Whole(library, contents(folder / "out"), seconds)


def test_killed_and_started_again_gives_the_same_bytes(whole, tmp_path):
    assert len(whole.contents) >= 3 * 16
    hits = 0
    for out, _, hit in kills(whole.library, tmp_path, whole.seconds, TRIALS, seed=8):
        assert contents(out) == whole.contents
        hits += hit
    assert hits, "no run was met before its end"


def test_killed_again_and_again_it_comes_to_its_end(whole, tmp_path):
    lots, out = random.Random(9), tmp_path / "out"
    for number in range(4):
        killed(whole.library, out, lots.uniform(0.3, 1.0) * whole.seconds, number % 2 == 0)
    undisturbed(whole.library, out)
    assert contents(out) == whole.contents
