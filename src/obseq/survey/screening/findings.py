"""What is found: a gross error, what it is likely to be, and how far off it is."""

from __future__ import annotations

import enum

from obseq.dataclass import dataclass
from obseq.record import GrossErrorRecord


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
    DISTANCES = "constant or scale of distances"
    HEIGHT = "height of instrument or target"
    SIGMAS = "sigmas too small"
    HORIZONTAL = "horizontal for slope distance"
    COORDINATE_SYSTEM = "coordinate system"
    UNKNOWN = "unknown"


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

    def record(self) -> GrossErrorRecord:
        """Its entry in the record of the adjustment."""
        return GrossErrorRecord(self.what, self.cause.value, self.text, self.size, self.points)

    def sentence(self) -> str:
        """What is suspected and why."""
        is_one = self.is_one or len(self.points) == 1 or (not self.points and len(self.rows) == 1)
        verb = "contradicts" if is_one else "contradict"
        return f"{self.what} {verb} the other observations ({self.size:.3g} sigmas): {self.text}"
