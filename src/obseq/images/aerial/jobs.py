"""Whole files at once: image points to the ground, ground points to images, intersections and resections.

Each gives a table; what cannot be computed is left out of it, with the line it stands in and the reason.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from obseq.errors import InputError, ObseqError
from obseq.images.aerial.heights import HeightType, convert_heights
from obseq.images.aerial.intersection import intersect_pairs, intersect_rays, most_distant_pairs
from obseq.images.aerial.rays import judged
from obseq.images.aerial.resection import resect
from obseq.images.aerial.result_columns import LeftOut, Table
from obseq.images.aerial.shots import Shots

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from obseq.arrays import FloatArray, IntArray
    from obseq.images.aerial.files import GroundPoints, ImagePoints
    from obseq.images.aerial.heights import Geoid
    from obseq.images.aerial.mapping import MapSystem
    from obseq.images.aerial.resection import Resection
    from obseq.images.aerial.shots import FrameCamera
    from obseq.images.aerial.surfaces import Surface
    from obseq.images.aerial.worksite import Worksite

PAIRS_AT_ONCE = 1_000_000
"""Points times shots that are projected together."""
ALONE = "measured in one image only"
APART = "its rays are parallel, or meet behind a camera"
OPEN = "its points leave the pose open: they are close together, or with the centre on a danger cylinder"

_Seen: TypeAlias = "tuple[IntArray, IntArray, FloatArray, list[LeftOut]]"
"""Rows of points and of shots, pixels, and what was left out."""


def ground_of_measures(
    site: Worksite, measured: ImagePoints, surface: Surface, height_type: HeightType | None = None
) -> Table:
    """Where the ray of each measure meets the ground."""
    rows, left = _known_shots(site, measured)
    shots = site.rows(measured.shots[row] for row in rows)
    ground = site.image_to_world(shots, measured.pixels[rows], surface, height_type)
    met = np.isfinite(ground).all(axis=1)
    left += _lines(measured, rows[~met], "its ray does not meet the ground: outside the terrain, or a hole")
    kept = rows[met]
    return Table({**_measures(measured, kept), **_place(ground[met])}, tuple(left))


def images_of_ground(
    site: Worksite,
    known: GroundPoints,
    seen: ImagePoints | None = None,
    height_type: HeightType | None = None,
) -> Table:
    """Where ground points are in images: of a list of points and shots, or in every image that has them."""
    kind = height_type or known.height_type
    found = _everywhere(site, known, kind) if seen is None else _where_listed(site, known, seen, kind)
    points, shots, pixels, left = found
    names = [known.names[row] for row in points]
    columns = {"point": names, "shot": [site.shots.names[row] for row in shots]}
    return Table({**columns, **_pixel(pixels)}, tuple(left))


def _everywhere(site: Worksite, known: GroundPoints, kind: HeightType | None) -> _Seen:
    """Points in all images whose border they are within."""
    size = max(PAIRS_AT_ONCE // max(len(site.shots), 1), 1)
    parts = []
    for first in range(0, len(known.names), size):
        rows = np.arange(first, min(first + size, len(known.names)))
        points, shots = np.repeat(rows, len(site.shots)), np.tile(np.arange(len(site.shots)), len(rows))
        pixels = site.world_to_image(shots, known.coordinates[points], kind)
        inside = site.contains(shots, pixels)
        parts.append((points[inside], shots[inside], pixels[inside]))
    points, shots = (np.concatenate([np.zeros(0, np.int64), *(part[k] for part in parts)]) for k in (0, 1))
    pixels = np.concatenate([np.zeros((0, 2)), *(part[2] for part in parts)])
    invisible = np.setdiff1d(np.arange(len(known.names)), points)
    return points, shots, pixels, [LeftOut(known.names[row], "no image sees it") for row in invisible]


def _where_listed(site: Worksite, known: GroundPoints, seen: ImagePoints, kind: HeightType | None) -> _Seen:
    """Points in the images that a file lists for them."""
    rows, left = _known_shots(site, seen)
    by_name = {name: row for row, name in enumerate(known.names)}
    there = np.array([seen.names[row] in by_name for row in rows], dtype=np.bool_)
    left += _lines(seen, rows[~there], "this point is not among the ground points")
    rows = rows[there]
    points = np.array([by_name[seen.names[row]] for row in rows], dtype=np.int64)
    shots = site.rows(seen.shots[row] for row in rows)
    pixels = site.world_to_image(shots, known.coordinates[points], kind)
    ahead = np.isfinite(pixels).all(axis=1)
    left += _lines(seen, rows[~ahead], "the point is behind the camera")
    return points[ahead], shots[ahead], pixels[ahead], left


def intersections(
    site: Worksite,
    measured: ImagePoints,
    height_type: HeightType | None = None,
    *,
    all_rays: bool = False,
    sigma: float = 1.0,
) -> Table:
    """Ground points of measures: by the most distant pair of shots, or by least squares over all rays.

    Args:
        site: shots and map.
        measured: points in images.
        height_type: of the resulting z.
        all_rays: least squares over all rays.
        sigma: of a column or line, pixels; precisions sx, sy, sz follow from it alone, and sigma0 of each
            point says how its residuals compare with it.
    """
    rows, left = _known_shots(site, measured)
    names = list(dict.fromkeys(measured.names[row] for row in rows))
    index = {name: number for number, name in enumerate(names)}
    point = np.array([index[measured.names[row]] for row in rows], dtype=np.int64)
    shots = site.rows(measured.shots[row] for row in rows)
    pixels = measured.pixels[rows]
    solve = _by_all_rays if all_rays else _by_pairs
    places, precisions, extra = solve(site, _Rays(point, shots, pixels, len(names)), height_type, sigma)
    seen = np.bincount(point, minlength=len(names))
    good = np.isfinite(places).all(axis=1)
    for row in np.flatnonzero(~good):
        left.append(LeftOut(names[row], ALONE if seen[row] < 2 else APART))
    columns: dict[str, Sequence[object]] = {"point": [names[row] for row in np.flatnonzero(good)]}
    columns |= _place(places[good]) | _precisions(precisions[good]) | {"rays": seen[good].tolist()}
    squares, redundancy = extra.pop("squares"), np.where(seen > 1, 2 * seen - 3 if all_rays else 1, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        extra["sigma0"] = np.sqrt(squares / redundancy)
    verdict = judged(names, np.where(good, squares, np.nan), redundancy)
    columns |= {key: value[good].tolist() for key, value in extra.items()}
    return Table(columns, tuple(left), verdict)


def resections(
    cameras: Iterable[FrameCamera],
    measured: ImagePoints,
    known: GroundPoints,
    system: MapSystem,
    geoid: Geoid | None = None,
    *,
    position: FloatArray | None = None,
    camera_of: Callable[[str], str] | None = None,
    height_type: HeightType | None = None,
) -> tuple[Shots, Table]:
    """The pose of every image that has enough points, as shots and as a table with precisions.

    Args:
        cameras: all cameras.
        measured: points in images.
        known: the same points on the ground.
        system: the map.
        geoid: needed where z are altitudes.
        position: approximate position (3,) of all shots, ellipsoidal height.
        camera_of: name of the camera of a shot; without it there must be one camera.
        height_type: of the z of the shots; None is that of the points. It never carries the alteration.
    """
    by_name = {camera.name: camera for camera in cameras}
    if camera_of is None and len(by_name) != 1:
        raise InputError(f"resection: say which of the {len(by_name)} cameras took each shot, or give one.")
    ground = _heights_by_name(known, system, geoid)
    rows, left = _rows_on_ground(measured, ground)
    found: list[_Found] = []
    for shot in dict.fromkeys(measured.shots):
        mine = [row for row in rows if measured.shots[row] == shot]
        camera = by_name[camera_of(shot) if camera_of else next(iter(by_name))]
        points = np.array([ground[measured.names[row]] for row in mine]).reshape(-1, 3)
        try:
            pose = resect(system, camera, measured.pixels[mine], points, position=position)
        except ObseqError as error:
            left.append(LeftOut(shot, str(error)))
            continue
        if pose.is_ill_determined:
            left.append(LeftOut(shot, OPEN))
        else:
            found.append(_Found(shot, camera.name, len(mine), pose))
    shots = _as_shots(found, height_type or known.height_type, system, geoid)
    return shots, Table(_pose_columns(found, shots), tuple(left))


class _Found(NamedTuple):
    """A resected shot."""

    shot: str
    camera: str
    n_points: int
    pose: Resection


def _as_shots(
    found: Sequence[_Found], wanted: HeightType | None, system: MapSystem, geoid: Geoid | None
) -> Shots:
    places = np.array([one.pose.position for one in found]).reshape(-1, 3)
    places[:, 2] = convert_heights(places[:, 2], places[:, :2], HeightType.HEIGHT, wanted, system, geoid)
    matrices = np.array([one.pose.matrix for one in found]).reshape(-1, 3, 3)
    names, cameras = tuple(one.shot for one in found), tuple(one.camera for one in found)
    return Shots(names, places, matrices, cameras, wanted)


def _pose_columns(found: Sequence[_Found], shots: Shots) -> dict[str, Sequence[object]]:
    angles = np.rad2deg(shots.angles())
    sigmas = np.array([np.sqrt(np.diag(one.pose.covariance)[:3]) for one in found]).reshape(-1, 3)
    columns: dict[str, Sequence[object]] = {"shot": list(shots.names), **_place(shots.positions)}
    columns |= {key: angles[:, k].tolist() for k, key in enumerate(("omega", "phi", "kappa"))}
    columns |= _precisions(sigmas)
    columns |= {"points": [one.n_points for one in found], "sigma0": [one.pose.sigma0 for one in found]}
    return columns


def _heights_by_name(
    known: GroundPoints, system: MapSystem, geoid: Geoid | None
) -> dict[str, tuple[float, ...]]:
    """Map coordinates with ellipsoidal heights."""
    z, plan = known.coordinates[:, 2], known.coordinates[:, :2]
    heights = convert_heights(z, plan, known.height_type, HeightType.HEIGHT, system, geoid)
    places = np.column_stack([plan, heights]).tolist()
    return {name: tuple(place) for name, place in zip(known.names, places, strict=True)}


class _Rays(NamedTuple):
    """Measures: the numbers of their points and shots (n,), places (n, 2); how many points there are."""

    point: IntArray
    shots: IntArray
    pixels: FloatArray
    n_points: int


def _by_pairs(
    site: Worksite, rays: _Rays, height_type: HeightType | None, sigma: float
) -> tuple[FloatArray, FloatArray, dict[str, FloatArray]]:
    point, shots, pixels, count = rays
    pairs = most_distant_pairs(site, point, shots, count)
    rows = np.flatnonzero(pairs[:, 0] >= 0)
    chosen = pairs[rows]
    found = intersect_pairs(site, shots[chosen], pixels[chosen], height_type, sigma=sigma)
    places, precisions, gaps = (
        np.full((count, 3), np.nan),
        np.full((count, 3), np.nan),
        np.full(count, np.nan),
    )
    places[rows], gaps[rows] = found.points, found.gaps
    squares = np.full(count, np.nan)
    if found.covariances is not None and found.gap_sigmas is not None:
        precisions[rows] = np.sqrt(np.diagonal(found.covariances, axis1=1, axis2=2))
        squares[rows] = np.square(found.gaps / found.gap_sigmas)
    return places, precisions, {"gap": gaps, "squares": squares}


def _by_all_rays(
    site: Worksite, rays: _Rays, height_type: HeightType | None, sigma: float
) -> tuple[FloatArray, FloatArray, dict[str, FloatArray]]:
    point, shots, pixels, count = rays
    found = intersect_rays(site, point, shots, pixels, count, height_type, sigma=sigma)
    squared = np.bincount(point, weights=(found.residuals**2).sum(axis=1), minlength=count)
    rms = np.sqrt(squared / np.maximum(2 * found.n_rays, 1))
    covariances = found.covariances if found.covariances is not None else np.full((count, 3, 3), np.nan)
    extra = {"rms": rms, "squares": squared / sigma**2}
    return found.points, np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)), extra


def _known_shots(site: Worksite, measured: ImagePoints) -> tuple[IntArray, list[LeftOut]]:
    """Rows of measures in shots of the worksite; the others are left out."""
    there = np.array([shot in site.shots for shot in measured.shots], dtype=np.bool_)
    unknown = [int(row) for row in np.flatnonzero(~there)]
    left = [LeftOut(measured.where(row), f"shot {measured.shots[row]} is unknown") for row in unknown]
    return np.flatnonzero(there), measured.left_out() + left


def _rows_on_ground(
    measured: ImagePoints, ground: dict[str, tuple[float, ...]]
) -> tuple[list[int], list[LeftOut]]:
    rows = [row for row, name in enumerate(measured.names) if name in ground]
    unknown = dict.fromkeys(name for name in measured.names if name not in ground)
    return rows, measured.left_out() + [LeftOut(name, "not among the ground points") for name in unknown]


def _lines(measured: ImagePoints, rows: IntArray, reason: str) -> list[LeftOut]:
    return [LeftOut(measured.where(int(row)), reason) for row in rows]


def _measures(measured: ImagePoints, rows: IntArray) -> dict[str, Sequence[object]]:
    names = {"point": [measured.names[row] for row in rows], "shot": [measured.shots[row] for row in rows]}
    return {**names, **_pixel(measured.pixels[rows])}


def _pixel(pixels: FloatArray) -> dict[str, Sequence[object]]:
    return {"column": pixels[:, 0].tolist(), "line": pixels[:, 1].tolist()}


def _place(points: FloatArray) -> dict[str, Sequence[object]]:
    return {axis: points[:, k].tolist() for k, axis in enumerate("xyz")}


def _precisions(sigmas: FloatArray) -> dict[str, Sequence[object]]:
    return {f"s{axis}": sigmas[:, k].tolist() for k, axis in enumerate("xyz")}


class Extreme(NamedTuple):
    """An extreme residual of each coordinate.

    Attributes:
        values: (k,) one per coordinate.
        names: the point that carries each.
    """

    values: FloatArray
    names: tuple[str, ...]


class ResidualStatistics(NamedTuple):
    """Statistics of the coordinates of residuals; variances divide by their number.

    Attributes:
        minimum: smallest of each coordinate.
        maximum: largest of each coordinate.
        median: (k,).
        mean: (k,).
        variance: (k,).
        sigma: (k,) standard deviation.
    """

    minimum: Extreme
    maximum: Extreme
    median: FloatArray
    mean: FloatArray
    variance: FloatArray
    sigma: FloatArray


def residual_statistics(names: Sequence[str], residuals: FloatArray) -> ResidualStatistics:
    """Statistics of residuals (n, k) of named points; give absolute values for absolute statistics."""
    each = np.arange(residuals.shape[1])
    low, high = residuals.argmin(axis=0), residuals.argmax(axis=0)
    return ResidualStatistics(
        Extreme(residuals[low, each], tuple(names[row] for row in low)),
        Extreme(residuals[high, each], tuple(names[row] for row in high)),
        np.median(residuals, axis=0),
        residuals.mean(axis=0),
        residuals.var(axis=0),
        residuals.std(axis=0),
    )
