"""Whole numbers sorted by counting, and the distinct ones among pairs of them: what structure is made of.

Who meets whom, and where in the store, follows from pairs of small numbers (blocks, groups, bodies). They
are sorted one number after the other, each in as many steps as there are items.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from obseq.arrays import IndexArray, IntArray
from obseq.compilation import compiled


class Distinct(NamedTuple):
    """The distinct ones of pairs of numbers, ascending by the first, then by the second.

    Attributes:
        first: (n,) their first numbers.
        second: (n,) their second numbers.
        leaders: (n,) the item that each of them was first found in.
        number: (n_items,) which of them each item is; -1 for items that are left out.
        order: (n_kept,) the items, sorted.
        bounds: (n_first + 1,) where in the order those of each first number begin.
    """

    first: IntArray
    second: IntArray
    leaders: IndexArray
    number: IndexArray
    order: IndexArray
    bounds: IntArray

    @property
    def starts(self) -> IntArray:
        """(n_first + 1,) where those of each first number begin among the distinct ones."""
        of_sorted = np.append(self.number[self.order], len(self.first))
        return of_sorted[self.bounds].astype(np.int64)


def as_indices(numbers: IntArray) -> IndexArray:
    """The same in 32 bits, as loops take them here."""
    return numbers.astype(np.int32)


def sorted_by(
    numbers: IndexArray, limit: int, given: IndexArray | None = None
) -> tuple[IndexArray, IntArray]:
    """The order of items by their numbers below a limit, and (limit + 1,) where each number begins in it.

    Items of a negative number are left out. Equal ones stay in their order, or in that which is `given`.
    """
    filled = np.zeros(limit + 2, dtype=np.int64)
    given = np.arange(len(numbers), dtype=np.int32) if given is None else given
    count_numbers(numbers, given, filled)
    filled = filled.cumsum()
    order = np.empty(filled[-1], dtype=np.int32)
    put_in_order(numbers, given, filled, order)
    return order, filled[:-1]


def distinct_pairs(first: IndexArray, second: IndexArray, n_first: int, n_second: int) -> Distinct:
    """The distinct ones of pairs of numbers below their limits; pairs with a negative one are left out."""
    order, bounds = sorted_by(first, n_first, sorted_by(second, n_second)[0])
    number, leaders = np.full(len(first), -1, dtype=np.int32), np.empty(len(order), dtype=np.int32)
    leaders = leaders[: number_pairs(first, second, order, number, leaders)].copy()
    found = first[leaders].astype(np.int64), second[leaders].astype(np.int64)
    return Distinct(*found, leaders, number, order, bounds)


@compiled
def count_numbers(numbers: IndexArray, given: IndexArray, counts: IntArray) -> None:
    """Counts the items of each number that is not negative, two places behind it."""
    for item in given:
        if numbers[item] >= 0:
            counts[numbers[item] + 2] += 1


@compiled
def put_in_order(numbers: IndexArray, given: IndexArray, filled: IntArray, order: IndexArray) -> None:
    """Writes the items of each number from its place in `filled` on, one behind its own; it moves along."""
    for item in given:
        if numbers[item] >= 0:
            order[filled[numbers[item] + 1]] = item
            filled[numbers[item] + 1] += 1


@compiled
def number_pairs(
    first: IndexArray, second: IndexArray, order: IndexArray, number: IndexArray, leaders: IndexArray
) -> int:
    """Writes which of the distinct pairs each item is, and the item that leads each; how many there are."""
    count, a, b = 0, -1, -1
    for item in order:
        if first[item] != a or second[item] != b:
            a, b = first[item], second[item]
            leaders[count] = item
            count += 1
        number[item] = count - 1
    return count
