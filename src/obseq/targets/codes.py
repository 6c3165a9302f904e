"""Codes of targets: which patterns of bits name a target, and how far apart they are.

Bit i of a code is `(code >> i) & 1`. A target that is turned shows the same bits from another start, so
codes are taken in classes: those that differ by rotations of `bits / frequency` places. The least member of
a class gives it its place in the order of names.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np

from obseq.arrays import BoolArray, IntArray, IntRows
from obseq.errors import InputError

MOST_BITS = 24
"""Classes are listed from tables of all codes: 16 million entries at most."""
FAR = 1000.0
"""Distance of a class while none is chosen, as the original has it."""
RUN_COST = 1e-5
"""What a bit of the longest run costs a class in the present rule, in units of distance."""
MOST_CODES = 1000
"""Codes that the greedy choice takes at most."""


def rotated(code: int, bits: int, places: int) -> int:
    """The code in which bit i stands at i - places."""
    places %= bits
    return ((code >> places) | (code << (bits - places))) & ((1 << bits) - 1)


def members(code: int, bits: int, frequency: int) -> list[int]:
    """The codes of its class, itself first: what a target shows when it is turned."""
    period = bits // frequency
    return [rotated(code, bits, period * k) for k in range(frequency)]


def bits_of(code: int, bits: int) -> str:
    """The bits as text, bit 0 first."""
    return "".join(str(code >> i & 1) for i in range(bits))


def check_bits(bits: int, frequency: int) -> None:
    """Refuses what makes no classes.

    Raises:
        InputError: too few or too many bits, or a frequency that does not divide them.
    """
    if not 2 <= bits <= MOST_BITS:
        raise InputError(f"a code of {bits} bits: 2 to {MOST_BITS} bits are known")
    if frequency < 1 or bits % frequency:
        raise InputError(f"frequency {frequency}: must divide the number of bits, {bits}")


def low_codes(bits: int, frequency: int) -> IntArray:
    """The least member of each class, ascending."""
    check_bits(bits, frequency)
    codes = np.arange(1 << bits, dtype=np.int64)
    period, mask = bits // frequency, (1 << bits) - 1
    is_low = np.ones(len(codes), dtype=bool)
    for k in range(1, frequency):
        places = period * k
        is_low &= ((codes >> places) | (codes << (bits - places))) & mask >= codes
    return codes[is_low]


def longest_runs(code: int, bits: int) -> tuple[int, int]:
    """The longest runs of zeros and of ones around the circle."""
    text = bits_of(code, bits)
    if len(set(text)) == 1:
        return (bits, 0) if text[0] == "0" else (0, bits)
    start = next(i for i in range(bits) if text[i] != text[i - 1])
    turned = text[start:] + text[:start]
    zeros, ones = turned.split("1"), turned.split("0")
    return max(map(len, zeros)), max(map(len, ones))


def counted(codes: IntArray) -> IntArray:
    """The number of ones of each."""
    return np.bitwise_count(codes.astype(np.uint64)).astype(np.int64)


def ring_codes(bits: int) -> list[int]:
    """The codes of ring targets, by the rule of the expired patent DE 197 33 466 A1 (Schneider).

    An even number of ones; at least one pair of opposite ones; the least of its rotations; not all ones.
    """
    if bits % 2:
        raise InputError(f"ring codes of {bits} bits: the number of bits must be even")
    codes = low_codes(bits, bits)
    half = bits // 2
    has_pair = codes & (codes >> half) & ((1 << half) - 1) != 0
    return [int(code) for code in codes[(counted(codes) % 2 == 0) & has_pair & (codes != (1 << bits) - 1)]]


def chosen_codes(
    bits: int,
    frequency: int,
    distance: int,
    runs: tuple[int, int],
    *,
    prefers_short_runs: bool = False,
    most: int = MOST_CODES,
) -> list[int]:
    """A set of classes any two of which differ in `distance` bits at least, chosen one after the other.

    Each time the class farthest from those chosen is taken, the first of equals in ascending order. Until
    2024 the original's preference for short runs had no effect; now it has, and gives smaller sets.

    Args:
        bits: length of the codes.
        frequency: how many turns of a target look alike.
        distance: least number of bits in which two classes differ.
        runs: longest runs of zeros and of ones.
        prefers_short_runs: the present rule of the original; False is that of its files before 2024.
        most: so many codes at most.

    Returns:
        The least member of each class, ascending.
    """
    lows = np.array(
        [low for low in low_codes(bits, frequency).tolist() if _keeps(low, bits, runs)], dtype=np.int64
    )
    away = np.full(len(lows), FAR)
    cost = np.array([max(longest_runs(low, bits)) * RUN_COST for low in lows.tolist()])
    score_of = -cost if prefers_short_runs else np.zeros(len(lows))
    chosen: list[int] = []
    while len(chosen) < min(most, len(lows)):
        k = int(np.argmax(away + score_of))
        if away[k] < distance:
            break
        chosen.append(int(lows[k]))
        away = np.minimum(away, distances(lows, members(chosen[-1], bits, frequency)))
    return sorted(chosen)


def _keeps(code: int, bits: int, runs: tuple[int, int]) -> bool:
    zeros, ones = longest_runs(code, bits)
    return zeros <= runs[0] and ones <= runs[1]


def distances(codes: IntArray, others: Sequence[int]) -> IntArray:
    """(n) least number of bits in which each code differs from one of others."""
    least = np.full(len(codes), MOST_BITS)
    for other in others:
        least = np.minimum(least, counted(codes ^ other))
    return least


def larger_set(
    bits: int, frequency: int, distance: int, runs: tuple[int, int], *, trials: int = 200, seed: int = 0
) -> list[int]:
    """A set like that of `chosen_codes`, as large as a search by restarts finds it.

    Codes that agree with one another are a clique of a graph. Each trial adds classes in a random order,
    those first that leave the most others possible.
    """
    lows = np.array(
        [low for low in low_codes(bits, frequency).tolist() if _keeps(low, bits, runs)], dtype=np.int64
    )
    agree = _agreement(lows, bits, frequency, distance)
    random = np.random.default_rng(seed)
    best = chosen_codes(bits, frequency, distance, runs)
    for _ in range(trials):
        found = [int(lows[k]) for k in _clique(agree, random)]
        best = max(best, found, key=len)
    return sorted(best)


def _agreement(lows: IntArray, bits: int, frequency: int, distance: int) -> BoolArray:
    rows = [distances(lows, members(low, bits, frequency)) >= distance for low in lows.tolist()]
    return np.array(rows).reshape(len(lows), len(lows))


def _clique(agree: BoolArray, random: np.random.Generator) -> list[int]:
    possible = np.ones(len(agree), dtype=bool)
    found: list[int] = []
    while possible.any():
        left = np.flatnonzero(possible)
        degrees = agree[np.ix_(left, left)].sum(axis=1) + random.uniform(0.0, 1.5, len(left))
        found.append(int(left[np.argmax(degrees)]))
        possible &= agree[found[-1]]
    return found


def hamming_codes(bits: int) -> tuple[list[int], int]:
    """The words of the Hamming code of the first even length from `bits` on, ascending, and that length.

    Parity bits stand at places 1, 2, 4, 8 of the word (from 1), data in the others, low data bit first.
    """
    if bits > MOST_BITS:
        raise InputError(f"a Hamming code of {bits} bits: at most {MOST_BITS} are known")
    length = next(n for n in range(max(bits, 4), 2 * MOST_BITS) if n % 2 == 0 and _is_hamming(n))
    data = [place for place in range(1, length + 1) if place & (place - 1)]
    values = np.arange(1 << len(data), dtype=np.int64)
    words = np.zeros(len(values), dtype=np.int64)
    for k, place in enumerate(data):
        bit = values >> k & 1
        words |= bit << (place - 1)
        for parity in (1 << j for j in range(place.bit_length()) if place >> j & 1):
            words ^= bit << (parity - 1)
    return np.sort(words).tolist(), length


def _is_hamming(length: int) -> bool:
    """Whether that many places are those of some data and the parity bits that they need: no parity last."""
    return length >= 3 and (length & (length - 1)) != 0


def digits_of(number: int, base: int = 10) -> str:
    """A number in a base of 2 to 36."""
    if not 2 <= base <= 36:
        raise InputError(f"names in base {base}: bases 2 to 36 are known")
    text = ""
    while number or not text:
        number, digit = divmod(number, base)
        text = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ"[digit] + text
    return text


def least_distance(codes: Iterable[int], bits: int, frequency: int) -> int:
    """Least number of bits in which two classes differ: one less can be seen, half of that corrected."""
    table = _turned(tuple(codes), bits, frequency)
    if len(table) < 2:
        return bits
    lows = table[:, 0]
    least = bits
    for k in range(len(lows) - 1):
        for turned in table[k]:
            least = min(least, int(counted(lows[k + 1 :] ^ turned).min()))
    return least


@cache
def _turned(codes: tuple[int, ...], bits: int, frequency: int) -> IntRows:
    """(n, frequency) the members of each class."""
    return np.array([members(code, bits, frequency) for code in codes], dtype=np.int64)
