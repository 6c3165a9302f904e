"""Cameras of other programs as ours: exactly where the models agree, else the closest one with its misfit.

A pixel is linear in F, the principal point, and F times each coefficient, so that the closest camera is a
linear least-squares problem over a grid of the image.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.images.camera import Camera

STEPS = 21
"""Lines and columns of the grid."""
MISFIT = 0.01
"""Pixels that the closest camera may be off, anywhere in the image."""
BEYOND = 1.25
"""How far the grid of directions reaches beyond the frame of an image without distortion."""


DEGREES = ((3, 1, 1), (3, 1, 5))
"""Degrees that are tried: the usual one, then one with room for other affine parts."""


def fitted_camera(
    name: str,
    size: tuple[int, int],
    focal: float,
    projection: Callable[[FloatArray], FloatArray],
    degrees: Sequence[tuple[int, int, int]] = DEGREES,
    kind: str = "Stenope",
) -> Camera:
    """The camera that projects as another program says, of the first degree that reaches it.

    Args:
        name: of the camera.
        size: columns and lines.
        focal: about its focal length, pixels.
        projection: pixels (n, 2) of dimensionless coordinates (n, 2) before the distortion: of a pinhole x/z
            and y/z, x right, y down.
        degrees: of the distortion, as they are tried.
        kind: what takes directions to those coordinates (`Camera.projection`).

    Raises:
        InputError: no camera of these degrees comes within a hundredth of a pixel.
    """
    plane = _grid(size, focal)
    with np.errstate(all="ignore"):
        pixels = projection(plane)
    inside = ((pixels >= 0.0) & (pixels <= np.array(size))).all(axis=1)
    if np.count_nonzero(inside) < STEPS:
        raise InputError(f"camera {name}: its parameters project hardly anything into its image")
    misfit = np.inf
    for degree in degrees:
        camera, misfit = _closest(
            Camera(name, *size, 1.0, degree=degree, projection=kind), plane[inside], pixels[inside]
        )
        if misfit <= MISFIT:
            return camera
    raise InputError(
        f"camera {name}: its distortion differs from ours by {misfit:.2g} pixels in the image; undistort the "
        "measures, or calibrate a camera without distortion here"
    )


def _closest(plain: Camera, plane: FloatArray, pixels: FloatArray) -> tuple[Camera, float]:
    """The closest camera of a degree, and the largest distance (pixels) to what is wanted."""
    columns = _columns(plain, plane)
    if not np.isfinite(columns).all():
        raise InputError(f"camera {plain.name}: its focal length is no focal length in pixels")
    found, *_ = np.linalg.lstsq(columns, pixels.ravel(), rcond=None)
    if not (np.isfinite(found).all() and found[0] > 0.0):
        return plain, np.inf
    middle = np.array(found[1:3], dtype=np.float64)
    camera = replace(plain, focal=float(found[0]), principal_point=middle, distortion=found[3:] / found[0])
    return camera, float(np.abs(camera.focal * camera.distorted(plane) + middle - pixels).max())


def _grid(size: tuple[int, int], focal: float) -> FloatArray:
    reach = np.clip(BEYOND * np.array(size) / (2.0 * max(focal, 1e-9)), 1e-9, 1e9)
    x, y = np.meshgrid(*(np.linspace(-r, r, STEPS) for r in reach))
    return np.column_stack([x.ravel(), y.ravel()])


def _columns(plain: Camera, plane: FloatArray) -> FloatArray:
    """(2 n, 3 + k) derivatives of pixels: by F, the principal point, and F times each coefficient."""
    ones, zeros = np.ones(len(plane)), np.zeros(len(plane))
    columns = [plane, np.column_stack([ones, zeros]), np.column_stack([zeros, ones])]
    columns += [
        replace(plain, distortion=unit).distorted(plane) - plane for unit in np.eye(len(plain.coefficients))
    ]
    return np.column_stack([column.ravel() for column in columns])
