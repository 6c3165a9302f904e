"""A line on the terminal that says what is being done, once it has lasted long enough to wonder."""

import re
import shutil
import sys
import threading
import time
from types import TracebackType
from typing import Self

from obseq.printable import printable_line

PATIENCE = 2.0
"""Seconds of silence before the line appears."""

PERIOD = 0.5
COUNT = re.compile(r"(?P<what>.*?)(?P<number>\d+) of (?P<total>\d+)")
"""A message that says how far the work is."""
ERASE = "\r\x1b[K"


class Progress:
    """What is being done and for how long, on standard error; silent when that is not a terminal.

    Example:
        >>> with Progress("reading") as progress:
        ...     progress("adjusting: iteration 1")
    """

    def __init__(self, message: str) -> None:
        self._message, self._counted = message, ("", 0.0)
        self._start = time.monotonic()
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._show, daemon=True)

    def __call__(self, message: str) -> None:
        """Say what is being done now; of what ends in "3 of 20", how long the rest will take as well."""
        count = COUNT.fullmatch(message)
        if count is None or count["what"] != self._counted[0]:
            self._counted = (count["what"] if count else "", time.monotonic())
        elif (done := int(count["number"]) - 1) > 0:
            spent = time.monotonic() - self._counted[1]
            message += f", about {spent / done * (int(count['total']) - done):.0f} s left"
        self._message = message

    def tell(self, text: str) -> None:
        """Say what stays on the screen, beside results, which go to standard output."""
        sys.stderr.write((ERASE if self._thread.is_alive() else "") + text)
        sys.stderr.flush()

    def __enter__(self) -> Self:
        if sys.stderr.isatty():
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._done.set()
        if self._thread.is_alive():
            self._thread.join()

    def _show(self) -> None:
        if self._done.wait(PATIENCE):
            return
        while True:
            line = printable_line(f"{self._message} ... {time.monotonic() - self._start:.0f} s")
            sys.stderr.write(ERASE + line[: shutil.get_terminal_size().columns - 1])
            sys.stderr.flush()
            if self._done.wait(PERIOD):
                break
        sys.stderr.write(ERASE)
        sys.stderr.flush()
