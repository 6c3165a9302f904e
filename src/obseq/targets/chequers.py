"""From a chequered disc to a target: how the drawing lies in the image, and the bits around the disc."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.targets.fits import Placed
from obseq.targets.levels import sampled
from obseq.targets.rings import Reading, Unread, code_of

if TYPE_CHECKING:
    from obseq.arrays import Array, FloatArray, FloatRows
    from obseq.targets.fits import Fit
    from obseq.targets.levels import Level
    from obseq.targets.specification import Specification

MIDDLE = (0.2, 0.8)
"""Share of the contrast between which the threshold of bits is looked for."""
LEAST_GAP = 0.25
"""Least gap between dark and light bits, in contrasts."""


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


def read_bits(image: Array, spec: Specification, places: FloatRows, fit: Fit) -> list[Reading] | Unread:
    """What the bits around a chequered disc may say, the likeliest first.

    A disc is the same after half a turn. Where codes are not, bits are read both ways.

    Args:
        image: (height, width).
        spec: the set.
        places: (bits, k, 2) places of the drawing where each bit is read, units.
        fit: of the disc.
    """
    first = _read_once(image, spec, places, fit, fit.placed)
    if spec.frequency % 2 == 0:
        return first
    second = _read_once(image, spec, places, fit, fit.placed.turned(-np.eye(2)))
    if isinstance(first, Unread):
        return second
    return first if isinstance(second, Unread) else first + second


def _read_once(
    image: Array, spec: Specification, places: FloatRows, fit: Fit, placed: Placed
) -> list[Reading] | Unread:
    n, k, _ = places.shape
    pixels = placed.pixels(places.reshape(-1, 2))
    height, width = image.shape
    if pixels.min() < 0.5 or pixels[:, 0].max() > width - 1.5 or pixels[:, 1].max() > height - 1.5:
        return Unread("inside the image", 0.0, 1.0)
    grey = np.median(sampled(image, *pixels.T).reshape(n, k), axis=1)
    ink = (grey - fit.offset) / fit.gain
    threshold = _threshold(ink)
    if isinstance(threshold, Unread):
        return threshold
    margins = 2.0 * (ink - threshold)
    code = code_of(margins > 0.0, spec)
    found = _turned(spec, placed, code, margins, 0)
    if not found and (spec.class_distance - 1) // 2 >= 1:
        for bit in np.argsort(np.abs(margins))[:2].tolist():
            found += _turned(spec, placed, code ^ (1 << bit), margins, 1)
    return found or Unread("code of the set", float(code), math.nan)


def _threshold(ink: FloatArray) -> float | Unread:
    """Where bits of ink are told from others: in the widest gap; half way where all are alike and clear."""
    ordered = np.sort(ink)
    gaps, between = np.diff(ordered), 0.5 * (ordered[1:] + ordered[:-1])
    inside = (between > MIDDLE[0]) & (between < MIDDLE[1])
    widest = int(np.argmax(np.where(inside, gaps, -1.0)))
    gap = float(gaps[widest]) if inside.any() else 0.0
    if gap >= LEAST_GAP:
        return float(between[widest])
    if np.abs(ink).max() < LEAST_GAP or np.abs(ink - 1.0).max() < LEAST_GAP:
        return 0.5
    return Unread("bits: gap between dark and light", gap, LEAST_GAP)


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
