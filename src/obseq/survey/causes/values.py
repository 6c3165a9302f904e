"""What one value should have been, and which mistakes make the other out of it.

A mistake explains a misfit when it turns the value that was read into the one that the rest of the network
gives, to the noise. How much that says depends on how likely it is to happen by chance: each mistake is tried
in a number of ways, and each hits with the tolerance over the range of values.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator

from obseq.dataclass import dataclass
from obseq.diagnosis.policy import POLICY
from obseq.report.tables.units import METRIC, Scale, Sexagesimal, Units
from obseq.survey.kinds.kind import ObservationKind, Start

GON = 200.0 / math.pi
FEET = 0.3048
"""Metres in a foot."""
_FEWEST_DECIMALS = 3
"""Decimals that lengths are taken to be written with, where they end in zeros."""
_FEET_TEXT = "feet read as metres"


@dataclass(frozen=True)
class Mistake:
    """A mistake with a value.

    Attributes:
        code: of the slip.
        text: in words.
        right: the value read (m, rad) -> what it should have been.
    """

    code: str
    text: str
    right: Callable[[float], float]


@dataclass(frozen=True)
class Explanation:
    """A mistake that turns the value read into the one expected, and the chance of an accident."""

    code: str
    text: str
    chance: float


_ANGLES = (
    Mistake("W100", "degrees read as gon", lambda v: v * 10.0 / 9.0),
    Mistake("W101", "gon read as degrees", lambda v: v * 0.9),
    Mistake("W125", "radians read as gon", lambda v: v * GON),
    Mistake("W111", "degrees, minutes and seconds (ddd.mmss) read as gon", lambda v: _sexagesimal(v * GON)),
)
_LENGTHS = (
    Mistake("W126", "millimetres read as metres", lambda v: v / 1000.0),
    Mistake("W127", "centimetres read as metres", lambda v: v / 100.0),
    Mistake("W128", "kilometres read as metres", lambda v: v * 1000.0),
    Mistake("W106", _FEET_TEXT, lambda v: v * FEET),
)
_SIGN = Mistake("W105", "the sign, or the order of the two points, is wrong", lambda v: -v)
_SIGN_OF_ONE = Mistake("W105", "its sign is wrong", lambda v: -v)
_OF_ZENITH = (
    Mistake("W103", "an elevation in place of a zenith angle", lambda v: math.pi / 2.0 - v),
    Mistake(
        "W132", "an elevation in degrees in place of a zenith angle", lambda v: math.pi / 2.0 - v * 10.0 / 9.0
    ),
    Mistake("W103", "an elevation below the horizon in place of a zenith angle", lambda v: math.pi / 2.0 + v),
    Mistake("W104", "counted from the nadir", lambda v: math.pi - v),
    Mistake("W102", "read in the other face", lambda v: 2.0 * math.pi - v),
)
_OF_HZ = (
    Mistake("W131", "counted anticlockwise", lambda v: -v),
    Mistake("W102", "read in the other face, or backwards", lambda v: v + math.pi),
)
_OF_ANGLE = (
    Mistake("W131", "counted anticlockwise, or its first and last points exchanged", lambda v: -v),
    _OF_HZ[1],
)


_DIGITS = {
    "one digit is wrong": "W109",
    "two digits are exchanged": "W110",
    "a leading digit is missing": "W130",
    "the decimal point is in the wrong place": "W129",
}
COORDINATE = ObservationKind("coordinate", 0, "coordinate of a point", "")
"""A known coordinate, as something that may be written wrong like an observation."""


def mistakes_of(kind: ObservationKind) -> tuple[Mistake, ...]:
    """The mistakes that are made with values of a kind."""
    if kind.start is Start.ZENITH:
        return _ANGLES + _OF_ZENITH
    if kind.is_angle:
        return _ANGLES + (_OF_ANGLE if kind.start is Start.ANGLE else _OF_HZ)
    if kind is COORDINATE:
        return (*_LENGTHS, _SIGN_OF_ONE)
    return _LENGTHS if kind.start in (Start.DISTANCE, Start.FLAT) else (*_LENGTHS, _SIGN)


def is_possible(slip: str, units: Units) -> bool:
    """Whether a slip can be: in files in feet nothing that is in feet is read as metres."""
    return slip != "W106" or units.written.length.factor == 1.0


def _sexagesimal(value: float) -> float:
    """Radians of ddd.mmss."""
    size = abs(value) + 1e-9
    degrees = math.floor(size)
    minutes = math.floor((size - degrees) * 100.0)
    seconds = ((size - degrees) * 100.0 - minutes) * 100.0
    return math.copysign(math.radians(degrees + minutes / 60.0 + seconds / 3600.0), value)


def explain(
    kind: ObservationKind, value: float, expected: float, tolerance: float, units: Units = METRIC
) -> Explanation | None:
    """The most telling explanation of a value; None when none is likely.

    Args:
        kind: of the observation.
        value: as read (m, rad).
        expected: what the rest of the network gives.
        tolerance: how far a good explanation may be from it.
        units: in which values were written; those of lengths, for a coordinate.
    """
    scale = units.written.angle if kind.is_angle else units.written.length
    span = 2.0 * math.pi if kind.is_angle else 2.0 * max(abs(value), abs(expected))
    by_mistake = _by_mistakes(kind, value, expected, tolerance, span)
    by_digits = _by_digits(kind, value, expected, tolerance, span, scale)
    found = [e for e in by_mistake if e.chance < POLICY.likely]
    found = found or [e for e in by_digits if e.chance < POLICY.chance]
    return min(found, key=lambda e: e.chance, default=None)


def difference(kind: ObservationKind, a: float, b: float) -> float:
    """The difference a - b, of angles in [-pi, pi]."""
    return math.remainder(a - b, 2.0 * math.pi) if kind.is_angle else a - b


def _by_mistakes(
    kind: ObservationKind, value: float, expected: float, tolerance: float, span: float
) -> Iterator[Explanation]:
    mistakes = mistakes_of(kind)
    for mistake in mistakes:
        margin = tolerance + (0.0 if kind.is_angle else _enlarged(mistake, value))
        if abs(difference(kind, mistake.right(value), expected)) <= margin:
            chance = len(mistakes) * 2.0 * margin / span
            yield Explanation(mistake.code, mistake.text, chance)


def _enlarged(mistake: Mistake, value: float) -> float:
    """What a mistake that makes values larger makes of the rounding of a length as it was written."""
    decimals = max(len(repr(value).partition(".")[2]), _FEWEST_DECIMALS)
    half = 0.5 * 10.0**-decimals
    gain = abs(mistake.right(value + half) - mistake.right(value))
    return gain if gain > 2.0 * half else 0.0


def _by_digits(
    kind: ObservationKind, value: float, expected: float, tolerance: float, span: float, scale: Scale
) -> Iterator[Explanation]:
    """One wrong digit, two digits exchanged, or a decimal point in the wrong place, as it was written."""
    unit = scale.factor
    read, margin = value * unit, tolerance * unit
    whole = scale.turn if kind.is_angle and kind.start is not Start.ZENITH else 0.0
    is_dms = isinstance(scale, Sexagesimal)
    tried = list(sexagesimal_variants(read, margin) if is_dms else variants(read, scale.decimals, margin))
    slips = Counter(text for text, _ in tried)
    for text, right in tried:
        gap = right - expected * unit
        if whole:
            gap = (
                math.remainder(gap, whole) if abs(right) <= whole else math.inf
            )  # no reading is beyond a turn
        if abs(gap) <= margin:
            # a slip of which there are few ways to happen is not made likelier to hit by those with many
            ways = min(len(tried), len(slips) * slips[text])
            share = _share_of_slips([other for _, other in tried], read, expected * unit, margin)
            chance = share if kind is COORDINATE else max(share, ways * 2.0 * tolerance / span)
            yield Explanation(_DIGITS[text], text, chance)


def _share_of_slips(tried: list[float], read: float, expected: float, tolerance: float) -> float:
    """Which share of errors about as large as one (half to twice) some slip of the pen would explain."""
    size = abs(expected - read)
    alike = sum(0.5 * size <= abs(right - read) <= 2.0 * size for right in tried)
    return min(1.0, alike * 2.0 * tolerance / (3.0 * size))


def variants(read: float, decimals: int, margin: float) -> Iterator[tuple[str, float]]:
    """The numbers that differ from one by a single slip of the pen, those within the margin left out.

    Args:
        read: the number as it was read.
        decimals: how many of its decimals are looked at.
        margin: changes below twice this are none.
    """
    sign = -1.0 if read < 0.0 else 1.0
    yield from _slips(f"{abs(read):.{decimals}f}", lambda text: sign * float(text), read, margin)
    for power in (-2, -1, 1, 2):
        yield from _kept("the decimal point is in the wrong place", read * 10.0**power, read, margin)


def sexagesimal_variants(read: float, margin: float) -> Iterator[tuple[str, float]]:
    """The angles (degrees) that differ from one by a single slip in its degrees, minutes and seconds."""
    sign = -1.0 if read < 0.0 else 1.0
    hundredths = round(abs(read) * 360_000.0)
    minutes, rest = divmod(hundredths, 6000)
    shown = f"{minutes // 60}-{minutes % 60:02d}-{rest // 100:02d}.{rest % 100:02d}"
    yield from _slips(shown, lambda text: sign * _degrees(text), read, margin)


def _degrees(text: str) -> float:
    """Degrees of `45-12-03.40`; NaN where minutes or seconds are 60 or more."""
    degrees, minutes, seconds = map(float, text.split("-"))
    return degrees + minutes / 60.0 + seconds / 3600.0 if max(minutes, seconds) < 60.0 else math.nan


def _slips(
    shown: str, parsed: Callable[[str], float], read: float, margin: float
) -> Iterator[tuple[str, float]]:
    """Of a number as it is written: wrong digits, exchanged ones, a leading one that is missing."""
    for k, digit in enumerate(shown):
        if not digit.isdigit():
            continue
        for other in "0123456789":
            if other != digit:
                changed = shown[:k] + other + shown[k + 1 :]
                yield from _kept("one digit is wrong", parsed(changed), read, margin)
    padded = f"0{shown}"
    digits = [k for k, digit in enumerate(padded) if digit.isdigit()]
    for a, b in itertools.pairwise(digits):
        if padded[a] != padded[b]:
            text = list(padded)
            text[a], text[b] = text[b], text[a]
            yield from _kept("two digits are exchanged", parsed("".join(text)), read, margin)
    for digit in "123456789":
        yield from _kept("a leading digit is missing", parsed(digit + shown), read, margin)


def _kept(text: str, right: float, read: float, margin: float) -> Iterator[tuple[str, float]]:
    if abs(right - read) > 2.0 * margin:
        yield text, right
