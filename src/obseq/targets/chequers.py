"""From a saddle to a chequered target: the directions of its quadrants, the edge of its disc, and its bits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.targets.levels import sampled
from obseq.targets.measuring import Placed
from obseq.targets.rings import Reading, Unread, code_of

if TYPE_CHECKING:
    from obseq.arrays import Array, FloatArray, FloatRows
    from obseq.targets.levels import Level
    from obseq.targets.measuring import Fit
    from obseq.targets.specification import Specification

FARTHEST = 34.0
"""Pixels of the level to the edge of the largest disc; larger ones are found at the next level."""
RAYS_OF_RINGS = (0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85)
RAYS_OF_ROWS = (0.1, 0.14, 0.18, 0.24, 0.3, 0.7, 0.76, 0.82, 0.86, 0.9)
"""Rays in a quadrant, in parts of it. Before the middle of rows the gap to the bits is narrow."""
OUTLIER = 2.5
"""Medians of the distance from the ellipse beyond which a point of the edge does not count."""
MIDDLE = (0.2, 0.8)
"""Share of the contrast between which the threshold of bits is looked for."""
LEAST_GAP = 0.25
"""Least gap between dark and light bits, in contrasts."""


def chequered_disc(level: Level, spec: Specification, saddle: FloatArray) -> Placed | Unread | None:
    """Where the disc around a saddle lies in the image; None where there is no disc.

    Args:
        level: where the saddle was found.
        spec: the set; the angle of its disc counts, and whether bits are near it.
        saddle: (7,) as `find_saddles` gives it.
    """
    sign = 1.0 if spec.geometry.is_white else -1.0
    middle = 0.5 * (saddle[3] + saddle[4])
    dark, light = float(saddle[5]), float(saddle[5] + saddle[6])
    edge = _edge(level.image, spec, saddle[:2], (dark, light), middle, sign)
    if edge is None:
        return None
    shape = _shape(edge)
    if isinstance(shape, Unread):
        return shape
    matrix = _affinity(spec, shape, dark, light)
    if matrix is None:
        return None
    return Placed(level.in_image(saddle[:2]), level.scale * matrix, np.zeros(2), 1.0, np.zeros(2))


def _edge(
    image: Array,
    spec: Specification,
    centre: FloatArray,
    lines: tuple[float, float],
    middle: float,
    sign: float,
) -> FloatRows | None:
    """(n, 2) places, from the centre, where dark quadrants end; None where too few rays meet an end."""
    parts = np.array(RAYS_OF_ROWS if spec.geometry.in_rows else RAYS_OF_RINGS)
    within = lines[0] + parts * (lines[1] - lines[0])
    turns = np.concatenate([within, within + math.pi])
    steps = np.arange(1.5, FARTHEST, 0.5)
    ways = np.column_stack((np.cos(turns), np.sin(turns)))
    x = centre[0] + ways[:, :1] * steps
    y = centre[1] + ways[:, 1:] * steps
    profile = sign * (sampled(image, x, y) - middle)
    rises = (profile[:, :-1] < 0.0) & (profile[:, 1:] >= 0.0)
    has = rises.any(axis=1)
    if has.sum() < 0.7 * len(turns):
        return None
    k = rises.argmax(axis=1)
    rows = np.arange(len(turns))
    low, high = profile[rows, k], profile[rows, k + 1]
    share = np.divide(low, low - high, out=np.zeros(len(rows)), where=has)
    return (ways * (steps[k] + 0.5 * share)[:, None])[has]


def _shape(edge: FloatRows) -> FloatRows | Unread:
    """(2, 2) matrix q of the ellipse `p' q p = 1` about the saddle, from points of its edge."""
    kept = np.ones(len(edge), dtype=bool)
    for _ in range(4):
        x, y = edge[kept].T
        scale = float(np.abs(edge[kept]).max())
        rows = np.column_stack((x * x, 2.0 * x * y, y * y)) / scale**2
        a, b, c = np.linalg.lstsq(rows, np.ones(len(rows)), rcond=None)[0]
        shape: FloatRows = np.array([[a, b], [b, c]]) / scale**2
        if np.linalg.eigvalsh(shape)[0] <= 0.0:
            return Unread("edge of the disc: an ellipse", 0.0, 1.0)
        radius = np.sqrt(np.einsum("ni,ij,nj->n", edge, shape, edge))
        away = np.abs(radius - 1.0) * np.hypot(*edge.T) / radius
        limit = max(0.7, OUTLIER * float(np.median(away[kept])))
        better = away < limit
        if (better == kept).all() or better.sum() < 0.6 * len(edge):
            break
        kept = better
    size = 1.0 / math.sqrt(math.sqrt(float(np.linalg.det(shape))))
    scatter, limit = float(np.median(away[kept])), 0.35 + size / 30.0
    if scatter > limit:
        return Unread("edge of the disc: distance from the ellipse, pixels", scatter, limit)
    if size < 2.5:
        return Unread("radius of the disc, pixels", size, 2.5)
    return shape


def _affinity(spec: Specification, shape: FloatRows, dark: float, light: float) -> FloatRows | None:
    """The map of the drawing whose quadrants and disc are these.

    In the drawing, light turns dark a quarter of a turn after the angle of the chequers, and dark light half
    a turn after it.
    """
    seen = np.empty((2, 2))
    for k, angle in enumerate((dark, light)):
        way = np.array([math.cos(angle), math.sin(angle)])
        seen[:, k] = way / math.sqrt(float(way @ shape @ way))
    angles = spec.geometry.angle + np.array([0.5, 1.0]) * math.pi
    drawn = np.stack([np.cos(angles), np.sin(angles)])
    matrix: FloatRows = seen @ np.linalg.inv(drawn)
    return matrix if np.linalg.det(matrix) > 0.0 else None


def read_bits(image: Array, spec: Specification, places: FloatRows, fit: Fit) -> list[Reading] | Unread:
    """What the bits around a chequered disc may say, the likeliest first.

    Args:
        image: (height, width).
        spec: the set.
        places: (bits, k, 2) places of the drawing where each bit is read, units.
        fit: of the disc.
    """
    n, k, _ = places.shape
    pixels = fit.placed.pixels(places.reshape(-1, 2))
    height, width = image.shape
    if pixels.min() < 0.5 or pixels[:, 0].max() > width - 1.5 or pixels[:, 1].max() > height - 1.5:
        return Unread("inside the image", 0.0, 1.0)
    grey = np.median(sampled(image, *pixels.T).reshape(n, k), axis=1)
    ink = (grey - fit.offset) / fit.gain
    ordered = np.sort(ink)
    gaps, between = np.diff(ordered), 0.5 * (ordered[1:] + ordered[:-1])
    inside = (between > MIDDLE[0]) & (between < MIDDLE[1])
    widest = int(np.argmax(np.where(inside, gaps, -1.0))) if inside.any() else 0
    gap = float(gaps[widest]) if inside.any() else 0.0
    if gap < LEAST_GAP:
        return Unread("bits: gap between dark and light", gap, LEAST_GAP)
    margins = 2.0 * (ink - between[widest])
    code = code_of(margins > 0.0, spec)
    found = _turned(spec, fit.placed, code, margins, 0)
    if not found and (spec.class_distance - 1) // 2 >= 1:
        for bit in np.argsort(np.abs(margins))[:2].tolist():
            found += _turned(spec, fit.placed, code ^ (1 << bit), margins, 1)
    return found or Unread("code of the set", float(code), math.nan)


def _turned(spec: Specification, placed: Placed, code: int, margins: FloatArray, corrected: int) -> list[Reading]:
    """The target of a code, turned as the code is."""
    if code not in spec.turns:
        return []
    name, places = spec.turns[code]
    turn = (-1.0 if spec.geometry.grows else 1.0) * 2.0 * math.pi * places / spec.bits
    c, s = math.cos(turn), math.sin(turn)
    return [Reading(placed.turned(np.array([[c, -s], [s, c]])), name, spec.codes[name], margins, corrected)]
