"""Small loops that the tests call."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from obseq.compilation import compiled

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, FloatRows


class Pair(NamedTuple):
    """Two arrays and a number."""

    row: FloatArray
    rows: FloatRows
    number: int


@compiled
def scaled_sum(x: FloatArray, times: int, scaled: bool, scale: float) -> float:
    """The sum, scaled or not."""
    total = 0.0
    for i in range(len(x)):
        total += x[i]
    return times * scale * total if scaled else total


@compiled
def first_of_pair(pair: Pair) -> float:
    """The first entry of one array, the last of the other, and the number."""
    return pair.row[0] + pair.rows[1, 2] + pair.number


class Doubling(NamedTuple):
    """What is doubled, and where to."""

    x: FloatArray
    doubled: FloatArray


@compiled(at_once=True)
def double_record(record: Doubling) -> int:
    """Writes twice the entries."""
    for i in range(len(record.x)):
        record.doubled[i] = 2.0 * record.x[i]
    return 0


@compiled(at_once=True)
def double_all(x: FloatArray, doubled: FloatArray) -> int:
    """Writes twice the entries; nothing if the lengths differ."""
    if len(x) != len(doubled):
        return 1
    for i in range(len(x)):
        doubled[i] = 2.0 * x[i]
    return 0
