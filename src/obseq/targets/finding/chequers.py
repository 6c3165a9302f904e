"""From a chequered disc to a target: how the drawing lies in the image, and the bits around the disc."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq.targets.codes import counted
from obseq.targets.drawing.drawings import figure_of, row_box
from obseq.targets.drawing.rendering import blur_layers, layers, normal_equations
from obseq.targets.finding.candidates import gaussian
from obseq.targets.finding.fits import Placed
from obseq.targets.finding.levels import sampled
from obseq.targets.finding.measuring import FOREIGN, outer_places, region_of
from obseq.targets.finding.rings import Reading, Unread, code_of

if TYPE_CHECKING:
    from obseq.arrays import Array, FloatArray, FloatCubes, FloatRows, IntArray
    from obseq.targets.finding.fits import Fit
    from obseq.targets.finding.levels import Level
    from obseq.targets.specification import Specification

ACROSS = 12
"""Pixels of a unit that are enough to read bits: more are put together."""
QUARTERS = np.array([0.25, 0.5, 0.75])
"""Of the sides of a bit: where it is looked at."""
WRONG_BITS = "code of the set: bits that differ"
CROWDED = 0.5
"""Share of all patterns, one bit from a code, above which a mended name says less than chance."""
TINY = 1e-9
UNCLEAR = 0.2
"""Of the ink: a bit no farther from the middle may be either, as `finder.ODD` has it."""
EITHER = 0.5
"""What a bit is before it is read, and its sigma: it has ink, or has none."""


class Rough(NamedTuple):
    """Targets as they are seen before anything is fitted to the image.

    Attributes:
        places: (n,) how the drawing lies in the image.
        wrong: (n,) bits that differ from those of the nearest target.
        off: (n,) root mean square of how much the bits differ from what is drawn there, in contrasts.
    """

    places: list[Placed]
    wrong: IntArray
    off: FloatArray


def chequered_discs(level: Level, spec: Specification, discs: FloatRows, sign: float) -> Rough:
    """The targets of a set whose discs these may be.

    Discs of which it would be a mirror image are left out.

    Args:
        level: where the discs were found.
        spec: the set.
        discs: (n, 11) as `find_discs` gives them.
        sign: 1, or -1 for light and dark exchanged.
    """
    matrices = _affinities(spec, discs)
    matrices, discs = (part[np.linalg.det(matrices) > 0.0] for part in (matrices, discs))
    places = [
        Placed(place, level.scale * matrix, np.zeros(2), level.scale * sigma, np.zeros(2))
        for place, matrix, sigma in zip(level.in_image(discs[:, :2]), matrices, discs[:, 10], strict=True)
    ]
    return Rough(places, *_rough_bits(level.image, spec, discs, matrices, sign))


def _affinities(spec: Specification, discs: FloatRows) -> FloatCubes:
    """(n, 2, 2) the maps of the drawing whose quadrants and discs are these.

    In the drawing, light turns dark a quarter of a turn after the angle of the chequers, and dark light half
    a turn after it.
    """
    turns = discs[:, 5:6] + discs[:, 6:7] * [0.0, 1.0]
    x, y = np.cos(turns), np.sin(turns)
    lengths = 1.0 / np.sqrt(discs[:, 7:8] * x * x + 2.0 * discs[:, 8:9] * x * y + discs[:, 9:10] * y * y)
    angles = spec.geometry.angle + np.array([0.5, 1.0]) * math.pi
    drawn = np.stack([np.cos(angles), np.sin(angles)])
    found: FloatCubes = np.stack((x * lengths, y * lengths), axis=1) @ np.linalg.inv(drawn)
    return found


def _rough_bits(
    image: Array, spec: Specification, discs: FloatRows, matrices: FloatCubes, sign: float
) -> tuple[IntArray, FloatArray]:
    """(n,) in how many clear bits the nearest target has other grey levels, and by how much they are off.

    Ink is as dark as in the disc where a bit is wider than the point spread; else it is paler by as much.
    """
    places = _bit_places(spec)
    width = 2.0 * np.linalg.norm(places[:, 2] - places[:, 0], axis=1).min()
    widths = width * np.sqrt(np.linalg.det(matrices)) / (2.0 * math.sqrt(2.0) * discs[:, 10])
    full = np.array([math.erf(one) for one in widths.tolist()])
    light, contrast = discs[:, 4], (discs[:, 4] - discs[:, 3]) * full
    known = np.array(list(spec.turns), dtype=np.int64)
    found, least = np.full(len(discs), spec.bits), np.full(len(discs), math.inf)
    for way in (1.0,) if spec.frequency % 2 == 0 else (1.0, -1.0):
        pixels = discs[:, None, None, :2] + np.einsum("nij,bkj->nbki", way * matrices, places)
        grey = sign * sampled(image, pixels[..., 0], pixels[..., 1]).mean(axis=2)
        ink = (light[:, None] - grey) / contrast[:, None]
        has_ink = ink > EITHER
        codes = (has_ink == spec.geometry.zero_is_sheet) @ (1 << np.arange(spec.bits))
        is_clear = (abs(ink - EITHER) > UNCLEAR) @ (1 << np.arange(spec.bits))
        wrong = counted((codes[:, None] ^ known) & is_clear[:, None]).min(axis=1)
        off = np.sqrt(np.mean((ink - has_ink) ** 2, axis=1))
        is_better = (wrong < found) | ((wrong == found) & (off < least))
        found, least = np.where(is_better, wrong, found), np.where(is_better, off, least)
    return found, least


def _bit_places(spec: Specification) -> FloatCubes:
    """(bits, 9, 2) places well inside of each bit, units."""
    bits = np.arange(spec.bits)
    if spec.geometry.in_rows:
        left, top, right, bottom = np.array([row_box(spec, bit) for bit in bits.tolist()]).T[:, :, None]
        x, y = left + (right - left) * QUARTERS, top + (bottom - top) * QUARTERS
        return np.stack(np.broadcast_arrays(x[:, :, None], y[:, None, :]), axis=-1).reshape(spec.bits, -1, 2)
    begin, end, _, _ = spec.geometry.radii
    sense = 1.0 if spec.geometry.grows else -1.0
    turns = spec.geometry.angle + sense * 2.0 * math.pi / spec.bits * (bits[:, None] + QUARTERS)
    radii = begin + (end - begin) * QUARTERS
    x, y = (np.multiply.outer(part, radii) for part in (np.cos(turns), np.sin(turns)))
    return np.stack((x, y), axis=-1).reshape(spec.bits, -1, 2)


def mended(spec: Specification) -> int:
    """Wrong bits of a code that are mended at most: no other code is as near then.

    None where most patterns are a code but for one bit, as with Hamming codes: any figure would have a name.
    """
    is_crowded = len(spec.turns) * (spec.bits + 1) > CROWDED * (1 << spec.bits)
    return 0 if is_crowded else min(1, (spec.class_distance - 1) // 2)


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
        nearest = min(spec.turns, key=lambda known: (known ^ code).bit_count())
        corrected = (nearest ^ code).bit_count()
        if corrected <= mended(spec):
            found += _turned(spec, placed, nearest, margins, corrected)
    return found or Unread(WRONG_BITS, corrected, mended(spec))


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
    parts = np.empty((bits + 5, lines, columns))
    blur_layers(sharp[:-1], gaussian(sigma), np.empty((lines + 2 * k, columns)), parts)
    inside = sharp[-1, k : k + lines, k : k + columns] > 0.0
    y, x = np.nonzero(inside)
    design = np.column_stack((np.ones(len(x)), x - x.mean(), y - y.mean(), parts[:, inside].T))
    prior = np.r_[np.zeros(3), np.full(bits + 5, EITHER * fit.gain)]
    certain = np.r_[np.full(3, TINY), np.full(bits + 5, (fit.sigma0 / (EITHER * fit.gain)) ** 2)]
    normal, sums = np.empty((bits + 8, bits + 8)), np.empty(bits + 8)
    normal_equations(design, grey[inside], normal, sums)
    solved = prior + np.linalg.solve(normal + np.diag(certain), sums - normal @ prior)
    ink: FloatArray = solved[3 : 3 + bits] / solved[3 + bits]
    drawn = np.r_[solved[:3], (ink > EITHER) * solved[3 + bits], solved[3 + bits :]]
    off = np.abs(grey[inside] - np.einsum("nk,k->n", design, drawn))
    return Ink(ink, float(np.mean(off > FOREIGN * abs(fit.gain))))


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
