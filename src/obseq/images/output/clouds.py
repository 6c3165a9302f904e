"""A block as a cloud that viewers show (PLY), and its parts as the tables that `obseq bundle` reads."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.output.block_record import BundleRecord
from obseq.reading.tables import table_text

CONTROL, TIE, CAMERA = (255, 60, 40), (230, 230, 230), (60, 120, 255)
"""Colours: red, green, blue."""
CAMERA_COLUMNS = (
    "name", "width", "height", "focal", "ppx", "ppy", "projection", "radial", "decentric", "general",
    "backward",
)  # fmt: skip
"""Of the table of cameras, before its coefficients."""


def ply(solution: BundleSolution) -> str:
    """ASCII PLY: the points (control points in red), and each camera as a pyramid of lines to its corners."""
    corners = _pyramids(solution)
    points = solution.coordinates
    colours = [CONTROL if control else TIE for control in solution.start.is_control]
    vertices = [*zip(points.tolist(), colours, strict=True), *((xyz, CAMERA) for xyz in corners.tolist())]
    edges = [
        (len(points) + 5 * k + a, len(points) + 5 * k + b)
        for k in range(len(solution.poses))
        for a, b in ((0, 1), (0, 2), (0, 3), (0, 4), (1, 2), (2, 3), (3, 4), (4, 1))
    ]
    header = [
        "ply",
        "format ascii 1.0",
        f"element vertex {len(vertices)}",
        *(f"property double {axis}" for axis in "xyz"),
        *(f"property uchar {colour}" for colour in ("red", "green", "blue")),
        f"element edge {len(edges)}",
        "property int vertex1",
        "property int vertex2",
        "end_header",
    ]
    rows = [f"{x:.17g} {y:.17g} {z:.17g} {red} {green} {blue}" for (x, y, z), (red, green, blue) in vertices]
    return "\n".join([*header, *rows, *(f"{a} {b}" for a, b in edges)]) + "\n"


def _pyramids(solution: BundleSolution) -> FloatArray:
    """(5 n, 3) centre and corners of each camera, a twentieth of its distance to the points away."""
    poses = solution.poses
    middle = np.median(solution.coordinates, axis=0)
    depth = 0.05 * np.linalg.norm(poses.centres - middle, axis=1)
    found = []
    for k, camera in enumerate(solution.start.cameras):
        w, h = camera.width or 2.0 * camera.focal, camera.height or 2.0 * camera.focal
        x, y = (np.array([w, h]) / 2.0 / camera.focal).tolist()
        local = depth[k] * np.array([[0, 0, 0], [-x, -y, 1], [x, -y, 1], [x, y, 1], [-x, y, 1.0]])
        found.append(local @ poses.rotations[k].T + poses.centres[k])
    return np.concatenate(found)


def pose_table(solution: BundleSolution) -> str:
    """Poses as the table of images that `obseq bundle` reads: centres, and omega, phi, kappa in degrees."""
    poses = solution.poses
    values = np.hstack([poses.centres, np.degrees(poses.attitudes("opk"))]).tolist()
    rows = [
        (image, camera, *row) for image, camera, row in zip(poses.images, poses.cameras, values, strict=True)
    ]
    return table_text(("image", "camera", "x", "y", "z", "omega", "phi", "kappa"), rows)


def camera_table(solution: BundleSolution) -> str:
    """Cameras as the table that `obseq bundle` reads; a coefficient that a model has not is zero."""
    cameras = list(solution.cameras.values())
    names = list(dict.fromkeys(name for camera in cameras for name in camera.coefficient_names))
    rows = []
    for camera in cameras:
        given = dict(zip(camera.coefficient_names, camera.coefficients.tolist(), strict=True))
        interior = (
            camera.focal,
            *camera.principal_point.tolist(),
            camera.projection,
            *camera.degree,
            int(camera.backward),
        )
        coefficients = (given.get(name, 0.0) for name in names)
        rows.append((camera.name, camera.width, camera.height, *interior, *coefficients))
    return table_text((*CAMERA_COLUMNS, *names), rows)


def point_table(solution: BundleSolution) -> str:
    """Points with their standard deviations, where there are any, and the number of their rays."""
    parts, names = [solution.coordinates], ["x", "y", "z"]
    if solution.result.has_covariances:
        parts.append(np.sqrt(np.diagonal(solution.point_covariances, axis1=1, axis2=2)))
        names += ["sx", "sy", "sz"]
    counts, values = solution.by_point().counts.tolist(), np.hstack(parts).tolist()
    rows = [(name, *row, n) for name, row, n in zip(solution.points, values, counts, strict=True)]
    return table_text(("point", *names, "rays"), rows)


def check_table(record: BundleRecord) -> str:
    """Check points as a table: differences, adjusted minus given, and their sigmas."""
    nothing = ("", "", "")
    rows = [
        (point.name, *point.residual, *(point.sigmas or nothing), point.n_rays)
        for point in record.check_points
    ]
    return table_text(("point", "dx", "dy", "dz", "sx", "sy", "sz", "rays"), rows)
