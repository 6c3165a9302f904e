"""Shared fixtures: where the outside values lie; and the same random examples in every run."""

import signal
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as under a runner in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
EXCERPTS = Path(__file__).parent / "data"


@dataclass(frozen=True)
class OutsideData:
    """Data sets by name: those beside the repository, else the excerpts in `tests/data`.

    Attributes:
        folders: Where they are looked for, in order.
    """

    folders: tuple[Path, ...] = (SHARED_DATA, EXCERPTS)

    def __truediv__(self, path: str) -> Path:
        """A data set, or a file in one; a test that asks for one that is nowhere is skipped."""
        data_set = Path(path).parts[0]
        for folder in self.folders:
            if (folder / data_set).is_dir():
                return folder / path
        pytest.skip(reason=f"the data set {data_set} is not beside the repository: {SHARED_DATA}")


@pytest.fixture(scope="package")
def shared_data() -> OutsideData:
    """The outside values: `shared_data / "nist-strd-dev"` is the folder of a data set."""
    return OutsideData()
