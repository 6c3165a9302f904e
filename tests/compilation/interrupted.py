"""A process that is interrupted while it compiles its first loops into an empty cache.

    python interrupted.py DELAY COUNT

The first loop is interrupted after a delay, in seconds: while the compiler is imported, or soon after. Then
as many loops are interrupted at random moments. Prints how many calls were.
"""

from __future__ import annotations

import random
import signal
import sys
import time
from typing import TYPE_CHECKING

import numpy as np

from obseq.compilation import cache, compiled

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.arrays import FloatArray

LONGEST = 0.15
"""Seconds in which one of the loops is compiled, about."""


def multiplied_sum(factor: float) -> Callable[[FloatArray, int], float]:
    """A loop that is in no cache, for each factor another."""

    @compiled
    def multiplied(x: FloatArray, times: int) -> float:
        total = 0.0
        for i in range(len(x)):
            total += factor * x[i]
        return total * times

    return multiplied


def check_cache() -> None:
    """All files of the cache are whole, and none is a leftover."""
    for path in cache.folder().iterdir() if cache.folder().is_dir() else ():
        assert path.suffix == ".nbc", path
        assert cache.read(path.stem) is not None, path


def is_interrupted(loop: Callable[[FloatArray, int], float], delay: float, expected: float) -> bool:
    """Calls a loop, interrupts it after a delay, and calls it again."""
    row, said = np.arange(4.0), False
    begin = time.perf_counter()
    try:
        signal.setitimer(signal.ITIMER_REAL, delay)
        loop(row, 2)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        assert time.perf_counter() - begin < delay + 0.01, "an interruption was lost"
    except KeyboardInterrupt:
        said = True
    check_cache()
    assert loop(row, 2) == expected
    check_cache()
    return said


def main(delay: float, count: int) -> None:
    """Prints how many of the calls were interrupted."""
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    chance = random.Random(5)
    delays = [delay, *(max(1e-3, chance.random() * LONGEST) for _ in range(count))]
    trials = (is_interrupted(multiplied_sum(k + 1.0), wait, 12.0 * (k + 1)) for k, wait in enumerate(delays))
    sys.stdout.write(f"{sum(trials)}\n")


if __name__ == "__main__":
    main(float(sys.argv[1]), int(sys.argv[2]))
