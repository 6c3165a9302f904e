"""Three-point resection: the poses that see three known points in three given directions, up to four.

With unit directions A, B, C in the camera frame to ground points a, b, c, the points on the rays are A,
(1 + beta) B, (1 + gamma) C up to one scale. Their distances are in the ratios of those on the ground:

    |AB + beta B|^2            = r1 |AC + gamma C|^2      r1 = |ab|^2 / |ac|^2
    |BC + gamma C - beta B|^2  = r2 |AC + gamma C|^2      r2 = |bc|^2 / |ac|^2

The first gives beta = -s +- sqrt(Q(gamma)) with s = AB . B; put in the second, R^2 = 4 L^2 Q, of degree 4 in
gamma (MMVII's arrangement of Grunert's equations).
"""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.geometry import RigidMotion

RATIO_TOLERANCE = 1e-3
"""Share by which a ratio of squared distances may be missed: a double root is only good to sqrt(eps)."""


def poses_of_triplets(directions: FloatArray, ground: FloatArray) -> tuple[RigidMotion, IntArray]:
    """All the poses of triplets.

    Args:
        directions: (n, 3, 3) unit vectors in the camera frame: triplet, point, coordinate.
        ground: (n, 3, 3) points in the world.

    Returns:
        The poses found, in a batch of k; (k,) the triplet of each.
    """
    scales, owner = _points_on_rays(directions, ground)
    local = scales[:, :, None] * directions[owner]
    return _motions(local, ground[owner]), owner


def _points_on_rays(directions: FloatArray, ground: FloatArray) -> tuple[FloatArray, IntArray]:
    """(k, 3) distances of the points from the camera, in the unit of the ground, and (k,) their triplets."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        gamma, owner = _roots(_quartic(directions, ground))
        a, b, c = directions[owner].transpose(1, 0, 2)
        r1, r2 = (ratio[owner] for ratio in _ratios(ground))
        s = _dot(b - a, b)
        span = _square(c - a + gamma[:, None] * c)
        q = np.maximum(s**2 - _square(b - a) + r1 * span, 0.0)
        beta = -s + np.sqrt(q) * np.array([[1.0], [-1.0]])
        wide = np.broadcast_to(gamma, beta.shape)
        gap = _square(c - b + wide[..., None] * c - beta[..., None] * b)
        near = np.abs(gap - r2 * span) <= RATIO_TOLERANCE * r2 * span
        near &= np.abs(_square(b - a + beta[..., None] * b) - r1 * span) <= RATIO_TOLERANCE * r1 * span
        sign, row = np.nonzero(near & (beta > -1.0) & (wide > -1.0))
    units = np.column_stack([np.ones(len(row)), 1.0 + beta[sign, row], 1.0 + gamma[row]])
    local = units[:, :, None] * directions[owner[row]]
    scale = np.sqrt(_perimeter(ground[owner[row]]) / _perimeter(local))
    return scale[:, None] * units, owner[row]


def _quartic(directions: FloatArray, ground: FloatArray) -> FloatArray:
    """(n, 5) coefficients of R^2 - 4 L^2 Q in gamma, the constant first."""
    a, b, c = directions.transpose(1, 0, 2)
    r1, r2 = _ratios(ground)
    ab, ac, bc = b - a, c - a, c - b
    s = _dot(ab, b)
    span = np.stack([_square(ac), 2.0 * _dot(ac, c), _square(c)], axis=1)
    q = r1[:, None] * span
    q[:, 0] += s**2 - _square(ab)
    v = bc + s[:, None] * b
    r = r2[:, None] * span - q - np.stack([_square(v), 2.0 * _dot(v, c), _square(c)], axis=1)
    linear = np.stack([_dot(v, b), _dot(c, b)], axis=1)
    return _product(r, r) - 4.0 * _product(_product(linear, linear), q)


def _roots(coefficients: FloatArray) -> tuple[FloatArray, IntArray]:
    """Real roots (k,) of polynomials (n, 5), the constant first, and (k,) their polynomials."""
    sound = np.flatnonzero(np.isfinite(coefficients).all(axis=1) & (coefficients[:, 4] != 0.0))
    monic = coefficients[sound] / coefficients[sound, 4:]
    fit = np.isfinite(monic).all(axis=1)
    sound, monic = sound[fit], monic[fit]
    companion = np.zeros((len(sound), 4, 4))
    companion[:, 1:, :3] = np.eye(3)
    companion[:, :, 3] = -monic[:, :4]
    roots = np.linalg.eigvals(companion)
    row, column = np.nonzero(np.abs(roots.imag) <= 1e-3 * (1.0 + np.abs(roots.real)))
    return np.asarray(roots.real[row, column], dtype=np.float64), np.asarray(sound[row], dtype=np.int64)


def _product(p: FloatArray, q: FloatArray) -> FloatArray:
    """Products of polynomials in rows, (n, i) and (n, j)."""
    result = np.zeros((len(p), p.shape[1] + q.shape[1] - 1))
    for power in range(p.shape[1]):
        result[:, power : power + q.shape[1]] += p[:, power : power + 1] * q
    return result


def _ratios(ground: FloatArray) -> tuple[FloatArray, FloatArray]:
    a, b, c = ground.transpose(1, 0, 2)
    longest = _square(c - a)
    return _square(b - a) / longest, _square(c - b) / longest


def _perimeter(triangles: FloatArray) -> FloatArray:
    """(k,) sums of squared sides of triangles (k, 3, 3)."""
    return np.asarray(_square(triangles - np.roll(triangles, 1, axis=1)).sum(axis=1))


def _motions(local: FloatArray, ground: FloatArray) -> RigidMotion:
    """The rigid motions that carry triangles (k, 3, 3) to triangles: first vertex, first side, plane."""
    rotations = _frames(ground) @ np.swapaxes(_frames(local), 1, 2)
    centres = ground[:, 0] - (rotations @ local[:, 0, :, None])[:, :, 0]
    return RigidMotion(centres, rotations)


def _frames(triangles: FloatArray) -> FloatArray:
    """(k, 3, 3) columns: along the first side, in the plane, normal."""
    first, second, third = triangles.transpose(1, 0, 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        x = (second - first) / np.linalg.norm(second - first, axis=1)[:, None]
        normal = np.cross(x, third - second)
        z = normal / np.linalg.norm(normal, axis=1)[:, None]
    return np.stack([x, np.cross(z, x), z], axis=2)


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.add.reduce(a * b, axis=-1))


def _square(a: FloatArray) -> FloatArray:
    return _dot(a, a)
