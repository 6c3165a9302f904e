"""Numbers as a surveyor reads them: residuals and precisions in the small unit beside that of the values."""

import math

from obseq.dataclass import dataclass
from obseq.records.adjustment import AdjustmentRecord
from obseq.records.shown_units import METRES, ShownUnits

ABSENT = "-"


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
        hundredths = round(abs(value) * self.factor * 360_000.0)
        sign = "-" if value < 0.0 and hundredths else ""
        minutes, rest = divmod(hundredths, 6000)
        return f"{sign}{minutes // 60}-{minutes % 60:02d}-{rest / 100:05.2f}"

    def turned(self, value: float | None) -> str:
        """An angle (rad) within a turn."""
        if value is None:
            return ABSENT
        text = self.number(value % math.tau)
        return self.number(0.0) if text.startswith("360-") else text


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

    def observed(self, unit: str, value: float | None) -> str:
        """An observed value (rad or m), with its unit."""
        return (self.angle if unit == "rad" else self.length).text(value)

    def small(self, unit: str, value: float | None) -> str:
        """A residual or a sigma (rad or m), with its unit."""
        return (self.small_angle if unit == "rad" else self.small_length).text(value)

    def coordinate(self, value: float | None, unit: str) -> str:
        """A coordinate given in a unit of its system, to a tenth of a millimetre, without its unit."""
        return self.length.number(value) if unit == "m" else fixed(value, DECIMALS.get(unit, 4))

    def coordinate_name(self, unit: str) -> str:
        """The unit that such coordinates are shown in."""
        return self.length.name if unit == "m" else unit

    def bearing(self, value: float | None) -> str:
        """The bearing of an axis (rad), roughly, without the unit."""
        scale = _ANGLES["gon" if self.angle.turn == 400.0 else "degree"][0]
        return fixed(None if value is None else value * scale.factor, 1)

    @property
    def words(self) -> str:
        """The units, for the head of a report."""
        angles = f"{self.angle.name} and {self.small_angle.name}"
        if self.small_length.name == self.length.name:
            return f"{self.length.name}; {angles}"
        return f"{self.length.name} and {self.small_length.name}; {angles}"

    @property
    def bearing_name(self) -> str:
        """The unit of bearings."""
        return "gon" if self.angle.turn == 400.0 else "deg"


METRIC = Units(ShownUnits())
"""Metres and gon."""


def units_of(record: AdjustmentRecord) -> Units:
    """The units that the reports of a record are in."""
    return Units(record.units)


def plural(unit: str) -> str:
    """What a title calls a unit."""
    return (
        unit
        if len(unit) == 1 or unit in METRES
        else unit.replace("foot", "feet")
        if "foot" in unit
        else f"{unit}s"
    )


def fixed(value: float | None, decimals: int) -> str:
    """A number with that many decimals; a dash when it is not defined; never a negative zero."""
    if value is None or not math.isfinite(value):
        return ABSENT
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def significant(value: float | None, digits: int = 6) -> str:
    """A number with that many significant digits, for quantities whose size varies (sigma0, steps)."""
    return ABSENT if value is None or not math.isfinite(value) else f"{value:.{digits}g}"
