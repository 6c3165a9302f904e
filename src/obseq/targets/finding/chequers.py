"""From a chequered disc to a target: how the drawing lies in the image, and the bits around the disc."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq.targets.drawing.drawings import figure_of
from obseq.targets.drawing.rendering import layers
from obseq.targets.finding.fits import Placed
from obseq.targets.finding.measuring import FOREIGN, outer_places, region_of
from obseq.targets.finding.rings import Reading, Unread, code_of

if TYPE_CHECKING:
    from obseq.arrays import Array, FloatArray, FloatRows
    from obseq.targets.finding.fits import Fit
    from obseq.targets.finding.levels import Level
    from obseq.targets.specification import Specification

ACROSS = 12
"""Pixels of a unit that are enough to read bits: more are put together."""
TINY = 1e-9
EITHER = 0.5
"""What a bit is before it is read, and its sigma: it has ink, or has none."""


def chequered_disc(level: Level, spec: Specification, disc: FloatArray) -> Placed | None:
    """How the drawing of a set lies in the image where a disc is; None where it would be a mirror image.

    Args:
        level: where the disc was found.
        spec: the set.
        disc: (10,) as `find_discs` gives it.
    """
    shape = np.array([[disc[7], disc[8]], [disc[8], disc[9]]])
    matrix = _affinity(spec, shape, float(disc[5]), float(disc[5] + disc[6]))
    if matrix is None:
        return None
    return Placed(level.in_image(disc[:2]), level.scale * matrix, np.zeros(2), 1.0, np.zeros(2))


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


def read_bits(image: Array, spec: Specification, fit: Fit) -> list[Reading] | Unread:
    """What the bits around a chequered disc may say.

    A disc is the same after half a turn. Where codes are not, bits are read both ways. A wrong bit is mended
    where no other code is as near.

    Args:
        image: (height, width).
        spec: the set.
        fit: of the disc.
    """
    ways = [fit.placed] if spec.frequency % 2 == 0 else [fit.placed, fit.placed.turned(-np.eye(2))]
    found: list[Reading] = []
    for placed in ways:
        ink = bit_ink(image, spec, placed, fit)
        if ink is None:
            return Unread("inside the image", 0.0, 1.0)
        margins = 2.0 * (ink.bits - EITHER)
        code = code_of(margins > 0.0, spec)
        mended = min(1, (spec.class_distance - 1) // 2)
        nearest = min(spec.turns, key=lambda known: (known ^ code).bit_count())
        corrected = (nearest ^ code).bit_count()
        if corrected <= mended:
            found += _turned(spec, placed, nearest, margins, corrected)
    return found or Unread("code of the set: bits that differ", corrected, mended)


class Ink(NamedTuple):
    """How much ink each bit has, (bits,), 0 to 1; and the share of the sheet that shows something else."""

    bits: FloatArray
    foreign: float


def bit_ink(image: Array, spec: Specification, placed: Placed, fit: Fit) -> Ink | None:
    """How much ink each bit has, by least squares; None where they leave the image.

    Unknown are the light with its slopes, the ink of the central figure, that of each bit, and what is beyond
    each edge of the sheet. So bits that are smaller than the blur are told from their neighbours.

    Args:
        image: (height, width).
        spec: the set.
        placed: where the drawing lies.
        fit: of the disc: about its contrast and noise.
    """
    region = region_of(spec, replace(placed, sigma=0.0), whole=True)
    pixels = placed.pixels(outer_places(region))
    low, high = np.floor(pixels.min(axis=0)).astype(int), np.ceil(pixels.max(axis=0)).astype(int)
    height, width = image.shape
    if (low < 0).any() or high[0] >= width or high[1] >= height:
        return None
    step = max(1, int(placed.unit) // ACROSS)
    columns, lines = (high - low + step) // step
    window = image[low[1] : low[1] + step * lines, low[0] : low[0] + step * columns]
    lines, columns = len(window) // step, window.shape[1] // step
    window = window[: step * lines, : step * columns].reshape(lines, step, columns, step)
    grey = window.mean(axis=(1, 3), dtype=np.float64)
    sigma, bits = placed.sigma / step, spec.bits
    k = math.ceil(3.0 * sigma)
    place = np.concatenate(
        [
            (placed.centre - low - 0.5 * (step - 1)) / step + k,
            placed.matrix.ravel() / step,
            placed.perspective,
            placed.bend * step,
        ]
    )
    sharp = np.empty((bits + 6, lines + 2 * k, columns + 2 * k))
    layers(figure_of(spec), bits, region, place, 3, sharp)
    parts = _blur(lines, k, sigma) @ sharp[:-1] @ _blur(columns, k, sigma).T
    inside = sharp[-1, k : k + lines, k : k + columns] > 0.0
    y, x = np.nonzero(inside)
    design = np.column_stack((np.ones(len(x)), x - x.mean(), y - y.mean(), parts[:, inside].T))
    prior = np.r_[np.zeros(3), np.full(bits + 5, EITHER * fit.gain)]
    certain = np.r_[np.full(3, TINY), np.full(bits + 5, (fit.sigma0 / (EITHER * fit.gain)) ** 2)]
    normal = design.T @ design + np.diag(certain)
    solved = prior + np.linalg.solve(normal, design.T @ (grey[inside] - design @ prior))
    ink: FloatArray = solved[3 : 3 + bits] / solved[3 + bits]
    drawn = np.r_[solved[:3], (ink > EITHER) * solved[3 + bits], solved[3 + bits :]]
    off = np.abs(grey[inside] - design @ drawn)
    return Ink(ink, float(np.mean(off > FOREIGN * abs(fit.gain))))


def _blur(count: int, k: int, sigma: float) -> FloatRows:
    """(count, count + 2 k) the weights with which a point spread adds up samples."""
    away = np.arange(count + 2 * k) - k - np.arange(count)[:, None]
    weights = np.exp(-0.5 * (away / sigma) ** 2) * (np.abs(away) <= k)
    found: FloatRows = weights / weights.sum(axis=1, keepdims=True)
    return found


def _turned(
    spec: Specification, placed: Placed, code: int, margins: FloatArray, corrected: int
) -> list[Reading]:
    """The target of a code, turned as the code is: in several ways where it is its own rotation."""
    found = []
    for name, places in spec.turns.get(code, []):
        turn = (-1.0 if spec.geometry.grows else 1.0) * 2.0 * math.pi * places / spec.bits
        c, s = math.cos(turn), math.sin(turn)
        place = placed.turned(np.array([[c, -s], [s, c]]))
        found.append(Reading(place, name, spec.codes[name], margins, corrected))
    return found
