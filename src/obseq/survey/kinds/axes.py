"""Axes of rotation: targets fixed on a turning object lie on circles around one axis."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.geometry.circles import axis_of
from obseq.survey.kinds.kind import FirstPlace, ObservationKind, Shared, Site


@dataclass(frozen=True)
class OnCircle(ObservationKind):
    """A point of a turning target, seen from the origin of the axis.

    The axis (`axis`, a direction) is an unknown of the parent group; centre and radius of the circle
    (`shift` along the axis from its origin, `radius`) are unknowns of the target.
    """

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """Axis, origin, shift, the radius when it counts, and the point."""
        origins, points = site.ends(rows)
        parts = {name: site.shared(rows, name) for name in self.parts}
        return {"axis": parts.pop("axis"), "origin": origins, **parts, "point": points}

    @property
    def parts(self) -> tuple[str, ...]:
        """Unknowns of the groups that its equation has."""
        return ("axis", "shift", "radius") if self.formula == "AxisRadius" else ("axis", "shift")

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """Its formula takes no value."""
        return np.zeros((len(rows), 0))

    def shared_unknowns(self, site: Site, rows: IntArray, coordinates: FloatArray) -> dict[str, Shared]:
        """Axis, shift and radius, of the points of one target."""
        origins, points = site.positions(rows, coordinates)
        normal = axis_of(points)
        length = float(np.linalg.norm(normal))
        if length == 0.0:
            return {"shift": Shared(0.0), "radius": Shared(float(np.linalg.norm(points[0] - origins[0])))}
        axis = normal / length
        shift = float((points[0] - origins[0]) @ axis)
        radius = float(np.linalg.norm(points[0] - origins[0] - shift * axis))
        return {"axis": Shared(axis), "shift": Shared(shift), "radius": Shared(radius)}


@dataclass(frozen=True)
class AxisFoot(ObservationKind):
    """The origin of an axis is the foot of a point on it."""

    depends_on_place: bool = True

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """Axis, origin and point."""
        origins, points = site.ends(rows)
        return {"axis": site.shared(rows, "axis"), "origin": origins, "point": points}

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """The distance that makes it an angle, and is held as a sigma is: it is one, of the foot."""
        origins, points = site.positions(rows, coordinates)
        return np.asarray(np.maximum(np.linalg.norm(points - origins, axis=1), 1e-4))


AXIS_RADIUS = OnCircle(
    "AxisRadius", 181, "distance from an axis", "AxisRadius", first_place=FirstPlace.CIRCLE
)
AXIS_PLANE = OnCircle("AxisPlane", 182, "distance from the plane of a circle", "AxisPlane")
AXIS_LINK = AxisFoot("AxisFoot", 184, "foot of a point on an axis", "AxisLink")
