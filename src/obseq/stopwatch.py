"""Seconds spent in each part of the work: the one clock of the library and of the command line."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ClassVar

Progress = Callable[[str], None]


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


def silent(_: str) -> None:
    """The progress callback of those who want none."""
