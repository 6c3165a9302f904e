"""Seconds spent in each part of the work: the one clock of the library and of the command line."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import ClassVar

Progress = Callable[[str], None]
PERIOD = 0.25
"""Seconds between two counts of one loop."""
_LISTENER: ContextVar[Progress | None] = ContextVar("listener", default=None)
"""Who is told of counts; nobody but inside `Stopwatch.counted`."""


class Stopwatch:
    """Seconds spent in each phase of the work.

    Args:
        progress: Receives what is being done.

    Attributes:
        seconds: By phase, in the order of their beginning.
        progress: Receives what is being done.
        begun: When the process of a command began: its first phase counts from there.
    """

    begun: ClassVar[float | None] = None

    def __init__(self, progress: Progress | None = None) -> None:
        self.seconds: dict[str, float] = {}
        self.progress = progress or silent

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Adds the time of a block to a phase, and announces it."""
        self.progress(name)
        start, Stopwatch.begun = Stopwatch.begun or time.perf_counter(), None
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    @contextmanager
    def counted(self, name: str) -> Iterator[None]:
        """Announces a block, and tells how far the loops inside are that have a `Tally`."""
        self.progress(name)
        token = _LISTENER.set(None if self.progress is silent else self.progress)
        try:
            yield
        finally:
            _LISTENER.reset(token)


class Tally:
    """Tells how far a loop is, a few times a second, if anybody listens.

    Args:
        what: Is counted.
        total: How many there are.
    """

    def __init__(self, what: str, total: int) -> None:
        self._listener, self._what, self._total = _LISTENER.get(), what, total
        self._next = time.monotonic() + PERIOD

    @property
    def is_heard(self) -> bool:
        """Whether anybody listens."""
        return self._listener is not None

    @property
    def is_due(self) -> bool:
        """Whether it is time to tell."""
        return self._listener is not None and time.monotonic() >= self._next

    def tell(self, number: int) -> None:
        """Tells how many there have been."""
        if self._listener is not None:
            self._listener(f"{self._what} {number} of {self._total}")
            self._next = time.monotonic() + PERIOD


def silent(_: str) -> None:
    """The progress callback of those who want none."""
