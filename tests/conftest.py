"""Shared fixtures: where the outside values lie, the same random examples in every run, no waste of time."""

import atexit
import gc
import logging
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("HYPOTHESIS_NO_PLUGINS", "1")  # whose import takes as long again

import pytest

sys.path.append(str(Path(__file__).parent))  # the files that tests of several folders share

from outside import OutsideData
from sources import forget
from unchanged import Seen

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # a worker for each processor: more threads wait, busily
gc.set_threshold(20_000, 20, 20)
gc.disable()  # until all tests are known: what is loaded stays

MEMORY = Path("/dev/shm")
ROOM = 2 << 30  # bytes; a whole run writes an eighth of it


def has_room(folder: Path) -> bool:
    """Whether the folders of tests may lie there, programs that they build and run among them."""
    if not (folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)):
        return False
    return not os.statvfs(folder).f_flag & os.ST_NOEXEC and shutil.disk_usage(folder).free > ROOM


if "TMPDIR" not in os.environ and has_room(MEMORY):  # a file written anew on a disk waits for it
    os.environ["TMPDIR"] = tempfile.tempdir = str(MEMORY)

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as under a runner in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config: pytest.Config) -> None:
    """Where tests run, random examples are the same in every run."""
    if hands_out(config):
        return
    if is_worker(config):
        atexit.register(os._exit, 0)  # the last to be called: what is there need not be taken down one by one
    from hypothesis import settings

    settings.register_profile("fixed", derandomize=True, deadline=None)
    settings.load_profile("fixed")


def pytest_collection_finish() -> None:
    """What is there when tests begin stays to the end: nobody need look whether it is garbage."""
    gc.freeze()
    gc.enable()


def hands_out(config: pytest.Config) -> bool:
    """Whether this process only hands tests to others."""
    return bool(config.getoption("numprocesses", None)) and not is_worker(config)


def is_worker(config: pytest.Config) -> bool:
    """Whether another process hands tests to this one."""
    return hasattr(config, "workerinput")


def pytest_sessionfinish() -> None:
    """What tests have left open is looked for when they have ended, among little else."""
    forget()


@pytest.fixture(scope="package")
def shared_data() -> OutsideData:
    """The outside values: `shared_data / "nist-strd-dev"` is the folder of a data set."""
    return OutsideData()


@pytest.fixture(scope="session")
def seen(pytestconfig: pytest.Config) -> Seen:
    """What was seen to hold of the equations, the generator and what it wrote, as these are now."""
    return Seen(getattr(pytestconfig, "cache", None))


@pytest.fixture
def logged() -> Iterator[list[logging.LogRecord]]:
    """What the library warns of; pytest's own `caplog` is paid for by each of the tests that use none."""
    found: list[logging.LogRecord] = []
    handler = logging.Handler(logging.WARNING)
    handler.emit = found.append  # type: ignore[method-assign]
    logging.getLogger("obseq").addHandler(handler)
    yield found
    logging.getLogger("obseq").removeHandler(handler)
