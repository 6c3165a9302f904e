"""A thread that is kept for evaluations, and shares their rows with the thread that asks for them.

To start a thread for each takes longer than to evaluate ten thousand rows, and so does to wake one on some
machines. This one looks for a moment, busily, whether there is more to do before it sleeps; and nobody waits
for it to wake up: it takes what rows are left when it does.
"""

from __future__ import annotations

import atexit
import ctypes
import os
import threading
import time
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from obseq.kernels import shared_rows
from obseq.kernels.layout import LANES, STRIDE

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.arrays import FloatArray

LEAST_CHUNK = 512
"""Rows that a thread takes at a time, at least."""

LOOKS = 6000
"""How often the thread looks for more to do before it sleeps: some tenths of a millisecond."""

PATIENCE = 2000
"""How often the caller looks whether it has finished before it sleeps, too."""

NAP = 5e-5
"""Seconds that the caller sleeps then between looks."""

MOST_VAIN = 8
"""So many times the thread may be called in vain, one after the other."""

MOST_ALONE = 255
"""Evaluations that the caller then does alone, at most."""


UNKNOWN = -1
"""The processor that a thread runs on, where the system does not say."""


class Companion:
    """The thread, and what it knows."""

    def __init__(self) -> None:
        self._board = shared_rows.new_board(_give_way())
        self._is_free, self._wake = threading.Lock(), threading.Lock()
        self._wake.acquire()
        self._sleeps, self._ends = True, False
        self._held: tuple[FloatArray, ...] = ()
        self._caller = UNKNOWN
        self._vain, self._alone, self._most_alone = 0, 0, 0
        self._scratch: dict[int, FloatArray] = {}
        shared_rows.help_with_rows(self._board, 0)  # it is compiled now
        self._thread = threading.Thread(target=self._work, name="obseq-companion", daemon=True)
        self._thread.start()
        atexit.register(self.end)

    def evaluate(
        self,
        address: int,
        n_rows: int,
        arrays: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
        scratch: tuple[FloatArray, FloatArray],
        new_scratch: Callable[[], FloatArray],
    ) -> bool:
        """Evaluates rows of arguments together; false where the caller is to do it alone.

        That is so while the thread helps somebody else; and for a while, each time for longer, after it kept
        the caller waiting, or came too late again and again: others keep the processors busy.

        Args:
            address: Address of the kernel.
            n_rows: Rows of its tiles.
            arrays: Unknowns, observations, residuals and what the kernel writes after them.
            scratch: Tiles, and the rows with which results go past the caches, or none of these.
            new_scratch: Makes the same tiles, for the other thread.

        Raises:
            KeyboardInterrupt: it was interrupted, and nothing is written any more.
        """
        is_mine = False
        try:
            is_mine = self._is_free.acquire(blocking=False)
            if not is_mine or self._stays_alone():
                return False
            tiles, rows = scratch
            if address not in self._scratch:
                self._scratch[address] = new_scratch()
            others = self._scratch[address], np.empty_like(rows)
            batch = tiles.size // (n_rows * STRIDE) * LANES
            chunk = batch * max(1, LEAST_CHUNK // batch)
            self._settle()
            self._held = (*arrays, *others)
            self._call()
            helped = shared_rows.share_rows(
                self._board, chunk, PATIENCE, address, n_rows, *arrays, *scratch, *others
            )
            self._judge(helped)
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

    def _stays_alone(self) -> bool:
        """Whether the thread is not asked this time."""
        self._alone -= 1
        return self._alone >= 0

    def _judge(self, helped: int) -> None:
        """Takes note of how many chunks the thread has done, -1 when it kept the caller waiting."""
        if helped > 0:
            self._vain = self._most_alone = 0
            return
        self._vain += 1 if helped == 0 else MOST_VAIN
        if self._vain >= MOST_VAIN:
            self._vain, self._most_alone = 0, min(2 * self._most_alone + 1, MOST_ALONE)
            self._alone = self._most_alone

    def _call(self) -> None:
        """Wakes the thread if it sleeps; if it is about to sleep, it will not be there this time."""
        if self._sleeps:
            self._caller = _processor()
            self._rouse()

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
            _make_room(self._caller)
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
def _system() -> ctypes.CDLL | None:
    """Functions of the system, where it says which processor a thread runs on, and can be told; else None."""
    if not hasattr(os, "sched_setaffinity"):
        return None
    system = ctypes.CDLL(None)
    return system if hasattr(system, "sched_getcpu") else None


def _give_way() -> int:
    """Address of the function by which a thread lets others have its processor, or 0."""
    system = _system()
    return 0 if system is None else ctypes.cast(system.sched_yield, ctypes.c_void_p).value or 0


def _processor() -> int:
    """The processor that this thread runs on."""
    system = _system()
    return UNKNOWN if system is None else int(system.sched_getcpu())


def _make_room(processor: int) -> None:
    """Moves this thread to another processor than that of the caller, with whom it would take turns."""
    if processor == UNKNOWN or _processor() != processor:
        return
    everywhere = os.sched_getaffinity(0)
    if len(everywhere) > 1:
        with suppress(OSError):  # it may run elsewhere only since just now
            os.sched_setaffinity(0, everywhere - {processor})
            os.sched_setaffinity(0, everywhere)


_COMPANIONS: dict[int, Companion] = {}
"""By the number of the process: a copy of it has none of its threads."""

_MAKING = threading.Lock()
