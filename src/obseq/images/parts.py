"""What a block holds beside cameras and poses; the block checks it when it is added."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING

from obseq.dataclass import dataclass

if TYPE_CHECKING:
    import re

    from obseq.arrays import FloatArray
    from obseq.images.clinometers import Clinometer, Inclinations
    from obseq.images.measures import ImagePoints
    from obseq.images.poses import Poses
    from obseq.images.weighting import Weighting


@dataclass(frozen=True, eq=False)
class MeasureSet:
    """Image points that are weighted alike.

    Attributes:
        measures: the points.
        weighting: robust weights; the sigmas are in the measures.
        name: of the set, for messages and sums of squares.
    """

    measures: ImagePoints
    weighting: Weighting | None
    name: str


@dataclass(frozen=True)
class Lengths:
    """Distances between points, scale bars among them.

    Attributes:
        first: (n,) names of points.
        second: (n,) names of points.
        values: (n,) in the unit of the world.
        sigmas: (n,).
    """

    first: tuple[str, ...] = ()
    second: tuple[str, ...] = ()
    values: tuple[float, ...] = ()
    sigmas: tuple[float, ...] = ()


@dataclass(frozen=True)
class PoseObservations:
    """Poses that are observed: satellite positions, another orientation.

    Attributes:
        poses: observed values.
        centre_sigmas: (n, 3); infinite where nothing is observed.
        rotation_sigma: radians per axis; None when rotations are not observed.
    """

    poses: Poses
    centre_sigmas: FloatArray
    rotation_sigma: float | None


@dataclass(eq=False)
class Instruments:
    """Clinometers and what they read.

    Attributes:
        clinometers: that cameras carry.
        inclinations: their readings.
        right_angles: names of two clinometers whose axes are at right angles, and a sigma (radians).
        vertical: (3,) upwards, in the world.
        vertical_is_free: whether it is an unknown.
    """

    clinometers: list[Clinometer] = field(default_factory=list)
    inclinations: list[Inclinations] = field(default_factory=list)
    right_angles: list[tuple[str, str, float]] = field(default_factory=list)
    vertical: tuple[float, float, float] = (0.0, 0.0, 1.0)
    vertical_is_free: bool = False


@dataclass(frozen=True)
class Rule:
    """What keeps its value, or is freed again, by patterns of names that match as a whole."""

    cameras: re.Pattern[str]
    parameters: re.Pattern[str]
    frozen: bool
