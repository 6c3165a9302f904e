"""Threads for a piece of work, which end with it whatever happens; locks that forked processes find open."""

from __future__ import annotations

import os
import threading
import time
from contextlib import contextmanager
from itertools import count
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _thread import RLock
    from collections.abc import Iterator
    from concurrent.futures import ThreadPoolExecutor
    from threading import Lock

NUMBERS = count()


def processors() -> int:
    """Processors that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def let_go_at_fork(lock: Lock | RLock) -> None:
    """Makes a fork wait until no other thread holds a lock: in the copy nobody would ever let go of it."""
    os.register_at_fork(before=lock.acquire, after_in_parent=lock.release, after_in_child=lock.release)


@contextmanager
def thread_pool(threads: int) -> Iterator[ThreadPoolExecutor]:
    """A pool of threads that all have ended when its block is left.

    Python's own forgets a thread during whose start an interruption arrives, and may make another error
    of that.

    Raises:
        KeyboardInterrupt: the block was interrupted, at any moment.
    """
    from concurrent.futures import ThreadPoolExecutor

    prefix = f"obseq-{next(NUMBERS)}-"
    try:
        with ThreadPoolExecutor(threads, prefix) as pool:
            yield pool
    except BaseException as error:
        _wait_for(prefix)
        if isinstance(error, RuntimeError) and isinstance(error.__context__, KeyboardInterrupt):
            raise KeyboardInterrupt from None
        raise


def _wait_for(prefix: str) -> None:
    """Returns when no thread of the name is left, those that are about to start included."""
    while any(thread.name.startswith(prefix) for thread in threading.enumerate()):
        time.sleep(1e-4)
