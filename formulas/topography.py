"""Survey observations: directions, zenith angles, local components, distances and height differences.

Instrument frame: origin at the station, z up along the axis of the instrument, y towards the zero of the
horizontal circle, x to the right of y seen from above. A station is the pose of that frame; the target is
seen at `station.inverse() @ target`. Metres and radians.
"""

from typing import Annotated

from obseq.formulas.base import Formula
from obseq.formulas.blocks import Angle, Length, Matrix3, Number, Point2, Point3, Pose, norm
from obseq.formulas.functions import Scalar, angle_difference, atan2, cos, let, sin, sqrt

Station = Annotated[Pose, "Ci", "Wi", "mi"]
Target = Annotated[Point3, "P_to"]
From = Annotated[Point3, "P_from"]
MeasuredAngle = Annotated[Angle, "val"]
MeasuredLength = Annotated[Length, "val"]

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


class TopoDH(Formula):
    """Difference of ellipsoidal heights between two points given in a Euclidean frame.

    The frame is placed in the geocentric one by `X = R P + T`; heights follow Bowring's closed form of 1985.
    Residual: `h(P_to) - h(P_from) - val`. Undefined on the polar axis. The geocentric coordinates cancel to
    about 1e-9 m in double precision.
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
        start = to_geocentric @ origin + translation
        end = to_geocentric @ target + translation
        height_from = let("height_from", ellipsoidal_height(start, semi_major_axis, eccentricity2))
        height_to = let("height_to", ellipsoidal_height(end, semi_major_axis, eccentricity2))
        return height_to - height_from - height_difference


def ellipsoidal_height(point: Point3, a: Scalar, e2: Scalar) -> Scalar:
    """Height of a geocentric point above the ellipsoid (semi-major axis a, squared eccentricity e2)."""
    b_over_a = sqrt(1 - e2)
    p = norm(Point2(point.x, point.y))
    parametric = atan2(point.z * (b_over_a + e2 * a / norm(point)), p)
    latitude = atan2(
        point.z * b_over_a + e2 * a * sin(parametric) ** 3,
        b_over_a * (p - e2 * a * cos(parametric) ** 3),
    )
    sine = sin(latitude)
    return p * cos(latitude) + point.z * sine - a * sqrt(1 - e2 * sine**2)
