"""Adjusted blocks as a reconstruction of OpenSfM: `reconstruction.json` and `tracks.csv`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from obseq.errors import InputError
from obseq.formats.camera_terms import check_cameras
from obseq.geometry import logarithm
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.block import Block
from obseq.images.camera import Camera

Plain = dict[str, Any]

TERMS = ("K1", "K2", "K3", "p1", "p2")
WRITTEN = ("reconstruction.json", "tracks.csv")
HEAD = "OPENSFM_TRACKS_VERSION_v2\n"
WHITE = [255, 255, 255]


def check_block(block: Block) -> None:
    """Refuses, before its adjustment, a block that such files cannot hold.

    Raises:
        InputError: a camera has other terms or no size; a name has a tab in it.
    """
    check_cameras(block, "OpenSfM", TERMS)
    for name in dict.fromkeys(block.camera_of.values()):
        if not block.cameras[name].width:
            raise InputError(
                f"camera {name}: OpenSfM takes lengths in shares of the image, whose size nobody says"
            )
    points = (name for part in block.sets for name in part.measures.point_names)
    wrong = [name for name in (*block.camera_of, *points) if "\t" in name or "\n" in name]
    if wrong:
        raise InputError(f"{wrong[0]!r}: a name with a tab or a line end has no place in tracks.csv")


def opensfm_files(solution: BundleSolution, folder: str | Path) -> dict[Path, str]:
    """The two files; names of images, cameras and points stay."""
    texts = _reconstruction(solution), _tracks(solution)
    return {Path(folder) / name: text for name, text in zip(WRITTEN, texts, strict=True)}


def _camera(camera: Camera) -> Plain:
    given = dict(zip(camera.coefficient_names, camera.coefficients.tolist(), strict=True))
    unit = float(max(camera.width, camera.height))
    x, y = ((camera.principal_point - np.array([camera.width, camera.height]) / 2.0) / unit).tolist()
    size = {"width": camera.width, "height": camera.height}
    radial = {"k1": given.get("K1", 0.0), "k2": given.get("K2", 0.0)}
    focal = camera.focal / unit
    if not (x or y or any(given.get(name) for name in ("K3", "p1", "p2"))):
        return {"projection_type": "perspective", **size, "focal": focal, **radial}
    return {
        "projection_type": "brown", **size, "focal_x": focal, "focal_y": focal, "c_x": x, "c_y": y, **radial,
        "p1": given.get("p2", 0.0), "p2": given.get("p1", 0.0), "k3": given.get("K3", 0.0),
    }  # fmt: skip


def _reconstruction(solution: BundleSolution) -> str:
    back = solution.poses.motions.inverse()
    turns = logarithm(back.rotation).tolist()
    shots = {
        image: {"rotation": turn, "translation": shift, "camera": camera}
        for image, camera, turn, shift in zip(
            solution.poses.images, solution.poses.cameras, turns, back.centre.tolist(), strict=True
        )
    }
    points = {
        name: {"color": WHITE, "coordinates": xyz}
        for name, xyz in zip(solution.points, solution.coordinates.tolist(), strict=True)
    }
    whole: Plain = {
        "cameras": {name: _camera(camera) for name, camera in solution.cameras.items()},
        "shots": shots,
        "points": points,
    }
    frame = solution.block.frame.split("*")
    if frame[0] == "RTL" and frame[4:] and frame[4] in ("Geog", "+proj=latlong +datum=WGS84"):
        longitude, latitude, height = map(float, frame[1:4])
        whole["reference_lla"] = {"latitude": latitude, "longitude": longitude, "altitude": height}
    return json.dumps([whole], indent=1) + "\n"


def _tracks(solution: BundleSolution) -> str:
    found = solution.residuals
    sizes = np.array([(one.width, one.height) for one in solution.start.cameras], dtype=np.float64)[
        found.image
    ]
    xy = (found.xy - sizes / 2.0) / sizes.max(axis=1, keepdims=True)
    images, points = solution.poses.images, solution.points
    rows = zip(found.image.tolist(), found.point.tolist(), xy.tolist(), strict=True)
    return HEAD + "".join(
        f"{images[i]}\t{points[p]}\t{k}\t{x!r}\t{y!r}\t0.004\t255\t255\t255\t-1\t-1\n"
        for k, (i, p, (x, y)) in enumerate(rows)
    )
