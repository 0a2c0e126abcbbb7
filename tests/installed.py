"""What tests need that is no Python package: `./run test` installs it where it can."""

from __future__ import annotations

import os
from typing import NoReturn

import pytest


def not_installed(sentence: str) -> NoReturn:
    """Skip with a sentence; where all must be tested, with `CI` set, that is a failure."""
    if os.environ.get("CI"):
        pytest.fail(sentence)
    pytest.skip(sentence)
