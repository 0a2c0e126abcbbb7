"""What several modules hold exports against: made once by each of pytest's workers."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.exporting import Reference, converted, reference


@pytest.fixture(scope="session")
def wanted(sunrise: Path, tmp_path_factory: pytest.TempPathFactory) -> Reference:
    """The exports' scene under the plain HDRI, by Cycles."""
    return reference(sunrise, tmp_path_factory.mktemp("reference"))


@pytest.fixture(scope="session")
def usual_lights(sunrise: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A conversion as it is by default. Exports go elsewhere."""
    return converted(sunrise, tmp_path_factory.mktemp("usual"))


@pytest.fixture(scope="session")
def lights(sunrise: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A conversion whose plates are right within half of what is asked of them, as tests of the
    split show. Exports go elsewhere."""
    return converted(sunrise, tmp_path_factory.mktemp("conversion"), "--tolerance", "0.3")
