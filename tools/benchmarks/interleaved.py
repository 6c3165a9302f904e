"""Timing contenders against each other on a busy machine: interleaved rounds, CPU time, medians.

Work that threads share is measured by the clock instead, which tells something on a quiet machine only.
"""

import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

SHORTEST = 4e-3
"""Seconds of CPU that one measure takes at least."""

Repeat = Callable[[int], None]
"""A contender: does its work the given number of times."""

Clock = Callable[[], float]
"""Seconds: of the processor, or of the clock."""


@dataclass(frozen=True)
class Timing:
    """Seconds of one contender for one repetition, round by round."""

    seconds: list[float]

    @property
    def median(self) -> float:
        """The median of the rounds."""
        return statistics.median(self.seconds)


def repeats_for(work: Repeat) -> int:
    """Repetitions that take about `SHORTEST`; what the contender loads or compiles is done before."""
    work(1)
    count = 1
    while (spent := _spent(work, count, time.process_time)) < SHORTEST / 4:
        count *= 4
    return max(1, round(count * SHORTEST / spent))


def race(
    contenders: Mapping[str, Repeat], rounds: int, clock: Clock = time.process_time
) -> dict[str, Timing]:
    """Times the contenders in turn, `rounds` times."""
    counts = {name: repeats_for(work) for name, work in contenders.items()}
    seconds: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(rounds):
        for name, work in contenders.items():
            seconds[name].append(_spent(work, counts[name], clock) / counts[name])
    return {name: Timing(values) for name, values in seconds.items()}


def ratio(slower: Timing, faster: Timing) -> float:
    """How many times longer one takes than another: the median of the ratios of each round."""
    return statistics.median(a / b for a, b in zip(slower.seconds, faster.seconds, strict=True))


def _spent(work: Repeat, count: int, clock: Clock) -> float:
    start = clock()
    work(count)
    return clock() - start
