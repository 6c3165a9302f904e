"""Numbers as a surveyor reads them: metres and gons, residuals and precisions in mm and mgon."""

import math

GON_PER_RADIAN = 200.0 / math.pi
ABSENT = "-"


def observed(unit: str, value: float) -> str:
    """An observed value (rad or m) with the unit of reports: gon or m."""
    return f"{value * GON_PER_RADIAN:.5f} gon" if unit == "rad" else f"{value:.4f} m"


def small(unit: str, value: float | None) -> str:
    """A residual or a sigma (rad or m) with the unit of reports: mgon or mm."""
    if value is None:
        return ABSENT
    return f"{value * GON_PER_RADIAN * 1e3:.3f} mgon" if unit == "rad" else f"{value * 1e3:.2f} mm"


def millimetres(value: float | None) -> str:
    """A precision in mm, without the unit."""
    return fixed(None if value is None else value * 1e3, 2)


def gon(value: float | None) -> str:
    """An angle in gon between 0 and 400, without the unit."""
    if value is None:
        return ABSENT
    text = f"{value * GON_PER_RADIAN % 400.0:.5f}"
    return "0.00000" if text == "400.00000" else text


def metres(value: float | None) -> str:
    """A coordinate to a tenth of a millimetre, without the unit."""
    return fixed(value, 4)


DECIMALS = {"degree": 9, "grad": 9, "kilometre": 7}
"""Decimals of coordinates, by their unit: a tenth of a millimetre; 4 for what is not listed."""


def coordinate(value: float | None, unit: str) -> str:
    """A coordinate to a tenth of a millimetre or better, without its unit."""
    return fixed(value, DECIMALS.get(unit, 4))


def plural(unit: str) -> str:
    """What a title calls a unit."""
    return unit if len(unit) == 1 else unit.replace("foot", "feet") if "foot" in unit else f"{unit}s"


def fixed(value: float | None, decimals: int) -> str:
    """A number with that many decimals; a dash when it is not defined; never a negative zero."""
    if value is None or not math.isfinite(value):
        return ABSENT
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def significant(value: float | None, digits: int = 6) -> str:
    """A number with that many significant digits, for quantities whose size varies (sigma0, steps)."""
    return ABSENT if value is None or not math.isfinite(value) else f"{value:.{digits}g}"
