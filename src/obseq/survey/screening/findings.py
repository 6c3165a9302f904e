"""What is found: a gross error, what it is likely to be, and how far off it is."""

from __future__ import annotations

import enum
from dataclasses import replace
from typing import TYPE_CHECKING

from obseq.dataclass import dataclass
from obseq.records.adjustment import GrossErrorRecord
from obseq.report.units import METRIC
from obseq.survey.kinds.kind import Start

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.report.units import Units
    from obseq.survey.adjustment.point_system import PointSystem
    from obseq.survey.kinds.kind import ObservationKind


class Cause(enum.StrEnum):
    """Likely causes of gross errors."""

    UNITS = "units"
    ELEVATION = "elevation for zenith angle"
    SENSE = "sense or sign"
    SWAPPED_COORDINATES = "easting and northing swapped"
    SWAPPED_NAMES = "names swapped"
    WRONG_POINT = "wrong point"
    MISTYPED = "mistyped"
    NEW_SETUP = "new set-up"
    ECCENTRIC = "eccentric set-up"
    DISTANCES = "constant or scale of distances"
    HEIGHT = "height of instrument or target"
    INDEX = "index of zenith angles"
    SIGMAS = "sigmas too small"
    HORIZONTAL = "horizontal for slope distance"
    COORDINATE_SYSTEM = "coordinate system"
    UNKNOWN = "unknown"


_NOT_APART = "; nothing tells these apart"


@dataclass(frozen=True)
class GrossError:
    """One gross error, or one cause of many.

    Attributes:
        what: the observation, the point or the group, with file and line.
        cause: what it is likely to be.
        text: the likely cause in words, and what would fit.
        size: misfit in sigmas, of the worst observation it explains.
        rows: the observations that it explains.
        points: the points that it concerns, by name.
        is_one: whether only one of what is named is wrong.
    """

    what: str
    cause: Cause
    text: str
    size: float
    rows: tuple[int, ...] = ()
    points: tuple[str, ...] = ()
    is_one: bool = False

    @property
    def is_shared(self) -> bool:
        """Whether it is one mistake of several observations, or of points, and not noise."""
        is_known = self.cause not in (Cause.SIGMAS, Cause.UNKNOWN)
        return is_known and not self.is_one and max(len(self.rows), 2 * len(self.points)) > 1

    def record(self) -> GrossErrorRecord:
        """Its entry in the record of the adjustment."""
        return GrossErrorRecord(self.what, self.cause.value, self.text, self.size, self.points)

    def sentence(self) -> str:
        """What is suspected and why."""
        is_one = self.is_one or len(self.points) == 1 or (not self.points and len(self.rows) == 1)
        verb = "contradicts" if is_one else "contradict"
        return f"{self.what} {verb} the other observations ({self.size:.3g} sigmas): {self.text}"


def any_of(errors: list[GrossError]) -> GrossError:
    """One error, or one of several that nothing tells apart."""
    if len(errors) == 1:
        return errors[0]
    first, *others = errors
    told = [first.text, *(f"{one.what}: {one.text}" for one in others)]
    text = "; or ".join(one.removesuffix(_NOT_APART) for one in told)
    rows = tuple(dict.fromkeys(row for one in errors for row in one.rows))
    points = tuple(dict.fromkeys(name for one in errors for name in one.points))
    return replace(first, text=f"{text}{_NOT_APART}", rows=rows, points=points)


def gap_of(units: Units, kind: ObservationKind, expected: float, off: float) -> str:
    """What the other observations give of one (m or rad), and how far it is off, in words."""
    gap, is_of_turn = units.observed(kind.unit, off), kind.start in (Start.HZ, Start.ANGLE, Start.ZENITH)
    given = units.observed(kind.unit, expected)
    if is_of_turn:
        given = f"{units.angle.turned(expected)} {units.angle.name}"
    if expected <= 0.0 and kind.start in (Start.DISTANCE, Start.FLAT):
        return f"no length of it fits the others, which would make it {given}"
    return f"the others give {given}, it is {gap} off"


def units_of_coordinate(units: Units, system: PointSystem, component: int) -> Units:
    """Units in which a coordinate (0 to 2) was written, given in the unit of its system."""
    unit = system.system.height_unit if component == 2 else system.system.plan_unit
    return units if unit.name == "m" else METRIC


def coordinates_told(units: Units, system: PointSystem, component: int, *values: float) -> Iterator[str]:
    """Values of one coordinate (0 to 2), given in the units of its system, as reports show them."""
    unit = system.system.height_unit if component == 2 else system.system.plan_unit
    return (units.coordinate(value, unit.name) for value in values)
