"""Adjusted blocks as the XML of cameras and markers of Agisoft Metashape: a chunk in a local frame.

Control points, check points and points with names are markers, their image points pinned projections; tie
points that are numbers are no markers: such files have none.
"""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from obseq.formats.camera_terms import check_cameras
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.block import Block
from obseq.images.camera import Camera

TERMS = ("K1", "K2", "K3", "K4", "p1", "p2")
LOCAL = 'LOCAL_CS["Local Coordinates",LOCAL_DATUM["Local Datum",0],UNIT["metre",1]]'

HEAD = (
    '<?xml version="1.0" encoding="UTF-8"?>\n<document version="1.5.0">\n'
    '<chunk label="obseq" enabled="true">\n'
)


def check_block(block: Block) -> None:
    """Refuses, before its adjustment, a block that such a file cannot hold: cameras with other terms."""
    check_cameras(block, "Metashape", TERMS)


def metashape_files(solution: BundleSolution, path: str | Path) -> dict[Path, str]:
    """The file."""
    cameras = {name: k for k, name in enumerate(solution.cameras)}
    parts = [
        HEAD,
        "<sensors>\n",
        *(_sensor(k, solution.cameras[name]) for name, k in cameras.items()),
        "</sensors>\n<cameras>\n",
        *(_image(k, solution, cameras) for k in range(len(solution.poses))),
        "</cameras>\n<markers>\n",
        *_markers(solution),
        '</markers>\n<frames>\n<frame id="0">\n<markers>\n',
        *_projections(solution),
        "</markers>\n</frame>\n</frames>\n",
        f"<reference>{LOCAL}</reference>\n",
        f'<settings><property name="accuracy_projections" value="{_sigma(solution):.17g}"/></settings>\n',
        "</chunk>\n</document>\n",
    ]
    return {Path(path): "".join(parts)}


def _words(values: object) -> str:
    return " ".join(f"{value:.17g}" for value in np.ravel(np.asarray(values)).tolist())


def _sigma(solution: BundleSolution) -> float:
    return float(np.median(solution.residuals.sigmas))


def _sensor(number: int, camera: Camera) -> str:
    given = dict(zip(camera.coefficient_names, camera.coefficients.tolist(), strict=True))
    x, y = (camera.principal_point - np.array([camera.width, camera.height]) / 2.0).tolist()
    values = {"f": camera.focal, "cx": x, "cy": y}
    values |= {name.lower(): given[name] for name in TERMS if given.get(name)}
    fields = "".join(f"<{tag}>{value:.17g}</{tag}>" for tag, value in values.items())
    size = f'<resolution width="{camera.width}" height="{camera.height}"/>'
    return (
        f'<sensor id="{number}" label={quoteattr(camera.name)} type="frame">{size}\n'
        f'<calibration type="frame" class="adjusted">{size}{fields}</calibration></sensor>\n'
    )


def _image(number: int, solution: BundleSolution, cameras: dict[str, int]) -> str:
    image, camera = solution.poses.images[number], solution.poses.cameras[number]
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = solution.poses.rotations[number], solution.poses.centres[number]
    return (
        f'<camera id="{number}" sensor_id="{cameras[camera]}" label={quoteattr(image)} enabled="true">'
        f"<transform>{_words(matrix)}</transform></camera>\n"
    )


def _numbered(solution: BundleSolution) -> list[tuple[int, str]]:
    """The markers: points with names, and control and check points."""
    known = {*solution.block.control.names, *solution.block.check_points.names}
    return [(k, name) for k, name in enumerate(solution.points) if name in known or not name.isdigit()]


def _markers(solution: BundleSolution) -> list[str]:
    control, found = solution.block.control, []
    given = dict(zip(control.names, zip(control.coordinates, control.sigmas, strict=True), strict=True))
    for k, name in _numbered(solution):
        reference = ""
        if name in given and np.isfinite(given[name][1]).all():
            xyz, sigmas = (values.tolist() for values in given[name])
            pairs = zip(("x", "y", "z", "sx", "sy", "sz"), [*xyz, *sigmas], strict=True)
            fields = " ".join(f'{key}="{value:.17g}"' for key, value in pairs)
            reference = f'<reference {fields} enabled="true"/>'
        found.append(f'<marker id="{k}" label={quoteattr(name)}>{reference}</marker>\n')
    return found


def _projections(solution: BundleSolution) -> list[str]:
    residuals = solution.residuals
    order = np.argsort(residuals.point, kind="stable")
    rows_of = np.split(order, np.cumsum(np.bincount(residuals.point, minlength=len(solution.points)))[:-1])
    found = []
    for k, _ in _numbered(solution):
        places = "".join(
            f'<location camera_id="{residuals.image[row]}" pinned="true" x="{residuals.xy[row, 0]:.17g}" '
            f'y="{residuals.xy[row, 1]:.17g}"/>'
            for row in rows_of[k]
        )
        found.append(f'<marker marker_id="{k}">{places}</marker>\n')
    return found
