"""Angles as instruments and surveyors write them, and feet."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

from obseq.reading.text import parse_number

FOOT, SURVEY_FOOT = 0.3048, 1200.0 / 3937.0
"""International foot, foot of the United States' surveys (m)."""
GON, DEGREE, SECOND = math.pi / 200.0, math.pi / 180.0, math.pi / 648_000.0
"""Radians."""
FULL_TURN, HALF_TURN, RIGHT_ANGLE = 2.0 * math.pi, math.pi, 0.5 * math.pi


def of_sixty(degrees: int, minutes: int, seconds: float) -> float:
    """Radians of degrees, minutes and seconds; 60 seconds are what rounding makes of 59.96, and one angle.

    Raises:
        ValueError: Minutes are not below 60, or seconds are beyond it.
    """
    if minutes >= 60 or seconds > 60.0:
        raise ValueError("minutes are below 60, and seconds at most 60")
    return (degrees * 3600 + minutes * 60 + seconds) * SECOND


DASHED = re.compile(r"([+-]?)(\d{1,3})-(\d{1,2})-(\d{1,2}(?:\.\d*)?)", re.ASCII)


def dashed(text: str) -> float | None:
    """Radians of `ddd-mm-ss.s`; None of a text that is written in another way.

    Raises:
        ValueError: Minutes are not below 60, or seconds are beyond it.
    """
    found = DASHED.fullmatch(text)
    if found is None:
        return None
    sign, degrees, minutes, seconds = found.groups()
    angle = of_sixty(int(degrees), int(minutes), float(seconds))
    return -angle if sign == "-" else angle


def dms(text: str) -> float:
    """Radians of `ddd.mmsss`: degrees, two digits of minutes, then seconds with their decimals.

    Raises:
        ValueError: It is no such number.
    """
    value = parse_number(text)
    whole, _, digits = text.strip().lstrip("+-").partition(".")
    digits = f"{digits:0<4}"
    if not (whole + digits).isdigit():
        raise ValueError(f"{text!r} is not degrees.minutes and seconds")
    angle = of_sixty(int(whole or "0"), int(digits[:2]), float(f"{digits[2:4]}.{digits[4:]}"))
    return math.copysign(angle, value)


def _times(factor: float) -> Callable[[str], float]:
    return lambda text: parse_number(text) * factor


ANGLES: dict[str, Callable[[str], float]] = {
    "dms": dms,
    "gon": _times(GON),
    "deg": _times(DEGREE),
    "mil": _times(math.pi / 3200.0),
}
"""Radians of an angle in a text, by its unit."""
