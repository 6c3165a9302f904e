"""Cameras of OpenSfM: lengths in shares of the larger side, places from the middle of the image."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray
from obseq.formats.blocks.json_nodes import Node
from obseq.formats.fitted import fitted_camera
from obseq.images.camera import Camera

BROWN = ("perspective", "brown", "radial", "simple_radial")
_TWO = ("F", "PPx", "PPy", "b1")
FREE = {
    "perspective": ("F", "K1", "K2"),
    "simple_radial": (*_TWO, "K1"),
    "radial": (*_TWO, "K1", "K2"),
    "brown": (*_TWO, "K1", "K2", "K3", "p1", "p2"),
    "fisheye": ("F", "K1", "K2"),
    "fisheye_opencv": (*_TWO, "K1", "K2", "K3", "K4"),
}
"""Our names of what OpenSfM estimates of each model."""


def read_camera(name: str, given: Node) -> tuple[Camera, tuple[str, ...]]:
    """A camera, and what is unknown of it.

    Raises:
        InputError: a number is missing, or the model is not one of ours.
    """
    kind = given["projection_type"].text()
    if kind not in FREE:
        raise given.problem(f"the projection {kind!r} is not read; {', '.join(FREE)} are")
    size = int(given["width"].number()), int(given["height"].number())
    unit = float(max(size))
    focal = given["focal_x" if "focal_x" in given else "focal"].number() * unit
    other = given.get("focal_y", focal / unit).number() * unit
    middle = np.array(size) / 2.0 + unit * np.array([given.get(key, 0.0).number() for key in ("c_x", "c_y")])
    terms = {f"K{k}": given.get(f"k{k}", 0.0).number() for k in range(1, 5)}
    if kind in BROWN:
        terms = {name: value for name, value in terms.items() if name != "K4"}
        terms |= {"p1": given.get("p2", 0.0).number(), "p2": given.get("p1", 0.0).number()}
    degree, projection = ((3, 1, 1), "Stenope") if kind in BROWN else ((5, 1, 1), "FE_EquiDist")
    return two_focals(name, size, (focal, other), middle, degree, terms, projection), FREE[kind]


def two_focals(
    name: str,
    size: tuple[int, int],
    focals: tuple[float, float],
    middle: FloatArray,
    degree: tuple[int, int, int],
    terms: dict[str, float],
    projection: str,
) -> Camera:
    """A camera whose distorted coordinates have a focal length each: ours where they are one, else fitted."""
    fx, fy = focals
    camera = Camera(name, *size, fy, middle, degree, terms, projection)
    if fx == fy:
        return camera
    if not any(terms.values()):
        return Camera(name, *size, fy, middle, degree, {"b1": fx / fy - 1.0}, projection)

    def project(plane: FloatArray) -> FloatArray:
        return np.asarray(camera.distorted(plane) * [fx, fy] + middle)

    return fitted_camera(name, size, fy, project, (degree, (*degree[:2], 5)), projection)
