"""Survey observations: directions, zenith angles, local components, distances and height differences.

Instrument frame: origin at the station, z up along the axis of the instrument, y towards the zero of the
horizontal circle, x to the right of y seen from above. A station is the pose of that frame; the target is
seen at `station.inverse() @ target`. Metres and radians.
"""

from typing import Annotated

from obseq.formulas.base import Formula
from obseq.formulas.blocks import (
    WORLD_TO_LOCAL,
    Angle,
    Length,
    Matrix3,
    Number,
    Point2,
    Point3,
    Pose,
    Rotation,
    norm,
)
from obseq.formulas.functions import Scalar, angle_difference, atan2, let, sqrt

Station = Annotated[Pose, "Ci", "Wi", "mi"]
Target = Annotated[Point3, "P_to"]
From = Annotated[Point3, "P_from"]
MeasuredAngle = Annotated[Angle, "val"]
MeasuredLength = Annotated[Length, "val"]
Offset = Annotated[Point3, "off"]

TOPO = "MMVII Formulas_Topo.h"


class TopoHz(Formula):
    """Horizontal direction of a target, clockwise from the y axis of the instrument.

    Residual: `atan2(x, y) - val` brought to (-pi, pi], where MMVII leaves differences above pi as they are.
    Undefined when the target is on the vertical axis of the station.
    """

    source = TOPO
    typical = {"station.centre": (0.0, 10.0), "target": (0.0, 10.0)}

    def residual(self, station: Station, target: Target, *, hz: MeasuredAngle) -> Scalar:
        """The direction computed, minus the direction observed (rad)."""
        sight = let("sight", station.inverse() @ target)
        return angle_difference(atan2(sight.x, sight.y), hz)


class TopoZen(Formula):
    """Zenith angle of a target: 0 at the zenith, a right angle at the horizon of the instrument.

    Residual: `atan2(sqrt(x^2 + y^2), z) - ref_cor - val` brought to (-pi, pi], with `ref_cor` the refraction
    correction at the current positions. Undefined when the target is on the vertical axis of the station.
    """

    source = TOPO
    typical = {
        "station.centre": (0.0, 10.0),
        "target": (0.0, 10.0),
        "val": (1.5, 0.3),
        "ref_cor": (0.0, 1e-3),
    }

    def residual(
        self,
        station: Station,
        target: Target,
        *,
        refraction: Annotated[Angle, "ref_cor"],
        zenith: MeasuredAngle,
    ) -> Scalar:
        """The zenith angle computed, corrected for refraction, minus the angle observed (rad)."""
        sight = let("sight", station.inverse() @ target)
        horizontal = let("horizontal", norm(Point2(sight.x, sight.y)))
        return angle_difference(atan2(horizontal, sight.z) - refraction, zenith)


class TopoDist(Formula):
    """Spatial distance between two points.

    Residual: `|P_to - P_from| - val`. Undefined where the two points coincide.
    """

    source = TOPO
    typical = {"origin": (0.0, 10.0), "target": (0.0, 10.0), "val": (10.0, 5.0)}

    def residual(self, origin: From, target: Target, *, distance: MeasuredLength) -> Scalar:
        """The distance computed, minus the distance observed (m)."""
        return norm(target - origin) - distance


class TopoDX(Formula):
    """First component (to the right) of the aimed vector in the instrument frame.

    Residual: `x - val`. Defined everywhere.
    """

    source = TOPO
    typical = {"station.centre": (0.0, 10.0), "target": (0.0, 10.0), "val": (0.0, 10.0)}

    def residual(self, station: Station, target: Target, *, dx: MeasuredLength) -> Scalar:
        """The component computed, minus the component observed (m)."""
        return (station.inverse() @ target).x - dx


class TopoDY(Formula):
    """Second component (forward) of the aimed vector in the instrument frame.

    Residual: `y - val`. Defined everywhere.
    """

    source = TOPO
    typical = {"station.centre": (0.0, 10.0), "target": (0.0, 10.0), "val": (0.0, 10.0)}

    def residual(self, station: Station, target: Target, *, dy: MeasuredLength) -> Scalar:
        """The component computed, minus the component observed (m)."""
        return (station.inverse() @ target).y - dy


class TopoDZ(Formula):
    """Third component (up) of the aimed vector in the instrument frame.

    Residual: `z - val`. Defined everywhere.
    """

    source = TOPO
    typical = {"station.centre": (0.0, 10.0), "target": (0.0, 10.0), "val": (0.0, 10.0)}

    def residual(self, station: Station, target: Target, *, dz: MeasuredLength) -> Scalar:
        """The component computed, minus the component observed (m)."""
        return (station.inverse() @ target).z - dz


class TopoScaledFrame(Formula):
    """Component of the vector between two points along an axis of a frame whose scale is not quite 1.

    Residual: `a . v - (1 + s) val`, with `v` the aimed vector in the frame, the target moved by `off`.
    Defined everywhere.
    """

    source = "TopoDX, TopoDY, TopoDZ with a scale"
    typical = TopoDX.typical | {"s": (0.0, 0.01)}

    def residual(
        self,
        station: Station,
        target: Target,
        scale: Annotated[Number, "s"],
        *,
        offset: Offset,
        axis: Annotated[Point3, "a"],
        component: MeasuredLength,
    ) -> Scalar:
        """The component computed, minus the component observed and scaled (m)."""
        sight = station.inverse() @ (target + offset)
        return axis.dot(sight) - (1 + scale) * component


class TopoDistHz(Formula):
    """Horizontal distance between two points, in the horizon of the first.

    Residual: `|u x (P_to - P_from)| - val`, with `u` the upward vertical of the first point. Undefined where
    the two points are on one vertical.
    """

    source = "Definition"
    typical = {"origin": (0.0, 10.0), "target": (0.0, 10.0), "up": (0.5, 0.2), "val": (10.0, 5.0)}

    def residual(
        self, origin: From, target: Target, *, up: Annotated[Point3, "u"], distance: MeasuredLength
    ) -> Scalar:
        """The distance computed, minus the distance observed (m)."""
        sight = (target - origin).with_names("sight")
        return norm(up.cross(sight)) - distance


class TopoAngle(Formula):
    """Horizontal angle at a point, clockwise from a backsight to a foresight.

    Residual: `atan2(E_to, N_to) - atan2(E_back, N_back) - val` brought to (-pi, pi], with east and north of
    both in the horizon of the point. Undefined where one of them is on the vertical of the point.
    """

    source = "Definition"
    typical = {"station": (0.0, 10.0), "backsight": (0.0, 10.0), "target": (0.0, 10.0)}

    def residual(
        self,
        station: Annotated[Point3, "P_at"],
        backsight: Annotated[Point3, "P_back"],
        target: Target,
        *,
        vertical: Annotated[Matrix3, "ENU"],
        angle: MeasuredAngle,
    ) -> Scalar:
        """The angle computed, minus the angle observed (rad)."""
        back = let("back", vertical @ (backsight - station))
        ahead = let("ahead", vertical @ (target - station))
        return angle_difference(atan2(ahead.x, ahead.y) - atan2(back.x, back.y), angle)


class TopoDH(Formula):
    """Difference of ellipsoidal heights between two points given in a Euclidean frame.

    The frame is placed in the geocentric one by `X = R P + T`; heights follow Bowring's closed form of 1985.
    Residual: `h(P_to) - h(P_from) - val`. Undefined on the polar axis. The difference is computed from that
    of the points: it carries their rounding, where MMVII's difference of two heights carries 1e-9 m.
    """

    source = "MMVII Formulas_Topo.h; B. R. Bowring, Survey Review 28 (218), 1985"
    typical = {
        "origin": (0.0, 5e4),
        "target": (0.0, 5e4),
        "translation": (4.0e6, 5e5),
        "a": (6378137.0, 0.0),
        "e2": (0.00669438, 0.0),
        "val": (0.0, 100.0),
    }

    def residual(
        self,
        origin: From,
        target: Target,
        *,
        to_geocentric: Annotated[Matrix3, "RTL2Geoc_R"],
        translation: Annotated[Point3, "RTL2Geoc_T"],
        semi_major_axis: Annotated[Length, "a"],
        eccentricity2: Annotated[Number, "e2"],
        height_difference: MeasuredLength,
    ) -> Scalar:
        """The height difference computed, minus the one observed (m)."""
        start = let("start", to_geocentric @ origin + translation)
        shift = let("shift", to_geocentric @ (target - origin))
        return ellipsoidal_rise(start, shift, semi_major_axis, eccentricity2) - height_difference


def ellipsoidal_rise(start: Point3, shift: Point3, a: Scalar, e2: Scalar) -> Scalar:
    """Height of a geocentric point and a shift above the ellipsoid, minus that of the point.

    A height is `p cos phi + Z sin phi - a W`, with `W = sqrt(1 - e2 sin^2 phi)`. In the difference, terms of
    the size of the Earth must not cancel: `p` and `Z` change by small quantities that follow from the shift,
    and the turn of the normal from one end to the other multiplies what is nearly 0 along the way.

    Args:
        start: Geocentric point (m).
        shift: From there to the other point (m).
        a: Semi-major axis (m).
        e2: Squared eccentricity.
    """
    end = let("end", start + shift)
    p_start, p_end = let("p_start", _to_axis(start)), let("p_end", _to_axis(end))
    first = let("from", _normal(start, p_start, a, e2))
    last = let("to", _normal(end, p_end, a, e2))
    both = let("both", first + last)
    half_turn = let("half_turn", (first.x * last.y - first.y * last.x) / (1 + first.dot(last)))
    outwards = ((start.x + end.x) * shift.x + (start.y + end.y) * shift.y) / (p_start + p_end)
    w_both = sqrt(1 - e2 * first.y**2) + sqrt(1 - e2 * last.y**2)
    lever = both.x * (start.z + end.z) - both.y * (p_start + p_end)
    lever = let("lever", lever + 2 * e2 * a * both.x * both.y / w_both)
    return (both.x * outwards + both.y * shift.z + half_turn * lever) / 2


def _to_axis(point: Point3) -> Scalar:
    return norm(Point2(point.x, point.y))


def _normal(point: Point3, p: Scalar, a: Scalar, e2: Scalar) -> Point2:
    """Cosine and sine of the latitude of a point at a distance p from the polar axis."""
    b_over_a = sqrt(1 - e2)
    parametric = _unit(Point2(p, point.z * (b_over_a + e2 * a / norm(point))))
    return _unit(
        Point2(
            b_over_a * (p - e2 * a * parametric.x**3),
            point.z * b_over_a + e2 * a * parametric.y**3,
        )
    )


def _unit(vector: Point2) -> Point2:
    length = norm(vector)
    return Point2(vector.x / length, vector.y / length)


class Dist3D(Formula):
    """Distance between two points.

    Residual: `|p2 - p1| - D`. Undefined where the two points coincide.
    """

    source = "MMVII Formulas_Geom3D.h"
    typical = {"p1": (0.0, 10.0), "p2": (0.0, 10.0), "D": (10.0, 5.0)}

    def residual(self, p1: Point3, p2: Point3, *, distance: Annotated[Length, "D"]) -> Scalar:
        """The distance computed from the points, minus the distance observed (m)."""
        return norm(p2 - p1) - distance


class Dist3DParam(Formula):
    """Distance between two points, itself an unknown.

    Residual: `|p2 - p1| - d`. Undefined where the two points coincide.
    """

    source = "MMVII Formulas_Geom3D.h"
    typical = {"p1": (0.0, 10.0), "p2": (0.0, 10.0), "d": (10.0, 5.0)}

    def residual(self, distance: Annotated[Length, "d"], p1: Point3, p2: Point3) -> Scalar:
        """The distance computed from the points, minus the unknown distance (m)."""
        return norm(p2 - p1) - distance


class TopoSubFrame(Formula):
    """Vector between two points, observed in a sub-frame of unknown orientation.

    Residual: `(I + [r]x) R (p2 - p1) - v`, with `R` the current rotation from the frame to the sub-frame.
    Defined everywhere.
    """

    source = "MMVII Formulas_Geom3D.h"
    typical = {"p1": (0.0, 10.0), "p2": (0.0, 10.0), "vector": (0.0, 10.0)}

    def residual(
        self,
        frame: Annotated[Rotation, "r", "R", WORLD_TO_LOCAL],
        p1: Point3,
        p2: Point3,
        *,
        vector: Annotated[Point3, "v"],
    ) -> Point3:
        """The vector computed in the sub-frame, minus the vector observed there (m)."""
        return frame.inverse() @ (p2 - p1) - vector
