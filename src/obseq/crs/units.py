"""Units in which coordinates are written."""

from obseq.dataclass import dataclass


@dataclass(frozen=True)
class Unit:
    """A unit of lengths or of angles.

    Attributes:
        name: What to call it: `m`, `degree`, `grad`, `US survey foot`.
        factor: Metres, or radians, in one unit.
        is_angle: Whether it measures angles.
    """

    name: str
    factor: float
    is_angle: bool = False


METRE = Unit("m", 1.0)
