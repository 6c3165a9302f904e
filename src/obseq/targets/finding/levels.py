"""An image at half, a quarter, ... of its size: figures of any size look alike at one of them."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from obseq.arrays import Array, BoolArray, FloatArray, FloatRows
from obseq.dataclass import dataclass
from obseq.targets.finding.detection import halved

TILE = 1024
"""Pixels of the side of a tile: what is computed on one stays in a cache of the second level, nearly."""
STRIP = 16
"""Lines that are reduced at once: what is computed stays in a cache of the second level."""
MARGIN = 40
"""Pixels around a tile that are looked at with it: the largest figure of a level, and its surroundings."""
SMALLEST = 48
"""Sides of the smallest level: the smallest figures do not need more, and larger ones do not fit."""
LEAST_NOISE = 0.3
"""Grey levels: the rounding to whole ones."""


@dataclass(frozen=True, eq=False)
class Tile:
    """A part of a level.

    Attributes:
        image: (height, width) with its margins.
        left: column of its first pixel in the level.
        top: line of its first pixel.
        core: first and last column, first and last line that are its own, in the level.
    """

    image: FloatRows
    left: int
    top: int
    core: tuple[int, int, int, int]

    def owns(self, places: FloatRows) -> BoolArray:
        """(n,) which places (n, 2), in its image, are its own."""
        x0, x1, y0, y1 = self.core
        x, y = (places + np.array([self.left, self.top])).T
        own: BoolArray = (x >= x0 - 0.5) & (x < x1 - 0.5) & (y >= y0 - 0.5) & (y < y1 - 0.5)
        return own


@dataclass(frozen=True, eq=False)
class Level:
    """An image, reduced.

    Attributes:
        number: how many times it was halved.
        image: (height, width) grey levels.
        noise: standard deviation of a pixel, grey levels.
    """

    number: int
    image: Array
    noise: float

    @property
    def scale(self) -> float:
        """Pixels of the image in one of the level."""
        return float(1 << self.number)

    def in_image(self, places: FloatArray) -> FloatArray:
        """Places of the level as places of the image, pixels."""
        return self.scale * places + 0.5 * (self.scale - 1.0)

    def tiles(self) -> Iterator[Tile]:
        """Parts that cover it."""
        height, width = self.image.shape
        for y in range(0, height, TILE):
            for x in range(0, width, TILE):
                right, bottom = min(x + TILE, width), min(y + TILE, height)
                left, top = max(x - MARGIN, 0), max(y - MARGIN, 0)
                part = self.image[top : bottom + MARGIN, left : right + MARGIN]
                yield Tile(part.astype(np.float64, order="C"), left, top, (x, right, y, bottom))


def levels_of(image: Array) -> list[Level]:
    """The image and its reductions, the largest first."""
    found = [Level(0, image, noise_of(image))]
    while min(found[-1].image.shape) >= 2 * SMALLEST:
        smaller = _half(found[-1])
        found.append(Level(len(found), smaller, noise_of(smaller)))
    return found


def _half(level: Level) -> Array:
    """Half of a level, strip by strip: none is held in single precision as a whole."""
    height, width = (size // 2 for size in level.image.shape)
    out = np.empty((height, width), dtype=np.float32)
    for top in range(0, height, STRIP):
        strip = level.image[2 * top : 2 * min(top + STRIP, height)].astype(np.float64, order="C")
        half = np.empty((len(strip) // 2, width))
        halved(strip, half)
        out[top : top + STRIP] = half
    return out


def noise_of(image: Array) -> float:
    """Standard deviation of the noise of a pixel, from what second differences are at the middle one."""
    step = max(1, image.shape[0] // 256)
    lines = image[:: max(step, 1), :4096].astype(np.float32)
    differences = np.abs(lines[:, 2:] - 2.0 * lines[:, 1:-1] + lines[:, :-2])
    return max(float(np.median(differences)) * 1.4826 / math.sqrt(6.0), LEAST_NOISE)


def sampled(image: Array, x: FloatArray, y: FloatArray) -> FloatArray:
    """The image between its pixels; at its edge beyond them. Arrays of any one shape."""
    height, width = image.shape
    x = np.clip(x, 0.0, width - 1.001)
    y = np.clip(y, 0.0, height - 1.001)
    i, j = x.astype(np.int64), y.astype(np.int64)
    u, v = x - i, y - j
    upper = (1.0 - u) * image[j, i] + u * image[j, i + 1]
    lower = (1.0 - u) * image[j + 1, i] + u * image[j + 1, i + 1]
    found: FloatArray = (1.0 - v) * upper + v * lower
    return found
