"""Ground points of image measures: two rays, the most distant pair, or all rays by least squares."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq.errors import InputError
from obseq.geometry import sums_by_owner
from obseq.images.aerial.frames import turned
from obseq.images.aerial.rays import PARALLEL, meet, middle_jacobian, solve_by_point
from obseq.images.initial.intersection import closest_to_rays

if TYPE_CHECKING:
    import numpy.typing as npt

    from obseq.arrays import FloatArray, IntArray
    from obseq.images.aerial.heights import HeightType
    from obseq.images.aerial.rays import RayPairs
    from obseq.images.aerial.worksite import Worksite


CHUNK = 16_384
"""Pairs computed together: what one needs stays in the cache of the processor."""
STEPS = 20
"""Gauss-Newton steps at most; the linear start of aerial rays needs three."""
ARRIVED = 1e-6
"""A point has arrived when its last step was shorter (m)."""


class PairPoints(NamedTuple):
    """Ground points of pairs of rays.

    Attributes:
        points: (n, 3) map coordinates and z; nan where rays are parallel or meet behind a camera.
        gaps: (n,) distance between the rays where they are closest, metres.
        reach: (n, 2) how far along the rays, in focal lengths; negative is behind the camera.
        sine: (n,) sine of the angle between the rays.
        covariances: (n, 3, 3) in map axes and metres, or None.
        gap_sigmas: (n,) standard deviation of the gap along itself, metres, or None.
    """

    points: FloatArray
    gaps: FloatArray
    reach: FloatArray
    sine: FloatArray
    covariances: FloatArray | None
    gap_sigmas: FloatArray | None


class RayPoints(NamedTuple):
    """Ground points of all their rays.

    Attributes:
        points: (n, 3) map coordinates and z; nan where the rays do not fix a point, or it is behind a camera.
        residuals: (m, 2) observed minus computed pixels.
        n_rays: (n,) number of rays.
        covariances: (n, 3, 3) in map axes and metres, or None.
    """

    points: FloatArray
    residuals: FloatArray
    n_rays: IntArray
    covariances: FloatArray | None


def intersect_pairs(
    worksite: Worksite,
    shots: IntArray,
    pixels: FloatArray,
    height_type: HeightType | None = None,
    *,
    sigma: float | None = None,
) -> PairPoints:
    """Ground points of pairs of measures, by the middle of the common perpendicular of the two rays.

    This is Borea's ``eucli_intersection_2p``, for any number of pairs.

    Args:
        worksite: shots and map.
        shots: (n, 2) rows of the two shots of each pair.
        pixels: (n, 2, 2) column and line in each.
        height_type: type of the resulting z; None is that of the shots.
        sigma: standard deviation of a column or line, pixels; with it, covariances of the points are given,
            from the measures alone (orientations count as exact).
    """
    if worksite.is_approximate:
        parts = [_approximate(worksite, shots, pixels, height_type, sigma)]
    else:
        centres, matrices = worksite.centres_and_matrices(height_type or worksite.shots.height_type)
        towards = np.ascontiguousarray(np.swapaxes(matrices, -1, -2))
        parts = [
            _geocentric(worksite, centres, towards, shots[first:last], pixels[first:last], sigma)
            for first, last in _chunks(len(shots))
        ]
    joined = [
        np.concatenate(column) if column[0] is not None else None for column in zip(*parts, strict=True)
    ]
    return PairPoints(*joined)  # type: ignore[arg-type]  # the last two alone may be None


def _chunks(count: int) -> list[tuple[int, int]]:
    starts = range(0, max(count, 1), CHUNK)
    return [(first, min(first + CHUNK, count)) for first in starts]


def _geocentric(
    worksite: Worksite,
    centres: FloatArray,
    towards: FloatArray,
    shots: IntArray,
    pixels: FloatArray,
    sigma: float | None,
) -> PairPoints:
    system = worksite.system
    assert system is not None  # centres_and_matrices has refused it
    first, second = shots[:, 0], shots[:, 1]
    one = turned(towards[first], worksite.directions(first, pixels[:, 0]))
    two = turned(towards[second], worksite.directions(second, pixels[:, 1]))
    pairs = meet(centres[first], one, centres[second], two)
    points = system.from_geocentric(pairs.middle)
    if sigma is None:
        return _in_front(points, pairs, None, None)
    covariances, gaps = _precisions(one, two, pairs, towards[first], towards[second], sigma)
    return _in_front(points, pairs, map_covariances(worksite, points, covariances), gaps)


def _approximate(
    worksite: Worksite,
    shots: IntArray,
    pixels: FloatArray,
    height_type: HeightType | None,
    sigma: float | None,
) -> PairPoints:
    """In the approximate frame of each pair, which removes the alteration (as Borea: B5 of its list)."""
    first, second = shots[:, 0], shots[:, 1]
    places = worksite.shots.positions[:, :2]
    frames = worksite.frames(0.5 * (places[first] + places[second]))
    moved = worksite.positions(height_type or worksite.shots.height_type)
    towards = np.swapaxes(worksite.shots.matrices, -1, -2)
    one = turned(towards[first], worksite.directions(first, pixels[:, 0]))
    two = turned(towards[second], worksite.directions(second, pixels[:, 1]))
    pairs = meet(frames.to_euclidean(moved[first]), one, frames.to_euclidean(moved[second]), two)
    points = frames.to_map(pairs.middle)
    if sigma is None:
        return _in_front(points, pairs, None, None)
    return _in_front(points, pairs, *_precisions(one, two, pairs, towards[first], towards[second], sigma))


def _precisions(
    one: FloatArray,
    two: FloatArray,
    pairs: RayPairs,
    turn_one: FloatArray,
    turn_two: FloatArray,
    sigma: float,
) -> tuple[FloatArray, FloatArray]:
    """Covariances (n, 3, 3) of the middles, and standard deviations (n,) of the gaps, of pixels of a sigma.

    A pixel moves its ray, where the gap is, by its reach; along the gap nothing else moves it to first order.
    """
    spread = middle_jacobian(one, two, pairs)
    across = turn_one[:, :, :2], turn_two[:, :, :2]
    rows = np.concatenate([spread[:, :, :3] @ across[0], spread[:, :, 3:] @ across[1]], axis=2)
    normal = np.cross(one, two)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    moved = [pairs.reach[:, k, None] * np.einsum("ni,nij->nj", normal, across[k]) for k in (0, 1)]
    gaps = sigma * np.linalg.norm(np.concatenate(moved, axis=1), axis=1)
    return sigma**2 * rows @ np.swapaxes(rows, 1, 2), gaps


def _in_front(
    points: FloatArray, pairs: RayPairs, covariances: FloatArray | None, gap_sigmas: FloatArray | None
) -> PairPoints:
    behind = ~(pairs.reach > 0.0).all(axis=1)
    points[behind] = np.nan
    gaps = np.sqrt((pairs.gap**2).sum(axis=1))
    return PairPoints(points, gaps, pairs.reach, pairs.sine, covariances, gap_sigmas)


def map_covariances(worksite: Worksite, points: FloatArray, covariances: FloatArray) -> FloatArray:
    """Covariances (n, 3, 3) along the axes of the map, of geocentric ones at map points (n, 3)."""
    system = worksite.system
    assert system is not None
    turn = np.full((len(points), 3, 3), np.nan)
    good = np.isfinite(points).all(axis=1)
    turn[good] = system.axes(points[good, :2])
    turn[good, :2] *= (1.0 + system.alteration(points[good, :2]))[:, None, None]
    return turn @ covariances @ np.swapaxes(turn, 1, 2)


def most_distant_pairs(worksite: Worksite, point: IntArray, shots: IntArray, count: int) -> IntArray:
    """Measures (count, 2) of each point whose shots are farthest apart; -1 where a point has only one shot.

    Args:
        worksite: shots.
        point: (m,) which point each measure is of.
        shots: (m,) row of its shot.
        count: number of points.
    """
    found = np.full((count, 2), -1, dtype=np.int64)
    order = np.argsort(point, kind="stable")
    starts = np.searchsorted(point[order], np.arange(count + 1))
    sizes = np.diff(starts)
    for size in np.unique(sizes[sizes > 1]):
        chosen = np.flatnonzero(sizes == size)
        rows = order[starts[chosen][:, None] + np.arange(size)]
        found[chosen] = _farthest(worksite.shots.positions[shots[rows]], rows)
    return found


def _farthest(places: FloatArray, rows: IntArray) -> IntArray:
    """The pair of rows (n, 2) whose places (n, size, 3) are farthest apart; the first one of equals."""
    first, second = np.triu_indices(places.shape[1], 1)
    squared = ((places[:, first] - places[:, second]) ** 2).sum(axis=2)
    best = squared.argmax(axis=1)
    each = np.arange(len(rows))
    pairs = np.stack([rows[each, first[best]], rows[each, second[best]]], axis=1)
    pairs[squared[each, best] == 0.0] = -1
    return pairs


def intersect_rays(
    worksite: Worksite,
    point: IntArray,
    shots: IntArray,
    pixels: FloatArray,
    count: int,
    height_type: HeightType | None = None,
    *,
    sigma: float | None = None,
) -> RayPoints:
    """Ground points with the least squared residuals in all their images, in one frame.

    Args:
        worksite: shots and map; the exact computation.
        point: (m,) which point each measure is of, from 0 to `count` - 1.
        shots: (m,) row of the shot of each measure.
        pixels: (m, 2) column and line.
        count: number of points.
        height_type: type of the resulting z; None is that of the shots.
        sigma: standard deviation of a column or line, pixels; with it, covariances of the points are given.

    Raises:
        InputError: in the approximate frame.
    """
    system = worksite.system
    if worksite.is_approximate or system is None:
        raise InputError(
            "least squares over all rays is done in the exact frame; give the map, without approximation."
        )
    centres, matrices = worksite.centres_and_matrices(height_type or worksite.shots.height_type)
    eyes, turn = centres[shots], matrices[shots]
    inner = worksite.directions(shots, np.zeros((len(shots), 2)))
    rays = turned(np.swapaxes(turn, -1, -2), worksite.directions(shots, pixels))
    unit = rays / np.sqrt((rays**2).sum(axis=1, keepdims=True))
    found, spread = closest_to_rays(eyes, unit, point, count)
    found[~(spread > PARALLEL)] = np.nan
    normal = np.zeros((count, 3, 3))
    for _ in range(STEPS):
        left, jacobian = _linearised(found[point], eyes, turn, inner, pixels)
        normal = sums_by_owner(np.swapaxes(jacobian, 1, 2) @ jacobian, point, count)
        right = sums_by_owner(np.einsum("nij,ni->nj", jacobian, left), point, count)
        step = solve_by_point(normal, right)
        found = found + step
        if not (np.abs(step) > ARRIVED).any():
            break
    residuals, _ = _linearised(found[point], eyes, turn, inner, pixels)
    points = system.from_geocentric(found)
    lost = np.bincount(point, weights=~np.isfinite(residuals).all(axis=1), minlength=count) > 0
    points[lost] = np.nan
    lost = np.asarray(np.isnan(points).any(axis=1))
    covariances = (
        None if sigma is None else map_covariances(worksite, points, sigma**2 * _inverses(normal, lost))
    )
    return RayPoints(points, residuals, np.bincount(point, minlength=count), covariances)


def _linearised(
    points: FloatArray, eyes: FloatArray, turn: FloatArray, inner: FloatArray, pixels: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Residuals (m, 2), observed minus computed, and derivatives (m, 2, 3) of the pixels by the points."""
    sight = turned(turn, points - eyes)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(sight[:, 2] > 0.0, sight[:, 2], np.nan)
        slope = sight[:, :2] / depth[:, None]
        computed = -inner[:, :2] + inner[:, 2:] * slope
        jacobian = (inner[:, 2] / depth)[:, None, None] * (turn[:, :2] - slope[:, :, None] * turn[:, 2:])
    return pixels - computed, jacobian


def _inverses(matrices: FloatArray, lost: npt.NDArray[np.bool_]) -> FloatArray:
    found = np.full_like(matrices, np.nan)
    found[~lost] = np.linalg.inv(matrices[~lost])
    return found
