"""Numbers as a surveyor reads them: residuals and precisions in the small unit beside that of the values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from obseq.dataclass import dataclass
from obseq.records.adjustment import AdjustmentRecord
from obseq.records.shown_units import ANGLES, METRES, ShownUnits

Plain = dict[str, Any]
"""What a page holds as JSON."""
ABSENT = "-"
SMALLEST, LARGEST = -4, 7
"""Powers of ten that are written without an exponent; the script of the page has the same."""
MANY = 300
"""Numbers from which they are written all at once."""
TIE = 1.0 + 1e-14
"""What makes a tie of the last decimal go away from zero, in every writer: more than rounding of products."""


@dataclass(frozen=True)
class Scale:
    """How a quantity is shown.

    Attributes:
        name: Of the unit.
        factor: Of the unit, in one metre or radian.
        decimals: That are shown.
        turn: A full turn, of angles; infinite for lengths.
    """

    name: str
    factor: float
    decimals: int
    turn: float = math.inf

    def number(self, value: float | None) -> str:
        """A value (m or rad), without the unit."""
        return fixed(None if value is None else value * self.factor, self.decimals)

    def numbers(self, values: Sequence[float | None]) -> list[str]:
        """Many values (m or rad), without the unit."""
        if type(self) is not Scale or len(values) < MANY:
            return list(map(self.number, values))
        import numpy as np

        numbers = np.array(values, np.float64) * self.factor * TIE  # None is NaN
        numbers[np.abs(numbers) < 0.5 * 10.0**-self.decimals] = 0.0
        texts = (f"%.{self.decimals}f\n" * len(numbers) % tuple(numbers.tolist())).split("\n")[:-1]
        for k in np.flatnonzero(~np.isfinite(numbers)).tolist():
            texts[k] = ABSENT
        return texts

    def text(self, value: float | None) -> str:
        """A value (m or rad), with the unit."""
        number = self.number(value)
        return number if number == ABSENT else f"{number} {self.name}"

    def turned(self, value: float | None) -> str:
        """An angle (rad) within a turn, without the unit."""
        if value is None:
            return ABSENT
        number = fixed(value * self.factor % self.turn, self.decimals)
        return fixed(0.0, self.decimals) if float(number) == self.turn else number


@dataclass(frozen=True)
class Sexagesimal(Scale):
    """Degrees, minutes and seconds, with hyphens between them as in field books: `45-12-03.40`."""

    def number(self, value: float | None) -> str:
        """An angle (rad)."""
        if value is None or not math.isfinite(value):
            return ABSENT
        hundredths = math.floor(abs(value) * self.factor * 360_000.0 * TIE + 0.5)
        sign = "-" if value < 0.0 and hundredths else ""
        minutes, rest = divmod(hundredths, 6000)
        return f"{sign}{minutes // 60}-{minutes % 60:02d}-{rest / 100:05.2f}"

    def turned(self, value: float | None) -> str:
        """An angle (rad) within a turn."""
        if value is None:
            return ABSENT
        text = self.number(value % math.tau)
        return self.number(0.0) if text.startswith("360-") else text


@dataclass(frozen=True)
class Significant(Scale):
    """Numbers of any size, with so many significant digits."""

    def number(self, value: float | None) -> str:
        """A number."""
        return significant(value, self.decimals)


_GON, _DEGREE = 200.0 / math.pi, 180.0 / math.pi
_METRE = (Scale("m", 1.0, 4), Scale("mm", 1e3, 2))
_LENGTHS = {"m": _METRE} | {
    name: (Scale(name, 1.0 / METRES[name], 4), Scale(name, 1.0 / METRES[name], 5)) for name in ("ft", "us-ft")
}
_SECONDS = Scale("sec", 3600.0 * _DEGREE, 2)
_ANGLES = {
    "gon": (Scale("gon", _GON, 5, 400.0), Scale("mgon", 1e3 * _GON, 3)),
    "degree": (Scale("deg", _DEGREE, 6, 360.0), _SECONDS),
    "dms": (Sexagesimal("dms", _DEGREE, 2, 360.0), _SECONDS),
}


PLAIN = {
    "count": Scale("", 1.0, 0),
    "number": Scale("", 1.0, 2),
    "fine": Scale("", 1.0, 4),
    "small_number": Significant("", 1.0, 4),
    "value": Significant("", 1.0, 10),
    "pixel": Scale("px", 1.0, 3),
    "coarse_pixel": Scale("px", 1.0, 1),
}
"""Quantities that have one unit, or none."""
MIXED = {"observed": ("length", "angle"), "small": ("small_length", "small_angle")}
"""Quantities of columns that hold lengths and angles."""
DECIMALS = {"degree": 9, "grad": 9, "kilometre": 7}
"""Decimals of coordinates, by their unit: a tenth of a millimetre; 4 for what is not listed."""


class Units:
    """The units of a report.

    Attributes:
        length: Of coordinates and distances.
        small_length: Of their residuals and precisions.
        angle: Of angles.
        small_angle: Of their residuals and precisions.
        written: Those of the files, in which values were written.
    """

    def __init__(self, shown: ShownUnits, written: ShownUnits | None = None) -> None:
        self.written = self if written is None else Units(written)
        self.length, self.small_length = _LENGTHS[shown.length]
        self.angle, self.small_angle = _ANGLES[shown.angle]

    def scale(self, quantity: str, *, is_angular: bool = False) -> Scale:
        """How a quantity is shown; one that holds lengths and angles, by what it is in a row."""
        name = MIXED[quantity][is_angular] if quantity in MIXED else quantity
        if name == "bearing":
            return self._rough
        found: Scale | None = PLAIN.get(name) or getattr(self, name)
        assert found is not None
        return found

    @property
    def _rough(self) -> Scale:
        """Of bearings of axes."""
        is_gon = self.angle.turn == 400.0
        return Scale("gon" if is_gon else "deg", _GON if is_gon else _DEGREE, 1, self.angle.turn)

    def observed(self, unit: str, value: float | None) -> str:
        """An observed value (rad or m), with its unit."""
        return (self.angle if unit == "rad" else self.length).text(value)

    def small(self, unit: str, value: float | None) -> str:
        """A residual or a sigma (rad or m), with its unit."""
        return (self.small_angle if unit == "rad" else self.small_length).text(value)

    @property
    def words(self) -> str:
        """The units, for the head of a report."""
        angles = f"{self.angle.name} and {self.small_angle.name}"
        if self.small_length.name == self.length.name:
            return f"{self.length.name}; {angles}"
        return f"{self.length.name} and {self.small_length.name}; {angles}"


METRIC = Units(ShownUnits())
"""Metres and gon."""


def units_of(record: AdjustmentRecord) -> Units:
    """The units that the reports of a record are in."""
    return Units(record.units)


def fixed(value: float | None, decimals: int) -> str:
    """A number with that many decimals; a dash when it is not defined; never a negative zero."""
    if value is None or not math.isfinite(value):
        return ABSENT
    text = f"{value * TIE:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def significant(value: float | None, digits: int = 6) -> str:
    """A number with that many significant digits, for quantities whose size varies (sigma0, steps)."""
    if value is None or not math.isfinite(value):
        return ABSENT
    mantissa, exponent = f"{value * TIE:.{digits - 1}e}".split("e")
    power = int(exponent)
    if not SMALLEST <= power < LARGEST:
        return f"{_shortened(mantissa)}e{power}"
    return _shortened(f"{value * TIE:.{max(0, digits - 1 - power)}f}")


def _shortened(text: str) -> str:
    """Digits without the zeros that end them."""
    return text.rstrip("0").rstrip(".") if "." in text else text


def scales() -> dict[str, dict[str, Plain]]:
    """All scales by kind, unit and quantity, for the script of a page."""
    lengths = {name: Units(ShownUnits(length=name)) for name in METRES}
    angles = {name: Units(ShownUnits(angle=name)) for name in ANGLES}
    return {
        "lengths": {name: _told(of, ("length", "small_length")) for name, of in lengths.items()},
        "angles": {name: _told(of, ("angle", "small_angle", "bearing")) for name, of in angles.items()},
        "plain": {"": {name: _plain(scale) for name, scale in PLAIN.items()}},
    }


def _told(units: Units, names: Sequence[str]) -> Plain:
    return {name: _plain(units.scale(name)) for name in names}


def _plain(scale: Scale) -> Plain:
    kind = {Sexagesimal: "sexagesimal", Significant: "significant"}.get(type(scale), "fixed")
    return {"unit": scale.name, "factor": scale.factor, "decimals": scale.decimals, "kind": kind}
