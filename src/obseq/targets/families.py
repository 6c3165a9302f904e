"""The families of targets that files name, as data, and the sets that are made of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import replace

from obseq.dataclass import dataclass
from obseq.errors import InputError, nearest
from obseq.targets.codes import (
    bits_of,
    chosen_codes,
    digits_of,
    hamming_codes,
    larger_set,
    ring_codes,
)
from obseq.targets.specification import Geometry, Specification

ANY_RUN = (1000, 1000)


@dataclass(frozen=True)
class Family:
    """What a family is when nothing else is asked for.

    Attributes:
        geometry: of its sheets, by the number of bits.
        bits: usual number of bits.
        frequency: how many turns look alike; 0 for all.
        distance: least number of bits in which codes differ.
        runs: longest runs of zeros and of ones.
        parity: 1 odd numbers of ones, 2 even, 3 all.
        first: number of the first code.
    """

    geometry: Callable[[int], Geometry]
    bits: int
    frequency: int
    distance: int
    runs: tuple[int, int]
    parity: int = 3
    first: int = 0


def _indoor(bits: int) -> Geometry:
    return Geometry("IGNIndoor", 0.5, 0.35, 0.04, 0.04)


def _drone(family: str, at_top: bool) -> Callable[[int], Geometry]:
    sheet = Geometry(
        family,
        0.05,
        0.0,
        0.0,
        0.05,
        -math.pi / 4,
        in_rows=True,
        at_top=at_top,
        mark=0.1,
        mark_place=(0.7, 0.0),
    )
    return lambda bits: sheet


def _ring(bits: int) -> Geometry:
    """Ring targets; those of 20 bits have wider rings."""
    width = 1.5 if bits == 20 else 1.0
    return Geometry("CERN", width, width, 0.9, 0.1, is_chequered=False, is_white=False, grows=False)


FAMILIES = {
    "IGNIndoor": Family(_indoor, 12, 2, 3, (2, 3)),
    "IGNDroneSym": Family(_drone("IGNDroneSym", False), 12, 2, 3, (2, 3)),
    "IGNDroneTop": Family(_drone("IGNDroneTop", True), 8, 1, 1, ANY_RUN),
    "CERN": Family(_ring, 14, 0, 1, ANY_RUN, parity=2, first=1),
}
"""By the names that files have. Ring targets of other programs (AICON, PhotoModeler, Metashape) are CERN."""

CHOICES = ("former", "present", "larger")
"""How codes with a distance are chosen: as the original did until 2024, as it does now, by search."""


def family(name: str) -> Family:
    """A family by its name.

    Raises:
        InputError: nobody knows it.
    """
    if name not in FAMILIES:
        raise InputError(f"targets: there is no family {nearest(name, FAMILIES)}")
    return FAMILIES[name]


def made(
    family_name: str,
    bits: int | None = None,
    *,
    choice: str = "former",
    distance: int | None = None,
    runs: tuple[int, int] | None = None,
    frequency: int | None = None,
    parity: int | None = None,
    most: int | None = None,
    base: int = 10,
    digits: int | None = None,
    before: str = "",
    numbers: Collection[int] | None = None,
    without_half_turns: bool = False,
    geometry: Geometry | None = None,
) -> Specification:
    """A set of coded targets.

    Args:
        family_name: one of `FAMILIES`.
        bits: length of the codes; that of a Hamming code is the next possible one.
        choice: one of `CHOICES`, for families whose codes keep a distance.
        distance: least number of bits in which codes differ.
        runs: longest runs of zeros and of ones.
        frequency: how many turns look alike.
        parity: 1 odd numbers of ones, 2 even, 3 all.
        most: so many codes at most.
        base: of the numbers in names, 2 to 36.
        digits: of these numbers; by default those of the greatest.
        before: what names begin with.
        numbers: keep only these numbers.
        without_half_turns: leave out codes that look the same when turned by less than a whole turn.
        geometry: other than the family's.

    Raises:
        InputError: an argument is not possible, or no code is left.
    """
    kind = family(family_name)
    bits = kind.bits if bits is None else bits
    wanted = _Wanted(
        kind.distance if distance is None else distance,
        kind.runs if runs is None else runs,
        kind.parity if parity is None else parity,
        1000 if most is None else most,
    )
    frequency = kind.frequency if frequency is None else frequency
    if family_name == "IGNDroneTop":
        codes, bits = hamming_codes(bits)
    elif family_name == "CERN":
        codes = [code for code in ring_codes(bits) if _has(code, wanted.parity)]
        wanted = replace(wanted, most=len(codes) if most is None else most)
    else:
        codes = [code for code in _distant(bits, frequency, wanted, choice) if _has(code, wanted.parity)]
    frequency = frequency or bits
    if without_half_turns:
        codes = [code for code in codes if not _looks_turned(code, bits, frequency)]
    named = dict(enumerate(codes[: wanted.most], kind.first))
    if numbers is not None:
        named = {number: code for number, code in named.items() if number in numbers}
    if not named:
        raise InputError(f"targets {family_name} of {bits} bits: no code is left")
    width = max(digits or 0, len(digits_of(max(named), base)))
    names = {number: f"{before}{digits_of(number, base).zfill(width)}" for number in named}
    runs_text = "_".join(map(str, wanted.runs))
    return Specification(
        kind.geometry(bits) if geometry is None else geometry,
        bits,
        frequency,
        {names[number]: code for number, code in named.items()},
        {names[number]: number for number in named},
        wanted.distance,
        wanted.runs,
        wanted.parity,
        wanted.most,
        base,
        width,
        before,
        family_name == "IGNDroneTop",
        f"{family_name}_Nbb{bits}_Freq{frequency}_Hamm{wanted.distance}_Run{runs_text}",
    )


@dataclass(frozen=True)
class _Wanted:
    distance: int
    runs: tuple[int, int]
    parity: int
    most: int


def _distant(bits: int, frequency: int, wanted: _Wanted, choice: str) -> list[int]:
    if choice not in CHOICES:
        raise InputError(f"targets: there is no choice {nearest(choice, CHOICES)}")
    if choice == "larger":
        return larger_set(bits, frequency, wanted.distance, wanted.runs)
    is_present = choice == "present"
    return chosen_codes(
        bits, frequency, wanted.distance, wanted.runs, prefers_short_runs=is_present, most=wanted.most
    )


def _has(code: int, parity: int) -> bool:
    return parity == 3 or code.bit_count() % 2 == parity % 2


def _looks_turned(code: int, bits: int, frequency: int) -> bool:
    text, period = bits_of(code, bits), bits // frequency
    return any(text[period * k :] + text[: period * k] == text for k in range(1, frequency))
