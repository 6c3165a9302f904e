"""What may be the middle of a target: light spots, and saddles, at each level of an image."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.targets.finding.detection import RING, discs, saddle_strength, saddles, smooth
from obseq.targets.finding.figures import MOST_PLACES, UNKNOWNS, fit_discs
from obseq.targets.finding.light_spots import above_mean, spots, stand_out
from obseq.targets.finding.spot_edges import CONIC, RAYS, edge_ellipses

if TYPE_CHECKING:
    from obseq.arrays import FloatRows
    from obseq.targets.finding.levels import Level, Tile

SMOOTHING = 1.2
"""Sigma of the smoothing before saddles are looked for, pixels."""
LIGHTLY = 0.7
"""And before spots are."""
WAYS = np.column_stack([turn(np.arange(2 * RING) * math.pi / RING) for turn in (np.cos, np.sin)])
"""Directions all around."""
CIRCLE = 3.5
"""Radius of the circle around a saddle: the smallest figure of a level is somewhat larger."""
SURE = 4.0
"""Standard deviations of noise that nothing exceeds by chance often enough to matter."""
SQUARE = 10
"""Half the side of the square whose mean a spot exceeds: it holds a spot and what is dark around it."""
SPOT_AREAS = (9, 320)
"""Pixels of the smallest and the largest spot of a level; larger ones are found at the next."""
LEAST_MOMENT = 0.1
"""Second moment of the narrowest spot, pixels squared: that of a pixel is 0.08."""
RADII = np.array([2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0])
"""Of the circles on which the directions of crossing lines are taken, pixels, as far as they go on."""
FARTHEST = 34.0
"""Pixels to the edge of the largest disc of a level; larger ones are found at the next."""
LIKELY = 0.8
"""Share of the grey variance that a disc explains at least, fitted roughly, before its code is looked at.
Those of targets of 20 pixels and more, up to a tilt of 70 degrees, explain 0.82 to 1 (bench)."""
MOST = 40000
"""Candidates of a tile at most."""


def gaussian(sigma: float) -> FloatRows:
    """(2 k + 1,) weights of a Gaussian."""
    reach = math.ceil(3.0 * sigma)
    x = np.arange(-reach, reach + 1.0)
    weights = np.exp(-0.5 * (x / sigma) ** 2)
    found: FloatRows = weights / weights.sum()
    return found


def find_discs(level: Level, sign: float, gap: float) -> FloatRows:
    """(n, 11) chequered discs of a level; the strongest first.

    x, y, strength, dark and light level, the angle at which light turns dark, by how much further dark turns
    light, the ellipse `p' q p = 1` of the disc: q11, q12, q22, and the point spread. Levels have the sign.

    Args:
        level: of the image.
        sign: 1, or -1 for light and dark exchanged.
        gap: width of the sheet between a disc and its code, in radii of the disc.
    """
    found = np.vstack([_tile_discs(tile, level.noise, sign, gap) for tile in level.tiles()])
    return found[np.argsort(-found[:, 2], kind="stable")]


def _tile_discs(tile: Tile, noise: float, sign: float, gap: float) -> FloatRows:
    found = _tile_saddles(tile, noise)
    shapes = np.empty((len(found), 5))
    discs(tile.image, sign, noise, RADII, WAYS, FARTHEST, found, shapes)
    found = np.column_stack((found, shapes, np.empty(len(found))))[np.isfinite(shapes[:, 0])]
    rows = (MOST_PLACES, UNKNOWNS)
    rooms = [np.empty(shape) for shape in (rows, rows, MOST_PLACES, (3, UNKNOWNS), (UNKNOWNS, UNKNOWNS))]
    share = np.empty(len(found))
    fit_discs(tile.image, sign, noise, gap, found, share, *rooms)
    found[:, :2] += np.array([tile.left, tile.top])
    return found[share > LIKELY]


def _tile_saddles(tile: Tile, noise: float) -> FloatRows:
    """(n, 5) its own, as `saddles` writes them."""
    after = noise / (2.0 * math.sqrt(math.pi) * SMOOTHING)
    least = (SURE * after / (2.0 * SMOOTHING**2)) ** 2
    work, smoothed = np.empty_like(tile.image), np.empty_like(tile.image)
    smooth(tile.image, gaussian(SMOOTHING), work, smoothed)
    saddle_strength(smoothed, work)
    out, circle = np.empty((MOST, 5)), np.column_stack((CIRCLE * WAYS[::2], np.empty(RING)))
    found = out[: saddles(smoothed, work, least, 2.0 * SURE * after, circle, 6, out)]
    return found[tile.owns(found[:, :2])]


def find_spots(level: Level, sign: float) -> FloatRows:
    """(n, 8) elliptic spots of a level, in pixels of the image.

    x, y, both half axes (x and y of the first, of the second), dark level around and light level inside.

    Args:
        level: of the image.
        sign: 1 for light spots, -1 for dark ones: levels have that sign then.
    """
    found = np.vstack([_tile_spots(tile, level.noise, sign) for tile in level.tiles()])
    found[:, :2] = level.in_image(found[:, :2])
    found[:, 2:6] *= level.scale
    return found


def _tile_spots(tile: Tile, noise: float, sign: float) -> FloatRows:
    image = tile.image if sign > 0 else sign * tile.image
    height, width = image.shape
    work, smoothed = np.empty_like(image), np.empty_like(image)
    smooth(image, gaussian(LIGHTLY), work, smoothed)
    marks = np.empty((height, width), dtype=np.uint8)
    least = SURE * noise / (2.0 * math.sqrt(math.pi) * LIGHTLY)
    above_mean(smoothed, SQUARE, least, np.empty(width + 1), marks)
    found = np.empty((MOST, 6))
    found = found[: spots(marks, np.empty(height * width, dtype=np.int64), *SPOT_AREAS, found)]
    found = found[tile.owns(found[:, :2])]
    levels = np.empty((len(found), 2))
    stand_out(smoothed, found, levels)
    found = np.column_stack((found[:, :2], _half_axes(found[:, 2:5]), levels))
    found = found[levels[:, 1] > levels[:, 0]]
    edge_ellipses(image, 1.0, np.empty((CONIC + 2, RAYS)), found)
    found[:, :2] += np.array([tile.left, tile.top])
    return found[np.isfinite(found[:, 0])]


def _half_axes(moments: FloatRows) -> FloatRows:
    """(n, 4) two half axes of the ellipses whose second moments (n, 3) are xx, xy, yy."""
    xx, xy, yy = moments.T
    first = 2.0 * np.sqrt(xx)
    across = 2.0 * np.sqrt(np.maximum(yy - xy * xy / xx, LEAST_MOMENT))
    return np.column_stack((first, 4.0 * xy / first, np.zeros(len(xx)), across))
