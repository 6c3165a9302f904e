"""From a chequered disc to a target: how the drawing lies in the image, and the bits around the disc."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from obseq.arrays import Array, FloatArray, FloatCubes, FloatRows
from obseq.targets.codes import counted
from obseq.targets.drawing.drawings import figure_of, row_box
from obseq.targets.drawing.painting import smooth_table
from obseq.targets.drawing.rendering import blur_layers, layers, normal_equations
from obseq.targets.finding.candidates import gaussian
from obseq.targets.finding.figures import INTERPOLATED
from obseq.targets.finding.fits import Fit, Placed
from obseq.targets.finding.levels import Level, sampled
from obseq.targets.finding.measuring import FOREIGN, outer_places, region_of
from obseq.targets.finding.rings import Reading, Unread, code_of
from obseq.targets.specification import Specification, are_set

ACROSS = 12
"""Pixels of a unit that are enough to read bits: more are put together."""
QUARTERS = np.array([0.25, 0.5, 0.75])
"""Of the sides of a bit: where it is looked at."""
WRONG_BITS = "code of the set: bits that differ"
CROWDED = 0.5
"""Share of all patterns, one bit from a code, above which a mended name says less than chance."""
TINY = 1e-9
EITHER = 0.5
"""What a bit is before it is read, and its sigma: it has ink, or has none."""
ODD = 0.3
"""Contrasts by which a part of the target (a quadrant, a bit) may differ from the drawing. A bit that differs
by as much from both of its values cannot be read. Seen roughly, bits differ by as much in the mean square."""
UNCLEAR = EITHER - ODD
"""Of the ink: a bit no farther from the middle may be either."""
ANY_NAME = 0.3
"""Share of all patterns of clear bits that targets have, above which anything has a name, seen roughly: of
sets of 36 or 64 codes, ten or twelve bits may be unclear but for eight (bench)."""
BLURS = np.geomspace(0.03, 0.6, 14)
"""Sigmas of the point spreads with which bits are drawn, units: one of them is right but for an eighth."""
CELLS = 16
"""Of a unit of these drawings."""


def chequered_discs(
    level: Level, bits: RoughBits, discs: FloatRows, sign: float
) -> list[tuple[Placed, Unread | None]]:
    """How the drawings lie in the image whose discs these may be, and why they are none, as seen roughly.

    Discs of which it would be a mirror image are left out.

    Args:
        level: where the discs were found.
        bits: of the set.
        discs: (n, 11) as `find_discs` gives them.
        sign: 1, or -1 for light and dark exchanged.
    """
    matrices = _affinities(bits.spec, discs)
    matrices, discs = (part[np.linalg.det(matrices) > 0.0] for part in (matrices, discs))
    wrong, clear, off = bits.read(level, discs, matrices, sign)
    places = level.in_image(discs[:, :2])
    return [
        (
            Placed(
                places[k],
                level.scale * matrices[k],
                np.zeros(2),
                level.scale * discs[k, 10],
                np.zeros(2),
            ),
            bits.unread(int(wrong[k]), int(clear[k]), float(off[k])),
        )
        for k in range(len(discs))
    ]


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


class RoughBits:
    """What the bits of a set look like around a disc, as they are seen before anything is fitted.

    Args:
        spec: the set.
    """

    def __init__(self, spec: Specification) -> None:
        self.spec, self.places = spec, _bit_places(spec).reshape(-1, 2)
        self._drawn: dict[int, tuple[FloatArray, FloatRows, FloatRows]] = {}

    def unread(self, wrong: int, clear: int, off: float) -> Unread | None:
        """Why bits are those of no target, if so.

        Args:
            wrong: clear bits that the nearest target has otherwise.
            clear: the word of the bits that are clear.
            off: root mean square of how much pixels differ from what is drawn there, in contrasts.
        """
        spec = self.spec
        if wrong > mended(spec):
            return Unread(WRONG_BITS, wrong, mended(spec))
        if off > ODD:
            return Unread("bits: mean difference from the drawing", off, ODD)
        chance = spec.chance(are_set(clear, spec.bits))
        return Unread("clear bits: chance of a name", chance, ANY_NAME) if chance > ANY_NAME else None

    def read(self, level: Level, discs: FloatRows, matrices: FloatCubes, sign: float) -> FloatRows:
        """(3, n) number of wrong bits, word of clear bits, how far pixels are off (`unread` takes them).

        Where half a turn changes the bits, they are those of the way in which they fit a target better.
        """
        blurs = discs[:, 10] / np.sqrt(np.linalg.det(matrices))
        kinds = np.abs(np.log(blurs[:, None] / BLURS)).argmin(axis=1)
        light, contrast = discs[:, 4, None], discs[:, 4, None] - discs[:, 3, None]
        noise = INTERPOLATED * (level.noise / contrast[:, 0]) ** 2
        ways = (1.0,) if self.spec.frequency % 2 == 0 else (1.0, -1.0)
        found = np.empty((len(ways), 3, len(discs)))
        for way, rows in zip(ways, found, strict=True):
            pixels = discs[:, None, :2] + way * np.einsum("nij,kj->nki", matrices, self.places)
            ink = (light - sign * sampled(level.image, pixels[..., 0], pixels[..., 1])) / contrast
            for kind in np.unique(kinds).tolist():
                mine = kinds == kind
                rows[:, mine] = self._compared(ink[mine], noise[mine], kind)
        better = (found[:, 0] + np.minimum(found[:, 2], EITHER)).argmin(axis=0)
        best: FloatRows = found[better, :, np.arange(len(discs))].T
        return best

    def _compared(self, seen: FloatRows, noise: FloatArray, kind: int) -> FloatRows:
        """(3, n) the same of the ink that is seen (n, places); noise is the variance of a pixel."""
        spec, words = self.spec, 1 << np.arange(self.spec.bits)
        figure, bits, inverse = self._blurred(kind)
        ink = EITHER + (seen - figure - EITHER * bits.sum(axis=0)) @ inverse
        has_ink = ink > EITHER
        codes = (has_ink == spec.geometry.zero_is_sheet) @ words
        clear = (abs(ink - EITHER) > UNCLEAR) @ words
        known = np.array(list(spec.turns), dtype=np.int64)
        wrong = counted((codes[:, None] ^ known) & clear[:, None]).min(axis=1)
        square = np.mean((seen - figure - has_ink @ bits) ** 2, axis=1)
        return np.stack((wrong, clear, np.sqrt(np.maximum(square - noise, 0.0))))

    def _blurred(self, kind: int) -> tuple[FloatArray, FloatRows, FloatRows]:
        """(places,) ink of the figure, (bits, places) that of each bit, and what gives bits from places."""
        if kind not in self._drawn:
            from scipy.ndimage import gaussian_filter, map_coordinates

            left, right, top, bottom = self.spec.geometry.sheet
            width, height = (math.ceil(CELLS * span) for span in (right - left, bottom - top))
            grid = np.array([-CELLS * left, -CELLS * top, CELLS])
            table = np.empty((height, width))
            where = [grid[k] + CELLS * self.places[:, k] for k in (1, 0)]
            drawn = []
            for code in [0, *(1 << bit for bit in range(self.spec.bits))]:
                smooth_table(figure_of(self.spec), self.spec.bits, code, grid, table)
                blurred = gaussian_filter(table, CELLS * BLURS[kind])
                drawn.append(map_coordinates(blurred, where, order=1))
            bits = np.array(drawn[1:]) - drawn[0]
            normal = bits @ bits.T + (ODD / EITHER) ** 2 * np.eye(len(bits))
            self._drawn[kind] = drawn[0], bits, bits.T @ np.linalg.inv(normal)
        return self._drawn[kind]


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
