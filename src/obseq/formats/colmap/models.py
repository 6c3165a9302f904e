"""Camera models of COLMAP: what they project where, in its own words, and ours of them.

A model that ours holds exactly is read so; of the others the closest camera of ours is taken (`fitted`), and
the other way round.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.formats.fitted import MISFIT, STEPS, fitted_camera
from obseq.images.camera import Camera

MODELS = {
    "SIMPLE_PINHOLE": 3,
    "PINHOLE": 4,
    "SIMPLE_RADIAL": 4,
    "RADIAL": 5,
    "OPENCV": 8,
    "OPENCV_FISHEYE": 8,
    "FULL_OPENCV": 12,
    "FOV": 5,
    "SIMPLE_RADIAL_FISHEYE": 4,
    "RADIAL_FISHEYE": 5,
    "THIN_PRISM_FISHEYE": 12,
    "RAD_TAN_THIN_PRISM_FISHEYE": 16,
    "SIMPLE_DIVISION": 4,
    "DIVISION": 5,
    "SIMPLE_FISHEYE": 3,
    "FISHEYE": 4,
    "EUCM": 6,
    "EQUIRECTANGULAR": 2,
}
"""Number of parameters of each model, in the order of COLMAP's numbers."""
ONE_FOCAL = (
    "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "SIMPLE_DIVISION",
    "SIMPLE_FISHEYE",
)  # fmt: skip
FISH_EYES = (
    "OPENCV_FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE",
    "RAD_TAN_THIN_PRISM_FISHEYE", "SIMPLE_FISHEYE", "FISHEYE",
)  # fmt: skip
_ONE, _TWO, _DECENTRIC = ("F", "PPx", "PPy"), ("F", "PPx", "PPy", "b1"), ("p1", "p2")
_FIVE = tuple(f"K{k}" for k in range(1, 6))
FREE = {
    "SIMPLE_PINHOLE": _ONE,
    "PINHOLE": _TWO,
    "SIMPLE_RADIAL": (*_ONE, "K1"),
    "RADIAL": (*_ONE, "K1", "K2"),
    "OPENCV": (*_TWO, "K1", "K2", *_DECENTRIC),
    "FULL_OPENCV": (*_TWO, *_FIVE, *_DECENTRIC),
    "SIMPLE_RADIAL_FISHEYE": (*_ONE, "K1"),
    "RADIAL_FISHEYE": (*_ONE, "K1", "K2"),
    "OPENCV_FISHEYE": (*_TWO, "K1", "K2", "K3", "K4"),
    "FOV": (*_TWO, "K1"),
    "THIN_PRISM_FISHEYE": (*_TWO, "K1", "K2", "K3", "K4", *_DECENTRIC),
    "RAD_TAN_THIN_PRISM_FISHEYE": (*_TWO, *_FIVE, *_DECENTRIC),
    "SIMPLE_DIVISION": (*_ONE, "K1"),
    "DIVISION": (*_TWO, "K1"),
    "SIMPLE_FISHEYE": _ONE,
    "FISHEYE": _TWO,
    "EUCM": (*_TWO, "K1", "K2"),
    "EQUIRECTANGULAR": (),
}
"""Our names of the parameters of each model: two focal lengths are F and b1, a quotient becomes K1 to K5."""
DEGREES = {"Stenope": ((3, 1, 1), (3, 1, 5), (5, 1, 1), (5, 1, 5)), "FE_EquiDist": ((5, 1, 1), (5, 1, 5))}
"""Degrees of ours that are tried for a model that is not exactly one."""


def camera_of(name: str, model: str, size: tuple[int, int], values: Sequence[float]) -> Camera:
    """Our camera of a model and its parameters.

    Raises:
        InputError: none of ours comes near enough.
    """
    if model == "EQUIRECTANGULAR":
        if size[0] != 2 * size[1]:
            raise InputError(f"camera {name}: a panorama is twice as wide as high, not {size}")
        return Camera(name, *size, size[0] / (2.0 * np.pi), degree=(0, 0, 0), projection="EquiRect")
    kind = "FE_EquiDist" if model in FISH_EYES else "Stenope"
    focals, middle, terms = _parts(model, values)
    exact = _exact(model, focals, terms)
    if exact is not None:
        degree, given = exact
        return Camera(name, *size, focals[1], middle, degree, given, kind)

    def project(plane: FloatArray) -> FloatArray:
        return _pixels(model, plane, values)

    return fitted_camera(name, size, focals[1], project, DEGREES[kind], kind)


def _parts(model: str, values: Sequence[float]) -> tuple[tuple[float, float], FloatArray, list[float]]:
    """Two focal lengths, the principal point, and the rest."""
    first = list(values[:1]) * 2 if model in ONE_FOCAL else list(values[:2])
    rest = list(values[1:] if model in ONE_FOCAL else values[2:])
    return (first[0], first[1]), np.array(rest[:2], dtype=np.float64), rest[2:]


def _exact(
    model: str, focals: tuple[float, float], terms: list[float]
) -> tuple[tuple[int, int, int], dict[str, float]] | None:
    """Degree and coefficients of ours that are the model; None where they only come near."""
    fx, fy = focals
    names = {
        "SIMPLE_PINHOLE": (), "PINHOLE": (), "SIMPLE_RADIAL": ("K1",), "RADIAL": ("K1", "K2"),
        "OPENCV": ("K1", "K2", "p2", "p1"), "SIMPLE_RADIAL_FISHEYE": ("K1",),
        "RADIAL_FISHEYE": ("K1", "K2"), "OPENCV_FISHEYE": ("K1", "K2", "K3", "K4"),
        "SIMPLE_FISHEYE": (), "FISHEYE": (),
    }.get(model)  # fmt: skip
    if names is None or (fx != fy and any(terms)):
        return None
    given = dict(zip(names, terms, strict=True))
    if model in ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"):
        return (2, 0, 0), given
    degree = (5, 1, 1) if model == "OPENCV_FISHEYE" else (3, 1, 1)
    return degree, given | {"b1": fx / fy - 1.0}


def _pixels(model: str, plane: FloatArray, values: Sequence[float]) -> FloatArray:
    """Pixels (n, 2) of a model, of plane coordinates (n, 2): x/z, y/z, or an angle with its direction."""
    focals, middle, terms = _parts(model, values)
    return np.asarray(_distorted(model, plane, terms) * focals + middle)


def _distorted(model: str, plane: FloatArray, terms: list[float]) -> FloatArray:
    x, y = plane.T
    square = x * x + y * y
    radius = np.sqrt(square)
    if model == "FOV":
        (omega,) = terms
        angle = np.arctan(2.0 * radius * np.tan(omega / 2.0)) / omega
        share = np.divide(angle, radius, out=np.ones_like(radius), where=radius > 0.0)
        return np.asarray(plane * share[:, None])
    if model in ("SIMPLE_DIVISION", "DIVISION"):
        (k,) = terms  # radius = bent / (1 + k bent^2)
        return np.asarray(plane * (2.0 / (1.0 + np.sqrt(1.0 - 4.0 * k * square)))[:, None])
    if model == "EUCM":
        alpha, beta = terms
        return np.asarray(plane / (alpha * np.sqrt(beta * square + 1.0) + 1.0 - alpha)[:, None])
    if model == "RAD_TAN_THIN_PRISM_FISHEYE":
        bent = np.asarray(plane * (1.0 + square * _series(square, terms[:6]))[:, None])
        u, v = bent.T
        r = u * u + v * v
        (p0, p1), (s0, s1, s2, s3) = terms[6:8], terms[8:]
        dx = 2.0 * u * (p0 * u + p1 * v) + p0 * r + s0 * r + s1 * r * r
        dy = 2.0 * v * (p0 * u + p1 * v) + p1 * r + s2 * r + s3 * r * r
        return np.asarray(bent + np.column_stack([dx, dy]))
    if model == "THIN_PRISM_FISHEYE":
        k1, k2, p1, p2, k3, k4, s1, s2 = terms
        radial, prism = square * _series(square, [k1, k2, k3, k4]), (s1 * square, s2 * square)
        bent = plane * (1.0 + radial)[:, None]
        return np.asarray(bent + _tangential(x, y, p1, p2) + np.column_stack(prism))
    if model == "FULL_OPENCV":
        k1, k2, p1, p2, k3, k4, k5, k6 = terms
        above, below = (1.0 + square * _series(square, k) for k in ([k1, k2, k3], [k4, k5, k6]))
        return np.asarray(plane * (above / below)[:, None] + _tangential(x, y, p1, p2))
    powers = terms[:2] if model == "OPENCV" else terms
    p1, p2 = terms[2:] if model == "OPENCV" else (0.0, 0.0)
    radial = 1.0 + square * _series(square, powers)
    return np.asarray(plane * radial[:, None] + _tangential(x, y, p1, p2))


def _series(square: FloatArray, terms: Sequence[float]) -> FloatArray:
    """k1 + k2 s + k3 s^2 + ..."""
    found = np.zeros_like(square)
    for term in reversed(list(terms)):
        found = found * square + term
    return found


def _tangential(x: FloatArray, y: FloatArray, p1: float, p2: float) -> FloatArray:
    square = x * x + y * y
    return np.column_stack(
        [2.0 * p1 * x * y + p2 * (square + 2.0 * x * x), p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y]
    )


def parameters_of(camera: Camera, models: Sequence[str]) -> tuple[str, FloatArray]:
    """The first of some models that projects as a camera of ours, and its parameters.

    Raises:
        InputError: none comes within a hundredth of a pixel in the image.
    """
    if camera.projection == "EquiRect":
        return "EQUIRECTANGULAR", np.array([camera.width, camera.height], dtype=np.float64)
    plane, pixels = _seen(camera)
    misfit = np.inf
    for model in models:
        if (model in FISH_EYES) != (camera.projection == "FE_EquiDist"):
            continue
        found, misfit = _closest(model, camera, plane, pixels)
        if misfit <= 2.0 * MISFIT:  # there and back
            return model, found
    raise InputError(f"camera {camera.name}: its model of COLMAP projects otherwise, {misfit:.2g} px at best")


def _seen(camera: Camera) -> tuple[FloatArray, FloatArray]:
    """The middles of cells of the image (n, 2) of a camera, and their plane coordinates (n, 2)."""
    size = (camera.width, camera.height) if camera.width else (2.0 * camera.principal_point).tolist()
    x, y = np.meshgrid(*((np.arange(STEPS) + 0.5) * side / STEPS for side in size))
    pixels = np.column_stack([x.ravel(), y.ravel()])
    plane = camera.undistorted((pixels - camera.principal_point) / camera.focal)
    there = np.isfinite(plane).all(axis=1)
    return plane[there], pixels[there]


def _closest(model: str, camera: Camera, plane: FloatArray, pixels: FloatArray) -> tuple[FloatArray, float]:
    """Parameters of a model that come nearest, and the largest distance that they leave (pixels)."""
    focals = [camera.focal] if model in ONE_FOCAL else [camera.focal, camera.focal]
    n_terms = MODELS[model] - len(focals) - 2
    terms = {"FOV": [0.1], "EUCM": [0.1, 1.0]}.get(model, [0.0] * n_terms)
    start = np.array([*focals, *camera.principal_point, *terms])
    scales = np.array([camera.focal] * (len(focals) + 2) + [1.0] * n_terms)

    def off(share: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            found = _pixels(model, plane, (share * scales).tolist()) - pixels
        return np.nan_to_num(found, nan=1e9, posinf=1e9, neginf=1e9).ravel()

    done = least_squares(off, start / scales, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return np.asarray(done.x * scales), float(np.abs(done.fun).max())
