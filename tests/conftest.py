from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("fixed", derandomize=True, deadline=None, database=None)
settings.load_profile("fixed")

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="session")
def sunrise() -> Path:
    """The real HDRI that the project ships."""
    return ROOT / "sample_scenes" / "spruit_sunrise_1k.hdr"
