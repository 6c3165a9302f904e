"""Survey observations of Comp3D alone: reduced distances, polar sub-frames, equal lengths, axes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from obseq.cached import cached_property
from obseq.formulas.base import Argument, Formula
from obseq.formulas.blocks import Direction, Length, Matrix3, Number, Point2, Point3, norm
from obseq.formulas.functions import Scalar, angle_difference, atan2, let
from obseq.formulas.naming import Registered
from obseq.formulas.topography import (
    From,
    MeasuredAngle,
    MeasuredLength,
    Offset,
    Station,
    Target,
    TopoDH,
    TopoDist,
    TopoDistHz,
    TopoDX,
    TopoDY,
    TopoDZ,
    TopoHz,
    TopoZen,
)

COMP3D = "Comp3D (IGN France)"

Axis = Annotated[Direction, "DuDv", "Axis"]
Origin = Annotated[Point3, "O"]
OnCircle = Annotated[Point3, "P"]
Shift = Annotated[Length, "l"]


class TopoDistHz0(Formula):
    """Horizontal distance between two points, on the sphere that stands for height 0.

    Residual: `R angle - val`, with the angle of the two points at the centre `O` of the sphere. Undefined
    where the two points are on one vertical.
    """

    source = COMP3D
    typical = {
        "origin": (0.0, 1e3),
        "target": (0.0, 1e3),
        "centre": (-6.4e6, 1e3),
        "R": (6.4e6, 1e3),
        "val": (1e3, 10.0),
    }

    def residual(
        self,
        origin: From,
        target: Target,
        *,
        centre: Annotated[Point3, "O"],
        radius: Annotated[Length, "R"],
        distance: MeasuredLength,
    ) -> Scalar:
        """The distance computed, minus the distance observed (m)."""
        start = (origin - centre).with_names("start")
        sight = (target - origin).with_names("sight")
        across = norm(start.cross(sight))
        along = start.dot(start + sight)
        return radius * atan2(across, along) - distance


SIGHT = {"station.centre": (0.0, 10.0), "target": (0.0, 10.0)}
"""Where stations and targets are for random checks."""


class TopoAlpha(Formula):
    """Angle of a target from the x axis of a sub-frame, counter-clockwise.

    Residual: `atan2(y, x) - val` brought to (-pi, pi]. Undefined when the target is on the z axis of
    the frame.
    """

    source = COMP3D
    typical = SIGHT

    def residual(self, station: Station, target: Target, *, alpha: MeasuredAngle) -> Scalar:
        """The angle computed, minus the angle observed (rad)."""
        sight = let("sight", station.inverse() @ target)
        return angle_difference(atan2(sight.y, sight.x), alpha)


class TopoBeta(Formula):
    """Elevation of a target above the plane of the x and y axes of a sub-frame.

    Residual: `atan2(z, sqrt(x^2 + y^2)) - val` brought to (-pi, pi]. Undefined when the target is on the z
    axis of the frame.
    """

    source = COMP3D
    typical = SIGHT

    def residual(self, station: Station, target: Target, *, beta: MeasuredAngle) -> Scalar:
        """The elevation computed, minus the elevation observed (rad)."""
        sight = let("sight", station.inverse() @ target)
        horizontal = let("horizontal", norm(Point2(sight.x, sight.y)))
        return angle_difference(atan2(sight.z, horizontal), beta)


class TopoDHParam(Formula):
    """Difference of ellipsoidal heights between two points, itself an unknown.

    Residual: `h(P_to) - h(P_from) - d` (see `TopoDH`). Undefined on the polar axis.
    """

    source = COMP3D
    typical = {name: scale for name, scale in TopoDH.typical.items() if name != "val"}

    def residual(
        self,
        rise: Annotated[Length, "d"],
        origin: From,
        target: Target,
        *,
        to_geocentric: Annotated[Matrix3, "RTL2Geoc_R"],
        translation: Annotated[Point3, "RTL2Geoc_T"],
        semi_major_axis: Annotated[Length, "a"],
        eccentricity2: Annotated[Number, "e2"],
    ) -> Scalar:
        """The height difference computed, minus the unknown one (m)."""
        return TopoDH().residual(
            origin,
            target,
            to_geocentric=to_geocentric,
            translation=translation,
            semi_major_axis=semi_major_axis,
            eccentricity2=eccentricity2,
            height_difference=rise,
        )


class TopoDHParamOff(Formula):
    """Unknown difference of heights of two points that stand beside or above their marks.

    Residual: as `TopoDHParam` with the target moved by `off`.
    """

    source = "TopoDHParam with a correction along the line"
    typical = TopoDHParam.typical

    def residual(
        self,
        rise: Annotated[Length, "d"],
        origin: From,
        target: Target,
        *,
        offset: Offset,
        to_geocentric: Annotated[Matrix3, "RTL2Geoc_R"],
        translation: Annotated[Point3, "RTL2Geoc_T"],
        semi_major_axis: Annotated[Length, "a"],
        eccentricity2: Annotated[Number, "e2"],
    ) -> Scalar:
        """The height difference computed, minus the unknown one (m)."""
        return TopoDHParam().residual(
            rise,
            origin,
            target + offset,
            to_geocentric=to_geocentric,
            translation=translation,
            semi_major_axis=semi_major_axis,
            eccentricity2=eccentricity2,
        )


class AxisRadius(Formula):
    """Distance of a point of a turning target from the centre of its circle, which is on the axis.

    Residual: `|P - O - l n| - r`. Undefined for a point on the axis.
    """

    source = COMP3D
    typical = {"axis": (0.0, 0.0), "point": (10.0, 5.0), "l": (1.0, 1.0), "r": (10.0, 1.0)}

    def residual(
        self,
        axis: Axis,
        origin: Origin,
        shift: Shift,
        radius: Annotated[Length, "r"],
        point: OnCircle,
    ) -> Scalar:
        """The radius computed, minus the unknown radius (m)."""
        return norm(point - origin - shift * axis) - radius


class AxisPlane(Formula):
    """Distance along the axis of a point of a turning target from the plane of its circle.

    Residual: `n . (O + l n - P)`. Defined everywhere.
    """

    source = COMP3D
    typical = {"axis": (0.0, 0.0), "point": (10.0, 5.0), "l": (1.0, 1.0)}

    def residual(self, axis: Axis, origin: Origin, shift: Shift, point: OnCircle) -> Scalar:
        """How far the plane is beyond the point (m)."""
        return axis.dot(origin + shift * axis - point)


class AxisLink(Formula):
    """The origin of an axis as the foot of a point on it.

    Residual: `n . (P - O) / div`, with `div` the current distance of the two. Defined everywhere.
    """

    source = COMP3D
    typical = {"axis": (0.0, 0.0), "point": (10.0, 5.0), "div": (10.0, 1.0)}

    def residual(
        self, axis: Axis, origin: Origin, point: OnCircle, *, distance: Annotated[Length, "div"]
    ) -> Scalar:
        """The cosine of the angle at the origin."""
        return axis.dot(point - origin) / distance


SIGHTS = (
    TopoHz(),
    TopoZen(),
    TopoDist(),
    TopoDX(),
    TopoDY(),
    TopoDZ(),
    TopoDistHz(),
    TopoAlpha(),
    TopoBeta(),
)
"""The registered equations whose instrument and target have heights."""


@dataclass(frozen=True)
class Beside(Formula):
    """An observation between two points that stand beside or above their marks.

    Residual: that of the observation with the target moved by `off`: the offset of the target (its height
    along its vertical) minus that of the instrument, in the frame of the points. Undefined where that is.

    Attributes:
        observed: The equation of the observation; its second unknown is the target.
    """

    pattern = "{observed}Off"
    observed: Annotated[Formula, Registered(SIGHTS)]

    @cached_property
    def arguments(self) -> tuple[Argument, ...]:
        """Those of the observation, with the offset before what is measured."""
        unknowns = tuple(argument for argument in self.observed.arguments if argument.is_unknown)
        measured = self.observed.arguments[len(unknowns) :]
        return (*unknowns, Argument("offset", False, Point3.declare(["off"], self)), *measured)

    @property
    def source(self) -> str:  # type: ignore[override]  # of each member
        """Where the equation comes from."""
        return f"{self.observed.name} with heights of instrument and target"

    @property
    def typical(self) -> Mapping[str, tuple[float, float]]:  # type: ignore[override]  # of each member
        """Where the equation lives."""
        return self.observed.typical

    def residual(self, origin: Any, target: Point3, *, offset: Point3, **measured: Any) -> Scalar:
        """What the observation gives for the moved target, minus what was observed."""
        found: Scalar = self.observed.residual(origin, target + offset, **measured)
        return found


BESIDE = tuple(map(Beside, SIGHTS))
