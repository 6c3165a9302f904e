"""The last step, the same for all families: least squares of the drawing against the image.

Unknown are the place of the centre, the affinity and the perspective around it, the point spread, the bend of
a distortion, and the light with its slopes: 17 unknowns of `DeformImHomography`. The covariance of the centre
is that of the fit.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from obseq.arrays import Array, FloatArray, FloatRows, IntArray
from obseq.kernels.calculator import calculator
from obseq.targets.drawing.drawings import figure_of, inked_bits
from obseq.targets.drawing.legend import CELL, dot_size
from obseq.targets.drawing.painting import smooth_table
from obseq.targets.drawing.rendering import Region, lattice, normal_equations, observe, render, spread
from obseq.targets.finding.fits import Fit, Placed, in_squares
from obseq.targets.specification import Specification

FORMULA = "DeformImHomography"
GAIN, OFFSET, SLOPES, BLUR, MATRIX, PERSPECTIVE, BEND, CENTRE = (
    0,
    1,
    slice(2, 6),
    6,
    slice(7, 11),
    slice(11, 13),
    slice(13, 15),
    slice(15, 17),
)
"""Where the unknowns of the formula stand."""
REACH = 2.5
"""Pixels nearer to something unknown than so many sigmas of the point spread do not count: 99 % of it."""
SHARPEST, DULLEST = 0.3, 8.0
"""Sigmas of point spreads, pixels: a smaller one is not seen beside the width of a pixel."""
MOST_STEPS = 15
ARRIVED = 1e-3
"""Pixels by which the last step may move the centre: a tenth of the best precision."""
LONGEST_STEP = 1.0
"""Pixels by which one step may move the centre: beyond, the drawing and its image do not overlap."""
FEWEST = 40
"""Pixels of the smallest fit: twice its unknowns, and some."""
LATTICES = tuple(lattice(*sizes) for sizes in ((13, 8), (8, 5)))
"""Places in a pixel where the drawing is looked at, for small and for large targets."""
SURE = 4.0
"""Standard deviations that no noise exceeds in the pixels of a target."""
MEDIAN_SIGMA = 1.4826
"""Standard deviation of a normal distribution, over the median of its absolute values."""
FOREIGN = 0.3
"""Contrasts by which a pixel that shows something else differs at least: drawings, reflections, dirt."""
FORGIVEN = 0.125
"""Share of pixels that may: of sheets hidden by a fifth and more, none has a wrong name for it (bench)."""
BEND_PRIOR = 0.1
"""Sigma of the bend, over the focal length: a distortion k of 0.2 at half a focal length from the middle."""
MATRIX_PRIOR = 0.3
"""Sigma of the affinity about its first value, in units: nothing else says how a disc is turned."""
SLOPE_PRIOR = 0.5
"""Sigma of the change of the light over a unit, of the contrast: half shadows are rare."""


class Drawings:
    """Drawings of targets as tables, each made once.

    Args:
        spec: the set.
    """

    def __init__(self, spec: Specification) -> None:
        self.spec = spec
        self._figure = figure_of(spec)
        self._tables: dict[tuple[int, int], tuple[FloatRows, FloatArray]] = {}

    def table(self, code: int, cells: int) -> tuple[FloatRows, FloatArray]:
        """Shares of ink, and where the middle is; `cells` in a unit. A code of -1 has the figure alone."""
        if (code, cells) not in self._tables:
            left, right, top, bottom = self.spec.geometry.sheet
            if not self.spec.geometry.in_rows or code < 0:
                end = self.spec.geometry.radii[1]
                left, right, top, bottom = -end, end, -end, end
            grid = np.array([math.ceil(-left * cells) + 1.5, math.ceil(-top * cells) + 1.5, cells])
            width = 2 * math.ceil(right * cells) + 4
            height = math.ceil(-top * cells) + math.ceil(bottom * cells) + 4
            out = np.empty((height, width))
            ink = 0 if code < 0 else inked_bits(self.spec, code)
            smooth_table(self._figure, self.spec.bits, ink, grid, out)
            self._tables[code, cells] = out, grid
        return self._tables[code, cells]


def region_of(spec: Specification, placed: Placed, whole: bool) -> Region:
    """Which places count: the sheet without its legend, less what its surroundings disturb.

    Args:
        spec: the set.
        placed: where the drawing lies.
        whole: with the code; else the figure alone.
    """
    geometry = spec.geometry
    begin, end, legend, half_width = geometry.radii
    blur = REACH * placed.sigma / placed.smallest
    _, _, top, bottom = geometry.sheet
    rows, radius = math.inf, min(end + blur, legend)
    if geometry.in_rows:
        radius = min(1.0 + blur, begin)
        rows = half_width if whole else math.inf
    elif not whole:
        radius = min(1.0 + blur, 0.5 * (1.0 + begin))
    width, height = legend_size(spec)
    return Region(
        radius,
        rows,
        geometry.at_top,
        max(half_width - blur, 0.7 * half_width),
        min(top + blur, -0.7 * half_width),
        max(bottom - blur, 0.7 * half_width),
        legend - width - blur,
        legend - height - blur,
        legend + blur,
    )


def legend_size(spec: Specification) -> tuple[float, float]:
    """Width and height of the legend in a corner, units."""
    letters = (spec.letters + 1) // 2
    dot = dot_size(letters, spec.geometry.radii[2])
    return CELL[0] * letters * dot, CELL[1] * dot


@cache
def _taps(sigma: float) -> FloatRows:
    """(3, 2 k + 1) weights of a Gaussian and of its two derivatives, exact on polynomials of degree 2."""
    reach = max(2, math.ceil(4.0 * sigma))
    x = np.arange(-reach, reach + 1.0)
    value = np.exp(-0.5 * (x / sigma) ** 2)
    value /= value.sum()
    first = x * value
    first /= (x * first).sum()
    second = (x * x - (x * x * value).sum()) * value
    second *= 2.0 / (x * x * second).sum()
    return np.stack([value, first, second])


def fit_drawing(
    image: Array,
    drawings: Drawings,
    code: int,
    start: Placed,
    *,
    focal: float,
    whole: bool = True,
    most_steps: int = MOST_STEPS,
) -> Fit | None:
    """Where a drawing lies in an image; None where it does not, or not inside.

    Args:
        image: (height, width) grey levels.
        drawings: of the set.
        code: of the target; -1 for none.
        start: first place, within some pixels.
        focal: of the camera, pixels, as far as it is known; the width of the image will do. It says how much
            perspective and distortion there may be: a unit covers no larger part of the view.
        whole: with the code; else the figure alone.
        most_steps: of the iteration.
    """
    return _Iteration(image, drawings, code, start, focal, whole).run(most_steps)


class _System(NamedTuple):
    """The linear equations of a step.

    Attributes:
        rows: (n, 9) observations of the formula.
        jacobian: (n, k).
        residuals: (n,).
        normal: (k, k) jacobian' jacobian.
        sums: (k,) jacobian' residuals.
    """

    rows: FloatRows
    jacobian: FloatRows
    residuals: FloatArray
    normal: FloatRows
    sums: FloatArray

    @property
    def square(self) -> float:
        """Sum of the squares of the residuals."""
        return float(np.square(self.residuals).sum())

    @property
    def variance(self) -> float:
        """Of a pixel, from the residuals."""
        n, k = self.jacobian.shape
        found: float = self.square / max(n - k, 1)
        return found


class _Iteration:
    """Gauss and Newton's steps from a start."""

    def __init__(
        self,
        image: Array,
        drawings: Drawings,
        code: int,
        start: Placed,
        focal: float,
        whole: bool,
    ) -> None:
        self.image, self.spec = image, drawings.spec
        self.whole, self.focal = whole, focal
        self.start = start
        cells = 1 << max(5, math.ceil(math.log2(max(1.5 * start.unit, 1.0))))
        self.table, self.grid = drawings.table(code, min(cells, 128))
        self.unknowns = np.zeros(17)
        self.unknowns[MATRIX] = start.matrix.ravel()
        self.unknowns[PERSPECTIVE] = start.perspective
        self.unknowns[BEND] = start.bend
        self.unknowns[CENTRE] = start.centre
        self.sigma = min(max(start.sigma, SHARPEST), DULLEST)
        self.calculator = calculator(FORMULA)
        self.forgiven = self.pixels = np.empty(0, dtype=np.int64)

    @property
    def placed(self) -> Placed:
        """The current place."""
        u = self.unknowns
        matrix = u[MATRIX].reshape(2, 2).copy()
        return Placed(u[CENTRE].copy(), matrix, u[PERSPECTIVE].copy(), self.sigma, u[BEND].copy())

    def run(self, most_steps: int) -> Fit | None:
        """The fit; anew where a few pixels show something else. None when the drawing leaves its place."""
        fit = self._arrived(most_steps)
        if fit is None or not len(foreign := self._foreign(fit)):
            return fit
        self.forgiven = foreign
        return self._arrived(most_steps) or fit

    def _foreign(self, fit: Fit) -> IntArray:
        """Pixels that show something else than the target, where they are few."""
        off = np.abs(fit.residuals)
        scale = MEDIAN_SIGMA * float(np.median(off))
        far = off > max(SURE * scale, FOREIGN)
        return self.pixels[far] if far.mean() <= FORGIVEN else self.pixels[:0]

    def _arrived(self, most_steps: int) -> Fit | None:
        region = region_of(self.spec, self.placed, self.whole)
        system: _System | None = None
        for step in range(most_steps):
            if step in (2, 4, 6):
                region = region_of(self.spec, self.placed, self.whole)
            if not self._set_window(region):
                return None
            system = self._linearised(region, first=step == 0)
            change = None if system is None else self._solved(system)
            if change is None:
                return None
            moved = math.hypot(*change[CENTRE])
            self._apply(change, moved)
            if not self._is_sound():
                return None
            if moved < ARRIVED and step > 1:
                break
        return None if system is None else self._fit(system)

    def _set_window(self, region: Region) -> bool:
        """Takes the part of the image where the drawing lies; False when it is not inside."""
        corners = outer_places(region)
        pixels = self.placed.pixels(corners)
        low, high = np.floor(pixels.min(axis=0)) - 1, np.ceil(pixels.max(axis=0)) + 1
        height, width = self.image.shape
        size = high - low
        if (low < 0).any() or high[0] >= width or high[1] >= height or (size < 5).any():
            return False
        if size[0] * size[1] > 4e6:
            return False
        (x0, y0), (x1, y1) = low.astype(int).tolist(), high.astype(int).tolist()
        self.corner = low
        self.window = self.image[y0 : y1 + 1, x0 : x1 + 1].astype(np.float64)
        return True

    def _linearised(self, region: Region, first: bool) -> _System | None:
        taps = _taps(round(self.sigma, 4))
        k = taps.shape[1] // 2
        height, width = self.window.shape
        sharp = np.empty((height + 2 * k, width + 2 * k))
        u = self.unknowns
        place = np.concatenate([u[CENTRE], u[MATRIX], u[PERSPECTIVE], u[BEND]])
        render(self.table, self.grid, place, self.corner - k, LATTICES[self.start.unit > 40], sharp)
        model = np.empty((4, height, width))
        spread(sharp, taps, np.empty((3, height + 2 * k, width)), model)
        rows = np.empty((height * width, 9))
        pixels = np.empty(height * width, dtype=np.int64)
        n = observe(region, place, self._light(), self.sigma, self.corner, self.window, model, pixels, rows)
        if n < FEWEST:
            return None
        rows = rows[:n]
        self.pixels = (rows[:, 1] * self.image.shape[1] + rows[:, 0]).astype(np.int64)
        if len(self.forgiven):
            ours = ~np.isin(self.pixels, self.forgiven)
            rows, self.pixels, n = rows[ours], self.pixels[ours], int(ours.sum())
        if first:
            self._set_light(rows)
            rows[:, 3:5] *= u[GAIN]
        values, jacobian = self.calculator.values_and_jacobian(np.tile(u, (n, 1)), rows)
        system = _System(rows, jacobian[:, 0], values[:, 0], np.empty((len(u), len(u))), np.empty(len(u)))
        normal_equations(*system[1:])
        return system

    def _light(self) -> FloatArray:
        u = self.unknowns
        gain = u[GAIN] or 1.0
        return np.array([gain, u[OFFSET], *u[SLOPES]])

    def _set_light(self, rows: FloatRows) -> None:
        """First values of gain and offset: a line through the grey levels."""
        value, grey = rows[:, 7], rows[:, 2]
        centred = value - value.mean()
        square = float(centred @ centred)
        gain = float(centred @ (grey - grey.mean())) / square if square > 0.0 else 0.0
        self.unknowns[GAIN] = gain or 1.0
        self.unknowns[OFFSET] = grey.mean() - gain * value.mean()

    def _solved(self, system: _System) -> FloatArray | None:
        """The step, and `inverse`, with what is known before: the perspective and the slopes are small."""
        k = len(system.normal)
        variance = max(system.variance, 1e-4)
        weights = np.zeros(k)
        weights[PERSPECTIVE] = variance / (self.start.unit / self.focal) ** 2
        weights[BEND] = variance * (self.focal / BEND_PRIOR) ** 2
        contrast = max(abs(self.unknowns[GAIN]), 1e-6)
        weights[SLOPES] = variance / (SLOPE_PRIOR * contrast) ** 2
        weights[MATRIX] = variance / (MATRIX_PRIOR * self.start.unit) ** 2
        away = self.unknowns.copy()
        away[MATRIX] -= self.start.matrix.ravel()
        right = system.sums + weights * away
        matrix = system.normal + np.diag(weights)
        scale = np.sqrt(np.diag(matrix))
        if not (scale > 0.0).all() or not np.isfinite(scale).all():
            return None
        try:
            inverse = np.linalg.inv(matrix / np.outer(scale, scale))
        except np.linalg.LinAlgError:
            return None
        self.inverse = inverse / np.outer(scale, scale)
        change: FloatArray = -(self.inverse @ right)
        return change

    def _apply(self, change: FloatArray, moved: float) -> None:
        share = min(1.0, LONGEST_STEP / moved) if moved > 0.0 else 1.0
        turn = np.abs(change[MATRIX]).max() / self.placed.smallest
        share = min(share, 0.2 / turn) if turn > 0.2 else share
        blur = self.sigma + share * change[BLUR]
        self.unknowns = self.unknowns + share * change
        self.sigma = min(max(blur, 0.7 * self.sigma, SHARPEST), 1.4 * self.sigma, DULLEST)
        self.unknowns[BLUR] = 0.0

    def _is_sound(self) -> bool:
        """Whether the drawing is still near its first place, and not degenerate."""
        placed = self.placed
        if not np.isfinite(self.unknowns).all():
            return False
        far = math.hypot(*(placed.centre - self.start.centre))
        ratio = placed.unit / self.start.unit
        return far < max(2.0, 0.3 * self.start.unit) and 0.6 < ratio < 1.7 and placed.smallest > 1.0

    def _fit(self, system: _System) -> Fit:
        variance, gain = system.variance, float(self.unknowns[GAIN])
        whole = len(system.rows) * float(np.var(system.rows[:, 2]))
        return Fit(
            self.placed,
            variance * self.inverse[BEND.start : CENTRE.stop, BEND.start : CENTRE.stop],
            math.sqrt(variance),
            1.0 - system.square / whole if whole > 0.0 else 0.0,
            gain,
            float(self.unknowns[OFFSET]),
            system.rows[:, 5:7].copy(),
            system.residuals / (abs(gain) or 1.0),
            self.forgiven,
            in_squares(system.jacobian, self.inverse, system.residuals, self.pixels, self.image.shape[1]),
        )


def outer_places(region: Region) -> FloatRows:
    """(k, 2) places around the drawing: the window holds them."""
    turns = np.arange(24) * (2.0 * math.pi / 24)
    radius = region.radius / math.cos(math.pi / 24)
    around = radius * np.column_stack((np.cos(turns), np.sin(turns)))
    if math.isinf(region.rows_begin):
        return around
    side, top, bottom = region.half_width, region.top, region.bottom
    return np.vstack((around, [[-side, top], [side, top], [side, bottom], [-side, bottom]]))
