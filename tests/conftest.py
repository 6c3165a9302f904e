"""Shared fixtures: where the real data lie; and the same random examples in every run."""

from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="package")
def shared_data() -> Path:
    """The folder of real data kept beside the repository; tests that need it skip without it."""
    if not SHARED_DATA.is_dir():
        pytest.skip(reason=f"the shared data folder is absent: {SHARED_DATA}")
    return SHARED_DATA
