"""One thread at a time: a system that is being solved is changed by nobody else."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from obseq.errors import InputError

SOLVING = "solving"


class Owner:
    """Which thread works on a system."""

    def __init__(self) -> None:
        self._threads: dict[
            str, int
        ] = {}  # its setdefault is atomic, and leaves no lock behind when interrupted

    def __reduce__(self) -> tuple[type[Owner], tuple[()]]:
        return Owner, ()

    def check(self) -> None:
        """Refuses a thread while another one works on the system.

        Raises:
            InputError: another thread does.
        """
        if self._threads.get(SOLVING, threading.get_ident()) != threading.get_ident():
            raise InputError(
                "this system is being solved in another thread: wait for its end, or give each thread its own"
            )

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keeps other threads away.

        Raises:
            InputError: another thread works on the system.
        """
        this, is_nested = threading.get_ident(), SOLVING in self._threads
        try:
            self._threads.setdefault(SOLVING, this)
            self.check()
            yield
        finally:
            if not is_nested and self._threads.get(SOLVING) == this:
                del self._threads[SOLVING]
