"""Clouds of residuals, for a viewer of point clouds, and the text of percentiles: what VisuRedHom writes.

x and y are pixels of image 1 (y down), z is a thousandth of a pixel of residual.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from itertools import product

import numpy as np

from obseq.arrays import FloatArray
from obseq.images.epipolar.field import INTERVALS, Fit, percentiles

EXAGGERATION = 1000.0
"""z of a cloud per pixel of residual."""
REDUCTION = 10
"""Pixels of the image per point of its plane."""
RADIUS, STEP = 5.0, 5.0 / 3.0
"""Of the balls: 123 points of a cubic lattice each."""
RED, GREY = (255, 0, 0), 128
FIT_COLOURS = ((31, 119, 180), (255, 127, 14), (44, 160, 44), (148, 103, 189), (140, 86, 75), (227, 119, 194))
_VERTEX = np.dtype([("place", "<f4", 3), ("colour", "u1", 3)])


def residual_cloud(
    pixels: FloatArray, values: FloatArray, size: tuple[int, int], grey: FloatArray | None = None
) -> bytes:
    """A PLY file: the plane of image 1, then a red ball per point at its residual.

    Args:
        pixels: (n, 2) points of image 1.
        values: (n,) residuals.
        size: (width, height) of image 1.
        grey: (ny, nx) brightness of the reduced image, 0 to 255; without it the plane is grey.
    """
    return ply_bytes(np.concatenate([image_plane(size, grey), balls(pixels, values, RED)]))


def fit_cloud(pixels: FloatArray, fit: Fit) -> bytes:
    """A PLY file: a ball per point at the fitted residual, in the colour of the degree."""
    colour = FIT_COLOURS[fit.polynomial.degree % len(FIT_COLOURS)]
    return ply_bytes(balls(pixels, fit.polynomial(pixels), colour))


def image_plane(
    size: tuple[int, int], grey: FloatArray | None = None
) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """Vertices of the reduced image: columns one after the other, from top to bottom."""
    nx, ny = (-(-side // REDUCTION) for side in size)
    x, y = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    found = np.zeros(nx * ny, _VERTEX)
    found["place"][:, 0], found["place"][:, 1] = REDUCTION * x.ravel(), REDUCTION * y.ravel()
    shade = np.full((nx, ny), GREY) if grey is None else np.clip(grey[:ny, :nx].T, 0, 255)
    found["colour"] = shade.reshape(-1, 1).astype(np.uint8)
    return found


def reduced(image: FloatArray) -> FloatArray:
    """The brightness (ny, nx) of an image (height, width) reduced by ten: a cubic kernel around each point.

    The kernel is 1 - 3 u^2 + 2 |u|^3 over one reduced pixel to each side; the border is continued.
    """
    height, width = image.shape
    return _weights(height) @ image @ _weights(width).T


def _weights(side: int) -> FloatArray:
    """(reduced, side) share of each source line in each reduced line."""
    reach = np.arange(1 - REDUCTION, REDUCTION)
    u = np.abs(reach) / REDUCTION
    kernel = 2.0 * u**3 - 3.0 * u**2 + 1.0
    found = np.zeros((-(-side // REDUCTION), side))
    for row in range(len(found)):
        source = np.clip(REDUCTION * row + reach, 0, side - 1)
        np.add.at(found[row], source, kernel / kernel.sum())
    return found


def balls(
    pixels: FloatArray, values: FloatArray, colour: tuple[int, int, int]
) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """Vertices of one ball per point."""
    ball = _ball()
    found = np.zeros((len(pixels), len(ball)), _VERTEX)
    centres = np.column_stack([pixels, EXAGGERATION * values])
    found["place"] = centres[:, None, :] + ball
    found["colour"] = colour
    return found.ravel()


def ply_bytes(vertices: np.ndarray[tuple[int], np.dtype[np.void]]) -> bytes:
    """A binary PLY file of coloured points, without faces."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        "element face 0\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return header.encode("ascii") + vertices.tobytes()


def percentile_text(values: FloatArray, pixels: FloatArray, fits: Sequence[Fit]) -> str:
    """The percentiles of the residuals, and of what each fit but the last leaves (MicMac's layout)."""
    out = io.StringIO()
    out.write(f"Nb Pts={len(values)}\n")
    left = [
        ("Initial", values),
        *((f"Degree={f.polynomial.degree}", values - f.polynomial(pixels)) for f in fits),
    ]
    for label, errors in left[:-1] if len(left) > 1 else left:
        out.write(f"================= PERC  : RESIDU ==================\n    {label}     \n")
        for k, value in enumerate(percentiles(errors)):
            out.write(f"Res[{100.0 * k / INTERVALS:f}]={value:f}\n")
    return out.getvalue()


def _ball() -> FloatArray:
    side = STEP * np.arange(-3, 4)
    lattice = np.array(list(product(side, side, side)))
    return np.asarray(lattice[(lattice**2).sum(axis=1) <= RADIUS**2 * (1.0 + 1e-9)])
