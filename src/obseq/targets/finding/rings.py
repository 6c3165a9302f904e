"""From a light spot to a ring target: its ellipse, and the bits of the ring around it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.targets.finding.fits import Placed
from obseq.targets.finding.levels import sampled

if TYPE_CHECKING:
    from obseq.arrays import Array, BoolArray, FloatArray, FloatRows
    from obseq.targets.finding.levels import Level
    from obseq.targets.specification import Specification

RAYS = 32
"""Rays from the middle of a spot to its edge."""
FEWEST_RAYS = 26
"""Of them, those that must meet the edge."""
THREADS = 5
"""Radii in the middle half of the ring of the code, whose median is read."""
LEAST_CELL = 6
"""Places read in a bit, at least."""
LIGHT_IN_GAP = 0.45
"""Share of the contrast that the dark ring around the spot may reach in the median."""
MARGIN = 0.2
"""Least distance of a bit from the middle between light and dark, in half contrasts: else it is not read."""
UNEVEN = 0.35
"""Mean scatter within bits, over that of all: where the ring is cut into bits at all, a third or less."""


@dataclass(frozen=True, eq=False)
class Reading:
    """A code that was read.

    Attributes:
        placed: where the drawing lies, as far as it is known.
        code: the bits as they stand in the image from the drawing's first direction on.
        name: of the target, and how many bits it is turned.
        margins: (bits,) distance of each from the middle between light and dark, in half contrasts.
        corrected: bits that were read otherwise.
    """

    placed: Placed
    name: str
    code: int
    margins: FloatArray
    corrected: int = 0


@dataclass(frozen=True)
class Unread:
    """Why no code was read: what was looked at, the value, and what it had to reach."""

    stage: str
    value: float
    limit: float


def spot_ellipse(image: Array, level: Level, spot: FloatRows, sign: float) -> Placed | None:
    """The ellipse of a spot in the image: its centre, and half axes as columns; None where it has none.

    Args:
        image: (height, width).
        level: where the spot was found.
        spot: (7,) as `find_spots` gives it.
        sign: 1 for light spots.
    """
    middle = (spot[5] + spot[6]) / 2.0
    axes = _half_axes(spot[2], spot[3], spot[4])
    found = _through_edge(level.image, sign, spot[:2], axes, middle)
    if found is None:
        return None
    centre, axes = level.in_image(found[0]), level.scale * found[1]
    if level.number:
        finer = _through_edge(image, sign, centre, axes, middle)
        centre, axes = finer if finer is not None else (centre, axes)
    return Placed(centre, axes, np.zeros(2), 1.0, np.zeros(2))


def _half_axes(xx: float, xy: float, yy: float) -> FloatRows:
    """(2, 2) half axes of the ellipse with these moments, as columns; the second is counted clockwise."""
    values, ways = np.linalg.eigh(np.array([[xx, xy], [xy, yy]]))
    axes = 2.0 * ways * np.sqrt(np.maximum(values, 0.1))
    if np.linalg.det(axes) < 0.0:
        axes[:, 1] = -axes[:, 1]
    found: FloatRows = axes
    return found


def _through_edge(
    image: Array, sign: float, centre: FloatArray, axes: FloatRows, middle: float
) -> tuple[FloatArray, FloatRows] | None:
    """The ellipse through the places where rays meet the level between light and dark."""
    turns = 2.0 * math.pi * np.arange(RAYS) / RAYS
    ways = np.column_stack((np.cos(turns), np.sin(turns))) @ axes.T
    length = math.sqrt(abs(float(np.linalg.det(axes))))
    steps = np.linspace(0.4, 1.7, max(14, min(60, math.ceil(4.0 * 1.3 * length))))
    x = centre[0] + ways[:, :1] * steps
    y = centre[1] + ways[:, 1:] * steps
    profile = sign * sampled(image, x, y) - middle
    falls = (profile[:, :-1] > 0.0) & (profile[:, 1:] <= 0.0)
    has = falls.any(axis=1)
    if has.sum() < FEWEST_RAYS:
        return None
    k = falls.argmax(axis=1)
    rows = np.arange(RAYS)
    high, low = profile[rows, k], profile[rows, k + 1]
    share = np.divide(high, high - low, out=np.zeros(RAYS), where=has)
    reach = (steps[k] + share * (steps[1] - steps[0]))[has]
    return fitted_ellipse(centre + ways[has] * reach[:, None])


def fitted_ellipse(points: FloatRows) -> tuple[FloatArray, FloatRows] | None:
    """Centre and half axes (columns) of the ellipse through points; None where they are not on one.

    The conic `a x^2 + b x y + c y^2 + d x + e y = 1` by linear least squares, about the mean of the points.
    """
    mean = points.mean(axis=0)
    scale = np.abs(points - mean).max() or 1.0
    x, y = ((points - mean) / scale).T
    solved = np.linalg.lstsq(np.column_stack((x * x, x * y, y * y, x, y)), np.ones(len(x)), rcond=None)
    a, b, c, d, e = solved[0]
    matrix = np.array([[a, 0.5 * b], [0.5 * b, c]])
    if np.linalg.det(matrix) <= 1e-9:
        return None
    middle = np.linalg.solve(2.0 * matrix, [-d, -e])
    shape = matrix / (1.0 + middle @ matrix @ middle)
    values, ways = np.linalg.eigh(shape)
    if values[0] <= 0.0:
        return None
    axes = ways / np.sqrt(values)
    if np.linalg.det(axes) < 0.0:
        axes[:, 1] = -axes[:, 1]
    away = np.column_stack((x, y)) - middle
    radius = np.sqrt(np.einsum("ni,ij,nj->n", away, shape, away))
    length = scale * math.sqrt(abs(float(np.linalg.det(axes))))
    if np.abs(radius - 1.0).mean() * length > 0.2 * (1.0 + length / 25.0):
        return None
    return middle * scale + mean, axes * scale


def read_ring(
    image: Array, spec: Specification, ellipse: Placed, levels: tuple[float, float], sign: float
) -> Reading | Unread:
    """The code around a spot.

    Args:
        image: (height, width).
        spec: the set.
        ellipse: of the spot.
        levels: dark level around the spot and light level inside.
        sign: 1 where ink is light.
    """
    dark, light = levels
    contrast, middle = light - dark, 0.5 * (light + dark)
    begin, end, _, _ = spec.geometry.radii
    n, step = spec.bits, 2.0 * math.pi / spec.bits
    cell = max(LEAST_CELL, math.ceil(step * begin * ellipse.unit))
    turns = (np.arange(n * cell) + 0.5) * (step / cell)

    def ring(radii: FloatArray) -> FloatRows:
        places = np.stack([np.cos(turns), np.sin(turns)]) * radii[:, None, None]
        pixels = ellipse.centre[:, None] + np.einsum("ij,kjn->ikn", ellipse.matrix, places).reshape(2, -1)
        height, width = image.shape
        if pixels.min() < 1.0 or pixels[0].max() > width - 2 or pixels[1].max() > height - 2:
            return np.empty((0, 0))
        return sign * sampled(image, pixels[0], pixels[1]).reshape(len(radii), -1)

    outer = ring(np.array([end + 0.2]))
    if not outer.size:
        return Unread("inside the image", 0.0, 1.0)
    gap = float(np.mean(ring(np.array([0.5 * (1.0 + begin)])) > dark + LIGHT_IN_GAP * contrast))
    if gap > 0.06:
        return Unread("dark ring around the spot: share that is light", gap, 0.06)
    read = np.median(ring(begin + (end - begin) * np.linspace(0.25, 0.75, THREADS)), axis=0)
    phase, bits, uneven = _phase(read, n, cell)
    if uneven > UNEVEN:
        return Unread("ring cut into bits: scatter within them", uneven, UNEVEN)
    margins = (bits - middle) / (0.5 * contrast)
    least = float(np.abs(margins).min())
    if least < MARGIN:
        return Unread("bits: least distance from the middle", least, MARGIN)
    return _named(spec, ellipse, margins, phase * step / cell)


def _phase(read: FloatArray, n: int, cell: int) -> tuple[int, FloatArray, float]:
    """Where the first bit begins, the level of each, and the scatter within bits over that of all."""
    skip = max(1, cell // 5)
    best = None
    for phase in range(cell):
        parts = np.roll(read, -phase).reshape(n, cell)[:, skip : cell - skip]
        scatter = float(parts.std(axis=1).mean())
        if best is None or scatter < best[2]:
            best = phase, parts.mean(axis=1), scatter
    assert best is not None
    whole = float(read.std())
    return best[0], best[1], best[2] / whole if whole > 0.0 else math.inf


def _named(spec: Specification, ellipse: Placed, margins: FloatArray, begin: float) -> Reading | Unread:
    """The target whose code the bits are; `begin` is the angle at which the first of them begins."""
    grows, step = spec.geometry.grows, 2.0 * math.pi / spec.bits
    ordered = margins if grows else margins[::-1]
    code = code_of(ordered > 0.0, spec)
    if code not in spec.turns:
        return Unread("code of the set", float(code), math.nan)
    name, places = spec.turns[code][0]
    turn = begin + (-places if grows else places) * step - spec.geometry.angle
    c, s = math.cos(turn), math.sin(turn)
    return Reading(ellipse.turned(np.array([[c, -s], [s, c]])), name, spec.codes[name], ordered)


def code_of(is_inked: BoolArray, spec: Specification) -> int:
    """The code of bits, of which it is known where ink is."""
    code = sum(1 << k for k, has_ink in enumerate(is_inked.tolist()) if has_ink)
    return code if spec.geometry.zero_is_sheet else code ^ ((1 << spec.bits) - 1)
