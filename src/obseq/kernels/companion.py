"""A thread that is kept for evaluations, and shares their rows with the thread that asks for them.

To start a thread for each takes longer than to evaluate ten thousand rows, and so does to wake one on some
machines. This one looks for a moment, busily, whether there is more to do before it sleeps; and nobody waits
for it to wake up: it takes what rows are left when it does.
"""

from __future__ import annotations

import atexit
import ctypes
import math
import os
import threading
import time
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from obseq.kernels import shared_rows
from obseq.kernels.layout import LANES, STRIDE
from obseq.kernels.tiles import evaluate_rows

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.arrays import FloatArray

    Arrays = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
    Scratch = tuple[FloatArray, FloatArray]

CHUNK_DOUBLES = 8192
"""Numbers in the tiles of the rows that a thread takes at a time: some microseconds of work."""

LOOKS = 6000
"""How often the thread looks for more to do before it sleeps: some tenths of a millisecond."""

PATIENCE = 2000
"""How often the caller looks whether it has finished before it sleeps, too."""

NAP = 5e-5
"""Seconds that the caller sleeps then between looks."""

MOST_SLOW = 4
"""Evaluations of a kernel, one after the other, that may take longer together than alone."""

MOST_ALONE = 256
"""Evaluations of it that are done alone then, at most."""

FIRST_ALONE = 2
"""Evaluations of it that are done alone first; one may be the first of all, for which code is loaded."""

NOW_AND_THEN = 64
"""One of so many evaluations is done alone, to know what that takes."""

UNKNOWN = -1
"""The processor that a thread runs on, where the system does not say."""


class Trend:
    """What evaluations of a kernel take, alone and together: whichever was faster is done again.

    It depends on the machine, on what else it does, and on how soon one evaluation follows the other, since a
    thread that sleeps takes some time to wake.
    """

    def __init__(self) -> None:
        self._count, self._alone = 0, math.inf
        self._slow, self._left, self._most_left = 0, 0, 0

    def shares(self) -> bool:
        """Whether the next evaluation is to be done together."""
        self._count += 1
        if self._left:
            self._left -= 1
            return False
        return self._count > FIRST_ALONE and self._count % NOW_AND_THEN != 0

    def note(self, is_shared: bool, seconds: float) -> None:
        """Takes note of how long a row has taken."""
        if not is_shared:
            self._alone = min(seconds, 0.75 * self._alone + 0.25 * seconds)
        elif seconds < self._alone:
            self._slow = self._most_left = 0
        else:
            self._slow += 1
            if self._slow == MOST_SLOW:
                self._slow, self._most_left = 0, min(2 * self._most_left + MOST_SLOW, MOST_ALONE)
                self._left = self._most_left


class Companion:
    """The thread, and what it knows."""

    def __init__(self) -> None:
        self._board = shared_rows.new_board(_give_way())
        self._is_free, self._wake = threading.Lock(), threading.Lock()
        self._wake.acquire()
        self._sleeps, self._ends = True, False
        self._held: tuple[FloatArray, ...] = ()
        self._kept_off = UNKNOWN
        self._tiles: dict[int, FloatArray] = {}
        self._trends: dict[int, Trend] = {}
        shared_rows.help_with_rows(self._board, 0)  # it is compiled now
        self._thread = threading.Thread(target=self._work, name="obseq-companion", daemon=True)
        self._thread.start()
        atexit.register(self.end)

    def evaluate(
        self, address: int, n_rows: int, arrays: Arrays, scratch: Scratch, new_tiles: Callable[[], FloatArray]
    ) -> None:
        """Evaluates rows of arguments: together, or alone where that is faster or the thread helps others.

        Args:
            address: Address of the kernel.
            n_rows: Rows of its tiles.
            arrays: Unknowns, observations, residuals and what the kernel writes after them.
            scratch: Tiles, and the rows with which results go past the caches, or none of these.
            new_tiles: Makes the same tiles, for the other thread.

        Raises:
            KeyboardInterrupt: it was interrupted, and nothing is written any more.
        """
        trend = self._trends.get(address) or self._trends.setdefault(address, Trend())
        start = time.perf_counter()
        is_shared = trend.shares() and self._share(address, n_rows, arrays, scratch, new_tiles)
        if not is_shared:
            evaluate_rows(address, scratch[0], n_rows, *arrays, 0, len(arrays[0]), scratch[1])
        trend.note(is_shared, (time.perf_counter() - start) / len(arrays[0]))

    def _share(
        self, address: int, n_rows: int, arrays: Arrays, scratch: Scratch, new_tiles: Callable[[], FloatArray]
    ) -> bool:
        """Evaluates rows of arguments together; false where the thread helps others."""
        is_mine = False
        try:
            is_mine = self._is_free.acquire(blocking=False)
            if not is_mine:
                return False
            tiles, rows = scratch
            if address not in self._tiles:
                self._tiles[address] = new_tiles()
            others = self._tiles[address], np.empty_like(rows)
            batch = tiles.size // (n_rows * STRIDE) * LANES
            chunk = batch * max(1, CHUNK_DOUBLES // (n_rows * batch))
            self._settle()
            self._held = (*arrays, *others)
            self._call()
            shared_rows.share_rows(self._board, chunk, PATIENCE, address, n_rows, *arrays, *scratch, *others)
        finally:
            if is_mine:
                self._leave_off()
        return True

    def end(self) -> None:
        """Ends the thread: when Python itself ends, it must not run any more."""
        self._ends = True
        self._rouse()
        with suppress(KeyboardInterrupt):  # the program ends already
            self._thread.join()

    def _call(self) -> None:
        """Wakes the thread if it sleeps; if it is about to sleep, it will not be there this time."""
        self._keep_off(_processor())
        if self._sleeps:
            self._rouse()

    def _keep_off(self, processor: int) -> None:
        """Keeps the thread off the processor of the caller, with whom it would take turns."""
        if processor == self._kept_off:
            return
        others, thread = os.sched_getaffinity(0) - {processor}, self._thread.native_id
        if others and thread is not None:
            with suppress(OSError):  # it may run elsewhere only since just now
                os.sched_setaffinity(thread, others)
        self._kept_off = processor

    def _rouse(self) -> None:
        with suppress(RuntimeError):  # it has been called before, and has not woken up yet
            self._wake.release()

    def _leave_off(self) -> None:
        """Lets go of the arrays when nobody writes to them any more, and of the thread in any case."""
        try:
            self._settle()
            self._held = ()
        finally:
            self._is_free.release()

    def _settle(self) -> None:
        """Waits until the thread has written what it has taken."""
        while self._board[shared_rows.AT_WORK] > 0:
            time.sleep(NAP)

    def _work(self) -> None:
        while not self._ends:
            self._sleeps = True
            self._wake.acquire()
            self._sleeps = False
            shared_rows.help_with_rows(self._board, LOOKS)


def companion() -> Companion | None:
    """The companion of this process, or None while another thread makes it."""
    found = _COMPANIONS.get(os.getpid())
    if found is None and _MAKING.acquire(blocking=False):
        try:
            found = _COMPANIONS[os.getpid()] = Companion()
        finally:
            _MAKING.release()
    return found


@cache
def _system() -> ctypes.PyDLL | None:
    """Functions of the system, where it says which processor a thread runs on, and can be told; else None.

    They take less than letting go of Python's lock, which the other thread may be waiting for.
    """
    if not hasattr(os, "sched_setaffinity"):
        return None
    system = ctypes.PyDLL(None)
    return system if hasattr(system, "sched_getcpu") else None


def _give_way() -> int:
    """Address of the function by which a thread lets others have its processor, or 0."""
    system = _system()
    return 0 if system is None else ctypes.cast(system.sched_yield, ctypes.c_void_p).value or 0


def _processor() -> int:
    """The processor that this thread runs on."""
    system = _system()
    return UNKNOWN if system is None else int(system.sched_getcpu())


_COMPANIONS: dict[int, Companion] = {}
"""By the number of the process: a copy of it has none of its threads."""

_MAKING = threading.Lock()
