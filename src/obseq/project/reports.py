"""Reports on control points as CSV files (MMVII's `ReportGCP`), and points in another coordinate system.

A residual is measured minus projected, pixels, with the coordinates of the given file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from obseq.arrays import FloatArray
from obseq.crs import Transformer, parse
from obseq.errors import InputError
from obseq.images import Camera, ControlPoints, ImagePoints, Poses, intersect
from obseq.images.names import index_of
from obseq.spreadsheets import cell_of

PERCENTILES = (50, 75)
HEADER = "NbMes,Avg,UbStdDev,Avg2,Min,Max," + ",".join(f"P{share}" for share in PERCENTILES)


def gcp_reports(
    measures: ImagePoints, control: ControlPoints, poses: Poses, cameras: Mapping[str, Camera]
) -> dict[str, str]:
    """The texts of the reports by name of their file.

    Args:
        measures: points in images; those that are no control points are left aside.
        control: known points.
        poses: of the images.
        cameras: of the poses, by name.

    Raises:
        InputError: no control point is measured, or a pose has no calibration.
    """
    known = measures.of_points(control.names)
    if not len(known):
        raise InputError("report: none of the measured points is a control point")
    ground = control.coordinates[index_of(control.names, known.point_names, "control point")]
    projected = project(known, ground, poses, cameras)
    off = known.xy - projected
    norms = np.sqrt((off**2).sum(axis=1))
    images = [cell_of(known.image_names[k]) for k in known.image]
    points = [cell_of(known.point_names[k]) for k in known.point]
    rows = zip(images, points, norms, off, strict=True)
    detail = [f"{image},{point},{norm:.6f},{dx:.6f},{dy:.6f}" for image, point, norm, (dx, dy) in rows]
    by_image = [
        f"{line},{off[part, 0].mean():.6f},{off[part, 1].mean():.6f}"
        for line, part in _groups(known.image_names, known.image, norms)
    ]
    by_point = [line for line, _ in _groups(known.point_names, known.point, norms)]
    per_camera = [poses.cameras[row] for row in index_of(poses.images, known.image_names, "poses: image")]
    names = tuple(dict.fromkeys(per_camera))
    owner = np.array([names.index(name) for name in per_camera])[known.image]
    return {
        "ByImage.csv": _text(f"Image,{HEADER},AvgX,AvgY", by_image),
        "Detail.csv": _text("Image,GCP,Err,Dx,Dy", detail),
        "ByGCP.csv": _text(f"GCP,{HEADER}", by_point),
        "ByCam.csv": _text(f"Cam,{HEADER}", [line for line, _ in _groups(names, owner, norms)]),
        "ByGCP_3D.csv": _text("Name,Dx,Dy,Dz", _in_space(known, ground, poses, cameras)),
    }


def project(
    known: ImagePoints, ground: FloatArray, poses: Poses, cameras: Mapping[str, Camera]
) -> FloatArray:
    """Pixels (m, 2) of the points (k, 3) of measures; nan behind a camera."""
    found = np.full_like(known.xy, np.nan)
    for k, image in enumerate(known.image_names):
        rows = np.flatnonzero(known.image == k)
        camera = _camera(poses, cameras, image)
        local = poses[image].to_local(ground[known.point[rows]])
        found[rows] = camera.project(local)
        found[rows[~camera.is_in_front(local)]] = np.nan
    return found


def converted(control: ControlPoints, given: str, wanted: str) -> ControlPoints:
    """Points in another system; their covariances are turned with the axes (the original leaves them).

    Raises:
        CrsError: if one of the systems is unknown, or nothing leads from one to the other.
    """
    transformer = Transformer(parse(given), parse(wanted)).forward
    places = np.asarray(transformer(control.coordinates, control.names))
    step = 1.0
    turned = []
    for axis in np.eye(3):
        ahead = transformer(control.coordinates + step * axis, control.names)
        behind = transformer(control.coordinates - step * axis, control.names)
        turned.append((np.asarray(ahead) - np.asarray(behind)) / (2.0 * step))
    jacobian = np.stack(turned, axis=2)
    finite = np.isfinite(control.covariances).all(axis=(1, 2))
    covariances = control.covariances.copy()
    covariances[finite] = jacobian[finite] @ covariances[finite] @ np.swapaxes(jacobian[finite], 1, 2)
    return ControlPoints(control.names, places, covariances)


def _in_space(
    known: ImagePoints, ground: FloatArray, poses: Poses, cameras: Mapping[str, Camera]
) -> list[str]:
    """Given minus intersected, of points with two images or more."""
    found = intersect(known, poses, [_camera(poses, cameras, image) for image in poses.images])
    lines = []
    for name, given, place, rays in zip(found.names, ground, found.coordinates, found.n_rays, strict=True):
        numbers = ",".join(f"{value:.6f}" for value in given - place) if rays >= 2 else "xxx,yyy,zzz"
        lines.append(f"{cell_of(name)},{numbers}")
    return lines


def _camera(poses: Poses, cameras: Mapping[str, Camera], image: str) -> Camera:
    name = poses.cameras[poses.images.index(image)]
    if name not in cameras:
        raise InputError(f"image {image}: its pose names no calibration that is there ({name or 'none'})")
    return cameras[name]


def _groups(
    names: Sequence[str], owner: np.ndarray[tuple[int], np.dtype[np.int64]], norms: FloatArray
) -> list[tuple[str, np.ndarray[tuple[int], np.dtype[np.int64]]]]:
    """A line of statistics for each name, and the rows it is of."""
    parts = [np.flatnonzero(owner == k) for k in range(len(names))]
    return [
        (f"{cell_of(name)},{statistics(norms[part])}", part) for name, part in zip(names, parts, strict=True)
    ]


def statistics(norms: FloatArray) -> str:
    """Number, mean, standard deviation (n - 1), quadratic mean, extremes, percentiles (no interpolation)."""
    if not len(norms):
        return "0" + ",XXX" * (5 + len(PERCENTILES))
    ordered = np.sort(norms)
    spread = norms.std(ddof=1) if len(norms) > 1 else 0.0
    values = [norms.mean(), spread, np.sqrt((norms**2).mean()), ordered[0], ordered[-1]]
    values += [ordered[min(len(norms) * share // 100, len(norms) - 1)] for share in PERCENTILES]
    return f"{len(norms)}," + ",".join(f"{value:.6f}" for value in values)


def _text(header: str, lines: Sequence[str]) -> str:
    return "\n".join([header, *lines]) + "\n"
