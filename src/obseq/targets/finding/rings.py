"""From the ellipse of a light spot to a ring target: the bits of the ring around it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.targets.finding.fits import Placed
from obseq.targets.finding.spot_edges import (
    CONIC,
    FIRST_BIT,
    PHASE,
    RAYS,
    SCATTER,
    THREADS,
    edge_ellipses,
    light_share,
    ring_bits,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import Array, BoolArray, FloatArray, FloatRows, IntArray
    from obseq.targets.specification import Specification

LEAST_CELL = 6
"""Places read in a bit, at least."""
LIGHT_IN_GAP, MOST_IN_GAP = 0.45, 0.06
"""Share of the contrast from which on a place of the dark ring around the spot is light, and share of places
that may be."""
OUTSIDE = 0.2
"""Of the half axes: the image goes on beyond the ring as far."""
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


def read_rings(
    image: Array, specs: Sequence[Specification], spot: FloatArray, sign: float, is_reduced: bool
) -> tuple[Placed, list[Reading | Unread]]:
    """The ellipse of a spot in the image, and the code of each set around it.

    Args:
        image: (height, width).
        specs: the sets.
        spot: (8,) as `find_spots` gives it, in pixels of the image.
        sign: 1 where ink is light.
        is_reduced: whether it was found in a reduced image: its edge is looked for again then.
    """
    reach = OUTSIDE + max(spec.geometry.radii[1] for spec in specs)
    window, corner = _window(image, spot, reach)
    inside = spot.copy()
    inside[:2] -= corner
    if is_reduced:
        finer = inside[None].copy()
        edge_ellipses(window, sign, np.empty((CONIC + 2, RAYS)), finer)
        inside = inside if math.isnan(finer[0, 0]) else finer[0]
    spot = inside.copy()
    spot[:2] += corner
    placed = Placed(spot[:2], spot[2:6].reshape(2, 2).T, np.zeros(2), 1.0, np.zeros(2))
    found: list[Reading | Unread] = []
    for spec in specs:
        is_whole = _is_inside(image, spot, spec.geometry.radii[1] + OUTSIDE)
        unread = Unread("inside the image", 0.0, 1.0)
        found.append(_read_ring(window, spec, placed, inside, sign) if is_whole else unread)
    return placed, found


def _around(spot: FloatArray, reach: float) -> tuple[FloatArray, FloatArray]:
    """The corners of the box around an ellipse, so many times as large."""
    half = reach * np.hypot(spot[2:4], spot[4:6])
    return spot[:2] - half, spot[:2] + half


def _is_inside(image: Array, spot: FloatArray, reach: float) -> bool:
    low, high = _around(spot, reach)
    height, width = image.shape
    return bool((low >= 1.0).all() and high[0] <= width - 2 and high[1] <= height - 2)


def _window(image: Array, spot: FloatArray, reach: float) -> tuple[FloatRows, IntArray]:
    """The part of an image where an ellipse lies, so many times as large, and its first column and line."""
    low, high = _around(spot, reach)
    first, last = np.maximum(low.astype(np.int64) - 2, 0), np.maximum(high.astype(np.int64) + 3, 2)
    part = image[first[1] : last[1], first[0] : last[0]]
    return part.astype(np.float64, order="C"), first


def _read_ring(
    window: FloatRows, spec: Specification, placed: Placed, spot: FloatArray, sign: float
) -> Reading | Unread:
    """The code around a spot in a window."""
    dark, light = spot[6:].tolist()
    contrast, middle = light - dark, 0.5 * (light + dark)
    begin, end, _, _ = spec.geometry.radii
    step = 2.0 * math.pi / spec.bits
    cell = max(LEAST_CELL, math.ceil(step * begin * placed.unit))
    places = spec.bits * cell
    gap = light_share(window, sign, spot, 0.5 * (1.0 + begin), places, dark + LIGHT_IN_GAP * contrast)
    if gap > MOST_IN_GAP:
        return Unread("dark ring around the spot: share that is light", gap, MOST_IN_GAP)
    read = np.empty(FIRST_BIT + spec.bits)
    ring_bits(window, sign, spot, begin, end, cell, np.empty(places + THREADS), read)
    if read[SCATTER] > UNEVEN:
        return Unread("ring cut into bits: scatter within them", float(read[SCATTER]), UNEVEN)
    margins = (read[FIRST_BIT:] - middle) / (0.5 * contrast)
    least = float(np.abs(margins).min())
    if least < MARGIN:
        return Unread("bits: least distance from the middle", least, MARGIN)
    return _named(spec, placed, margins, float(read[PHASE]) * step / cell)


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
