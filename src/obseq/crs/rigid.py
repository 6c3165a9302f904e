"""Euclidean systems with a place on the Earth: GeoC, LEuc and RTL."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from typing import Self

import numpy as np
import numpy.typing as npt

from obseq.arrays import FloatArray
from obseq.cached import cached_property
from obseq.crs.ground import WGS84, Ground, ground_at
from obseq.crs.operations import geodetic_from_geocentric
from obseq.crs.point_arrays import as_points, check_finite
from obseq.crs.proj import ProjSystem
from obseq.crs.system import CoordinateSystem, Kind, east_north_up
from obseq.dataclass import dataclass
from obseq.geometry import rotation_x, rotation_y, rotation_z

Coordinates = tuple[float, float, float]


@dataclass(frozen=True)
class RigidSystem(CoordinateSystem):
    """A Euclidean frame: geocentric = rotation x + translation.

    Attributes:
        rotation: (3, 3), from this system to geocentric axes.
        translation: (3,), geocentric coordinates of the origin, metres.
        heights: the system whose heights and verticals it has, and a place in it; those of WGS 84 without.
    """

    rotation: FloatArray = field(compare=False, repr=False)
    translation: FloatArray = field(compare=False, repr=False)
    heights: tuple[ProjSystem, Coordinates] | None = field(
        default=None, compare=False, repr=False, kw_only=True
    )

    def __post_init__(self) -> None:
        self.rotation.setflags(write=False)
        self.translation.setflags(write=False)

    @property
    def kind(self) -> Kind:
        """GeoC or LEuc."""
        return Kind.LOCAL_EUCLIDEAN if self.definition.startswith(Kind.LOCAL_EUCLIDEAN) else Kind.GEOCENTRIC

    def to_geocentric(self, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
        """R x + T."""
        given = as_points(points)
        check_finite(given, given, "has no finite coordinates.", names)
        moved: FloatArray = given @ self.rotation.T + self.translation
        return moved

    def from_geocentric(self, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
        """R^T (X - T)."""
        given = as_points(points)
        check_finite(given, given, "has no finite coordinates.", names)
        moved: FloatArray = (given - self.translation) @ self.rotation
        return moved

    def geocentric_pose(self) -> tuple[FloatArray, FloatArray]:
        """R (3, 3) and T (3,) with geocentric = R x + T."""
        return self.rotation.copy(), self.translation.copy()

    def vertical_rotation(self, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
        """ENU(P)^T R (n, 3, 3): from this system to east, north, up at each point, on its ground."""
        return self.verticals_at(self.ground.geodetic(self.to_geocentric(points, names), names))

    def verticals_at(self, place: FloatArray) -> FloatArray:
        """The same (n, 3, 3) for points (n, 3): longitude, latitude (rad) and height on its ground."""
        axes = east_north_up(place[..., 0], place[..., 1])
        turned: FloatArray = np.swapaxes(axes, -1, -2) @ self.ground_rotation
        return turned

    @cached_property
    def ground(self) -> Ground:
        """The ellipsoid to which heights and verticals refer.

        Raises:
            CrsError: the change of datum of their system is no similarity around here.
        """
        return WGS84 if self.heights is None else ground_at(*self.heights)

    @property
    def ground_rotation(self) -> FloatArray:
        """(3, 3), from this system to the axes of its ground."""
        return self.rotation if self.ground.is_plain else self.ground.rotation @ self.rotation

    def ground_pose(self) -> tuple[FloatArray, FloatArray]:
        """R (3, 3), with the scale of its ground in it, and T (3,): coordinates there are R x + T."""
        if self.ground.is_plain:
            return self.geocentric_pose()
        return self.ground.scale * self.ground_rotation, self.ground.own(self.translation)

    def with_heights_of(self, system: CoordinateSystem, place: FloatArray) -> Self:
        """The same frame, whose heights and verticals are those of a system, around a place (3,) in it."""
        x, y, z = place.tolist()
        return replace(self, heights=(system, (x, y, z)) if isinstance(system, ProjSystem) else None)


@dataclass(frozen=True)
class LocalTangent(RigidSystem):
    """RTL: Euclidean frame tangent to the ellipsoid at its origin, axes east, north and up there.

    Attributes:
        origin: coordinates of the origin in `base`.
        base: the PROJ definition in which the origin is given.
    """

    origin: Coordinates = field(compare=False)
    base: ProjSystem = field(compare=False)

    @property
    def kind(self) -> Kind:
        """RTL."""
        return Kind.LOCAL_TANGENT


def geocentric(definition: str) -> RigidSystem:
    """The geocentric system itself."""
    return RigidSystem(definition, np.eye(3), np.zeros(3))


def local_euclidean(definition: str, translation: FloatArray, angles: FloatArray) -> RigidSystem:
    """LEuc: geocentric = Rx(omega) Ry(phi) Rz(kappa) x + translation.

    Args:
        definition: text of the system.
        translation: (3,), metres.
        angles: omega, phi, kappa, radians; the three rotations are right-handed.
    """
    about_x, about_y, about_z = rotation_x(angles[0]), rotation_y(angles[1]), rotation_z(angles[2])
    return RigidSystem(definition, about_x @ about_y @ about_z, np.array(translation))


def local_tangent(definition: str, origin: Coordinates, base: ProjSystem) -> LocalTangent:
    """RTL at `origin`, given in `base`.

    Raises:
        CrsError: if the origin has no geocentric position.
    """
    names = [f"origin of {definition}"]
    translation = base.to_geocentric(np.array([origin]), names)
    longitude, latitude, _ = geodetic_from_geocentric(translation, names)[0]
    axes = east_north_up(longitude, latitude)
    return LocalTangent(
        definition=definition,
        rotation=axes,
        translation=translation[0],
        origin=origin,
        base=base,
        heights=(base, origin),
    )


def turn_of_vertical(system: RigidSystem, points: FloatArray, axes: FloatArray) -> FloatArray:
    """(n, 3, 3) rotation vectors of east, north, up for movements of their points, in a system.

    East, north and up turn about the east by -1 / (M + h) for each metre to the north, and for each metre to
    the east by 1 / (N + h) about the north and by tan(latitude) / (N + h) upwards, the convergence of the
    meridians. M and N: radii of curvature of meridian and prime vertical.

    Args:
        system: a system whose frame is Euclidean and has a place on the Earth.
        points: (n, 3).
        axes: (n, 3, 3) from the system to east, north, up at the points (`vertical_rotation`).

    Returns:
        For each point what its axes turn by (rad), by columns of the movement (m).
    """
    ground = system.ground
    equatorial, squared = ground.equatorial / ground.scale, ground.squared_eccentricity
    own = ground.own(system.to_geocentric(points)) / ground.scale
    up = axes[:, 2] @ system.ground_rotation.T
    inside = np.sqrt(1.0 - squared * np.square(up[:, 2]))
    height = np.einsum("ni,ni->n", up, own) - equatorial * inside
    prime = equatorial / inside
    meridian = prime * (1.0 - squared) / np.square(inside)
    local = np.zeros((len(points), 3, 3))
    local[:, 0, 1] = -1.0 / (meridian + height)
    local[:, 1, 0] = 1.0 / (prime + height)
    local[:, 2, 0] = up[:, 2] / np.hypot(up[:, 0], up[:, 1]) * local[:, 1, 0]
    return np.asarray(np.swapaxes(axes, 1, 2) @ local @ axes)
