"""The computation frame of a network: where it is on the Earth, and what can be observed in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.model import FieldBook


RTL_HINT = "compute in a local tangent frame (--frame RTL*X0*Y0*Z0*DEFINITION)"

_FARTHEST = 1000.0
"""Distance from the middle of the points, in typical ones, beyond which a point has no part in the origin."""


@dataclass(frozen=True)
class Frame:
    """The coordinate system of the computation.

    The vertical of a station (its local east, north and up) is defined in RTL systems only, as in MMVII;
    elsewhere a `#FIX` station has the axes of the system.

    Attributes:
        system: The coordinate system.
    """

    system: crs.CoordinateSystem

    @property
    def has_vertical(self) -> bool:
        """Whether stations have a vertical."""
        return self.system.kind is crs.Kind.LOCAL_TANGENT

    def vertical(self, points: FloatArray) -> FloatArray:
        """(n, 3, 3) rotations from the frame to east, north, up at points; identity without vertical."""
        if self.has_vertical:
            return self.system.vertical_rotation(points)
        return np.broadcast_to(np.eye(3), (len(points), 3, 3))

    def refraction(self, book: FieldBook, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) refraction corrections (rad) of some zenith angles, at the coordinates (n_points, 3) given."""
        if not rows.size:
            return np.zeros(0)
        observations = book.observations
        try:
            return crs.refraction_correction(
                self.system,
                coordinates[observations.from_points[rows]],
                coordinates[observations.to_points[rows]],
            )
        except crs.CrsError as error:
            raise InputError(
                f"{book.label(rows[0])}: a zenith angle is corrected for refraction, which needs a place on "
                f"the Earth; {RTL_HINT} ({error})"
            ) from error

    def height_context(self, book: FieldBook, rows: IntArray) -> FloatArray:
        """(n, 14) what TopoDH takes before the value: R and T to geocentric coordinates, a, e2."""
        try:
            rotation, translation = self.system.geocentric_pose()
        except crs.CrsError as error:
            raise InputError(
                f"{book.label(rows[0])}: a height difference needs a Euclidean frame with a place on the "
                f"Earth; {RTL_HINT} ({error})"
            ) from error
        constants = [*rotation.ravel(), *translation, crs.EQUATORIAL_RADIUS, crs.SQUARED_ECCENTRICITY]
        return np.tile(constants, (len(rows), 1))


def frame_of(
    definition: str | None, points_crs: str | None, coordinates: FloatArray, names: Sequence[str]
) -> tuple[Frame, crs.CoordinateSystem]:
    """The computation frame and the system of the points, from their definitions.

    Without a frame the computation is in a Local system; without a system of the points they are in the
    frame. A bare `RTL` gets its origin from the mean of the points, those that lie far away left out.

    Args:
        definition: Definition of the frame.
        points_crs: Definition of the system of the points.
        coordinates: (n, 3) in the system of the points; rows that are not finite do not count in the mean.
        names: Names of the points, for messages.
    """
    frame = crs.parse(definition or "Local")
    points = crs.parse(points_crs) if points_crs else frame
    if not frame.is_complete:
        if not points_crs:
            raise InputError(
                "the frame RTL takes its origin from the points: say their system (--points-crs)"
            )
        given = np.isfinite(coordinates).all(axis=1)
        if not given.any():
            raise InputError("the frame RTL takes its origin from the points, and none has coordinates")
        frame = crs.complete_rtl(_together(coordinates[given]), points)
    return Frame(frame), points


def _together(coordinates: FloatArray) -> FloatArray:
    """The points (n, 3) that lie together: an approximation of 0 0 0 does not move the origin of a frame."""
    away = np.linalg.norm(coordinates[:, :2] - np.median(coordinates[:, :2], axis=0), axis=1)
    near = away <= _FARTHEST * max(float(np.median(away)), 1e-3)
    return np.asarray(coordinates[near])
