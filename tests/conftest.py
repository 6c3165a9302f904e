"""Shared fixtures: where the outside values lie, the same random examples in every run, no waste of time."""

import gc
import os
import signal
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # a worker for each processor: more threads wait, busily
gc.set_threshold(20_000, 20, 20)

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as under a runner in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_finish() -> None:
    """What is there when tests begin stays to the end: nobody need look again whether it is garbage."""
    gc.collect()
    gc.freeze()


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
