"""Places and systems of coordinates, in complex arithmetic.

What moves by an imaginary 1e-30 carries its derivative along, exact to rounding. Written from the definitions
(MMVII's and Comp3D's documents, textbooks of geodesy) and PROJ; nothing of what it judges is used.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pyproj

EQUATOR, SQUARED = 6378137.0, 0.0066943799901413165  # WGS 84
ROUNDED = 0.00669438  # e2 in the radius of curvature of MMVII and Comp3D
MEAN_RADIUS = 6371008.8  # where a plane has no place on the Earth
STEP = 10.0  # metres, of differences of what PROJ computes


def atan2(y, x):
    """Of complex numbers with small imaginary parts."""
    y, x = np.broadcast_arrays(np.asarray(y, complex), np.asarray(x, complex))
    square = x.real**2 + y.real**2
    return np.arctan2(y.real, x.real) + 1j * (x.real * y.imag - y.real * x.imag) / square


def norm(v):
    """Length (...) of vectors (..., 3), without conjugation."""
    return np.sqrt((v * v).sum(axis=-1))


def dot(a, b):
    """Scalar products (...) of vectors (..., 3)."""
    return (a * b).sum(axis=-1)


def turned(matrix, v):
    """Vectors (..., 3) turned by matrices (..., 3, 3)."""
    return np.einsum("...ij,...j->...i", matrix, v)


def wrapped(angle):
    """An angle brought to (-pi, pi] by its real part."""
    return angle - 2 * np.pi * np.round(np.real(angle) / (2 * np.pi))


def east_north_up(longitude, latitude):
    """(..., 3, 3) whose rows are east, north and up, along geocentric axes."""
    (sl, cl), (sp, cp) = (np.sin(longitude), np.cos(longitude)), (np.sin(latitude), np.cos(latitude))
    rows = [[-sl, cl, 0 * sl], [-sp * cl, -sp * sl, cp], [cp * cl, cp * sl, sp]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


@dataclass(frozen=True)
class Ground:
    """An ellipsoid in space, shifted by the translation of its datum."""

    a: float = EQUATOR
    e2: float = SQUARED
    shift: tuple = (0.0, 0.0, 0.0)

    def geodetic(self, xyz):
        """Longitude, latitude, height of geocentric (..., 3)."""
        x, y, z = np.moveaxis(xyz - np.array(self.shift), -1, 0)
        p = np.sqrt(x * x + y * y)
        latitude = atan2(z, p * (1 - self.e2))
        for _ in range(7):  # each gains two digits and more
            s = np.sin(latitude)
            latitude = atan2(z + self.e2 * self.a / np.sqrt(1 - self.e2 * s * s) * s, p)
        s, c = np.sin(latitude), np.cos(latitude)
        return atan2(y, x), latitude, p * c + z * s - self.a * np.sqrt(1 - self.e2 * s * s)

    def geocentric(self, longitude, latitude, height):
        """(..., 3) of longitude, latitude (rad) and height."""
        s, c = np.sin(latitude), np.cos(latitude)
        n = self.a / np.sqrt(1 - self.e2 * s * s)
        parts = [(n + height) * c * np.cos(longitude), (n + height) * c * np.sin(longitude)]
        return np.stack([*parts, (n * (1 - self.e2) + height) * s], axis=-1) + np.array(self.shift)

    def radii(self, latitude):
        """Radii of curvature along the parallel and along the meridian."""
        inside = 1 - self.e2 * np.sin(latitude) ** 2
        return self.a / np.sqrt(inside), self.a * (1 - self.e2) / inside**1.5


WGS84 = Ground()


def gauss_radius(latitude):
    """Mean radius of curvature of refraction and of the sphere of height 0."""
    return EQUATOR * np.sqrt(1 - ROUNDED) / (1 - ROUNDED * np.sin(latitude) ** 2)


@dataclass(frozen=True)
class Frame:
    """A Euclidean frame: R and T lead to geocentric axes.

    `kind`: "plane" (all verticals along z), "tangent" (each point has its own), "rigid" (no verticals).
    """

    definition: str
    kind: str
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    T: np.ndarray = field(default_factory=lambda: np.zeros(3))
    ground: Ground = WGS84

    def earth(self, p):
        """Geocentric (..., 3)."""
        return turned(self.R, p) + self.T

    def geodetic(self, p):
        """Longitude, latitude, height on the ground; in a plane the height is z."""
        return (0 * p[..., 0], 0 * p[..., 1], p[..., 2]) if self.kind == "plane" else self._geodetic(p)

    def _geodetic(self, p):
        return self.ground.geodetic(self.earth(p))

    def normals(self, p):
        """(..., 3, 3) rows east, north, up of the ellipsoid, in the frame."""
        longitude, latitude, _ = self._geodetic(p)
        return east_north_up(longitude, latitude) @ self.R

    def verticals(self, p):
        """What plumb instruments stand along, without deflections."""
        return self.normals(p) if self.kind == "tangent" else np.broadcast_to(np.eye(3), (*p.shape, 3))

    @cached_property
    def sphere(self):
        """Centre and radius of the sphere of height 0, below the origin of the frame."""
        if self.kind == "plane":
            return np.array([0.0, 0.0, -MEAN_RADIUS]), MEAN_RADIUS
        latitude, height = np.real(self._geodetic(np.zeros(3)))[1:]
        radius = gauss_radius(latitude)
        return np.real(-(radius + height) * self.normals(np.zeros(3))[2]), radius

    def arc(self, a, b):
        """Horizontal length of a sight over twice the radius of the Earth there: refraction of k = 1."""
        if self.kind == "plane":
            return norm((b - a)[..., :2]) / (2 * MEAN_RADIUS)
        _, latitude, height = WGS84.geodetic(self.earth(a))
        first, sight = self.earth(a), turned(self.R, b - a)
        angle = atan2(norm(np.cross(first, sight)), dot(first, first + sight))
        rho = gauss_radius(latitude)
        return angle * (rho + height) / (2 * rho)


def tangent(longitude, latitude, height, ground=WGS84):
    """Frame along east, north, up at a place (degrees, m) of WGS 84, whose heights are those of a ground."""
    lon, lat = np.radians([longitude, latitude])
    definition = f"RTL*{longitude!r}*{latitude!r}*{height!r}*EPSG:4326"
    return Frame(definition, "tangent", east_north_up(lon, lat).T, WGS84.geocentric(lon, lat, height), ground)


def euler(omega, phi, kappa):
    """Rx(omega) Ry(phi) Rz(kappa)."""
    (so, co), (sp, cp), (sk, ck) = ((np.sin(a), np.cos(a)) for a in (omega, phi, kappa))
    x = np.array([[1, 0, 0], [0, co, -so], [0, so, co]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    return x @ y @ np.array([[ck, -sk, 0], [sk, ck, 0], [0, 0, 1]])


@dataclass(frozen=True)
class System:
    """The system in which points are given.

    `to_earth` is a pipeline of PROJ to geocentric WGS 84; "" for the frame itself, "degrees" for longitude
    and latitude of WGS 84.
    """

    definition: str
    frame: Frame
    to_earth: str = ""

    @cached_property
    def _proj(self):
        return pyproj.Transformer.from_pipeline(f"+proj=pipeline {self.to_earth}")

    def coordinates(self, p):
        """Coordinates (..., 3) in the units of the system, of points (..., 3) of the frame."""
        if not self.to_earth:
            return p
        earth = self.frame.earth(p)
        if self.to_earth == "degrees":
            longitude, latitude, height = WGS84.geodetic(earth)
            return np.stack(
                [
                    np.degrees(longitude.real) + 1j * np.degrees(longitude.imag),
                    np.degrees(latitude.real) + 1j * np.degrees(latitude.imag),
                    height,
                ],
                axis=-1,
            )
        flat = earth.real.reshape(-1, 3)
        steps = STEP * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
        around = self._inverse((flat[:, None] + steps).reshape(-1, 3)).reshape(len(flat), 7, 3)
        slopes = (around[:, 1:4] - around[:, 4:]) / (2 * STEP)
        imaginary = np.einsum("nji,nj->ni", slopes, np.imag(earth).reshape(-1, 3))
        return (around[:, 0] + 1j * imaginary).reshape(earth.shape)

    def _inverse(self, earth):
        return np.column_stack(self._proj.transform(*earth.T, direction="INVERSE"))

    def placed(self, given):
        """Points (n, 3) of the frame, of coordinates in the system."""
        given = np.asarray(given, float)
        if not self.to_earth:
            return given
        if self.to_earth == "degrees":
            earth = WGS84.geocentric(*np.radians(given[:, :2].T), given[:, 2])
        else:
            earth = np.column_stack(self._proj.transform(*given.T))
        return (earth - self.frame.T) @ self.frame.R

    def metres(self, p):
        """(..., 3) metres in one unit of each coordinate: along the parallel and the meridian of degrees."""
        if self.to_earth != "degrees":
            return np.ones(p.shape)
        _, latitude, height = np.real(WGS84.geodetic(self.frame.earth(p)))
        along, meridian = WGS84.radii(latitude)
        degree = np.pi / 180
        parts = [(along + height) * np.cos(latitude) * degree, (meridian + height) * degree, 1 + 0 * height]
        return np.stack(parts, axis=-1)

    def gap(self, p, given):
        """Coordinates of points minus given ones, in their units; across the date line too."""
        found = self.coordinates(p) - given
        if self.to_earth == "degrees":
            found[..., 0] -= 360 * np.round(found[..., 0].real / 360)
        return found
