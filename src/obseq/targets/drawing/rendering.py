"""The compiled loops of measuring: a drawing as an image shows it, its gradient, and the pixels that count.

A place `m` of the drawing (units) is seen at `t + p + |p|^2 c` (pixels) with `p = A m / (1 + g . m)`.
`place` is (10,): t, the rows of A, g, c; of c the first order is enough. Windows are parts of an image;
`corner` is (2,): the pixel of their first column and line.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from obseq.arrays import FloatArray, FloatCubes, FloatRows, IntArray
from obseq.compilation import compiled
from obseq.targets.drawing.painting import Figure, bit_of, ink_at

NEAREST = 0.1
"""Least depth of a place of the drawing, over that of its centre."""


class Region(NamedTuple):
    """Which places of a drawing count, in units.

    Attributes:
        radius: those of the figure and its ring, up to there.
        rows_begin: and those of rows, from there on; infinite without rows.
        rows_at_top: whether rows stand on one side only.
        half_width: of the sheet, less what is disturbed by its edges.
        top: upper edge of the sheet, likewise.
        bottom: lower edge.
        legend_x: the legend stands in the corners, beyond that and `legend_y` from the middle.
        legend_y: likewise; it ends at `rows_end`.
        rows_end: beyond, rows do not see the legend any more.
    """

    radius: float
    rows_begin: float
    rows_at_top: bool
    half_width: float
    top: float
    bottom: float
    legend_x: float
    legend_y: float
    rows_end: float


def lattice(count: int, generator: int) -> FloatRows:
    """(count, 2) places in a pixel, from its middle.

    Each has its own column and line, so that edges along those of the image are not seen in steps.
    """
    k = np.arange(count)
    return (np.column_stack((k, k * generator % count)) + 0.5) / count - 0.5


@compiled
def counts(region: Region, x: float, y: float) -> bool:
    """Whether a place of the drawing counts."""
    if abs(x) > region.half_width or y < region.top or y > region.bottom:
        return False
    if abs(x) > region.legend_x and region.legend_y < abs(y) < region.rows_end:
        return False
    if x * x + y * y <= region.radius * region.radius:
        return True
    return y >= region.rows_begin or (not region.rows_at_top and -y >= region.rows_begin)


@compiled
def _cell_at(table: FloatRows, u: float, v: float) -> float:
    """The share of ink between the cells of a table; 0 outside it."""
    i, j = math.floor(u), math.floor(v)
    if i < 0 or j < 0 or i + 1 >= table.shape[1] or j + 1 >= table.shape[0]:
        return 0.0
    u -= i
    v -= j
    upper = table[j, i] + u * (table[j, i + 1] - table[j, i])
    lower = table[j + 1, i] + u * (table[j + 1, i + 1] - table[j + 1, i])
    found: float = upper + v * (lower - upper)
    return found


@compiled
def drawn_at(place: FloatArray, x: float, y: float) -> tuple[float, float, float]:
    """Where in the drawing a pixel lies, and its depth over that of the centre: behind the camera below 0."""
    a, b, c, d = place[2], place[3], place[4], place[5]
    whole = a * d - b * c
    u, v = x - place[0], y - place[1]
    square = u * u + v * v
    p, q = u - square * place[8], v - square * place[9]
    x, y = (d * p - b * q) / whole, (a * q - c * p) / whole
    depth = 1.0 - place[6] * x - place[7] * y
    return x / depth, y / depth, depth


@compiled
def render(
    table: FloatRows,
    grid: FloatArray,
    place: FloatArray,
    corner: FloatArray,
    within: FloatRows,
    out: FloatRows,
) -> None:
    """The drawing as a camera without blur sees it: the mean over each pixel.

    Within a pixel the drawing is seen by an affinity: what is left out is less than a thousandth of a pixel.

    Args:
        table: shares of ink.
        grid: (3,) column and line of the middle of the figure in the table, and cells in a unit.
        place: (10,).
        corner: (2,) of the window.
        within: (samples, 2) places in a pixel, from its middle.
        out: (height, width) written.
    """
    samples, left, middle, top, cells = len(within), grid[0], corner[0], grid[1], grid[2]
    for j in range(out.shape[0]):
        line = corner[1] + j
        x, y, depth = drawn_at(place, middle, line)
        for i in range(out.shape[1]):
            along_x, along_y, next_depth = drawn_at(place, middle + i + 1.0, line)
            down_x, down_y, down_depth = drawn_at(place, middle + i, line + 1.0)
            total = 0.0
            if min(depth, next_depth, down_depth) > NEAREST:
                a, b, c, d = along_x - x, down_x - x, along_y - y, down_y - y
                for k in range(samples):
                    u, v = within[k, 0], within[k, 1]
                    total += _cell_at(
                        table, left + cells * (x + a * u + b * v), top + cells * (y + c * u + d * v)
                    )
            out[j, i] = total / samples
            x, y, depth = along_x, along_y, next_depth


@compiled
def spread(sharp: FloatRows, taps: FloatRows, lines: FloatCubes, out: FloatCubes) -> None:
    """A blurred image, its gradient, and its Laplacian.

    Args:
        sharp: (height + 2 k, width + 2 k) image without blur.
        taps: (3, 2 k + 1) weights of the point spread and of its two derivatives.
        lines: (3, height + 2 k, width) work space.
        out: (4, height, width) written: value, change along x, along y, Laplacian.
    """
    reach, width, height = taps.shape[1], out.shape[2], out.shape[1]
    for kind in range(3):
        for j in range(sharp.shape[0]):
            for i in range(width):
                lines[kind, j, i] = 0.0
            for k in range(reach):
                weight = taps[kind, k]
                for i in range(width):
                    lines[kind, j, i] += weight * sharp[j, i + k]
    for j in range(height):
        for i in range(width):
            out[0, j, i] = 0.0
            out[1, j, i] = 0.0
            out[2, j, i] = 0.0
            out[3, j, i] = 0.0
        for k in range(reach):
            value, first, second = taps[0, k], taps[1, k], taps[2, k]
            for i in range(width):
                out[0, j, i] += value * lines[0, j + k, i]
                out[1, j, i] += value * lines[1, j + k, i]
                out[2, j, i] += first * lines[0, j + k, i]
                out[3, j, i] += value * lines[2, j + k, i] + second * lines[0, j + k, i]


@compiled
def observe(
    region: Region,
    place: FloatArray,
    light: FloatArray,
    sigma: float,
    corner: FloatArray,
    window: FloatRows,
    model: FloatCubes,
    pixels: IntArray,
    out: FloatRows,
) -> int:
    """The observations of `DeformImHomography`, a row for each pixel that counts; returns their number.

    Args:
        region: which places count.
        place: (10,).
        light: (6,) gain, offset, and their slopes along x and y.
        sigma: blur of the model, pixels.
        corner: (2,) of the window.
        window: (height, width) grey levels.
        model: (4, height, width) as `spread` writes it.
        pixels: (most,) written: where in the window each row is.
        out: (most, 9) written.
    """
    n = 0
    for j in range(window.shape[0]):
        for i in range(window.shape[1]):
            x, y, depth = drawn_at(place, corner[0] + i, corner[1] + j)
            if depth < NEAREST or not counts(region, x, y):
                continue
            gain = light[0] + light[2] * x + light[3] * y
            pixels[n] = j * window.shape[1] + i
            out[n, 0], out[n, 1] = corner[0] + i, corner[1] + j
            out[n, 2] = window[j, i]
            out[n, 3], out[n, 4] = gain * model[1, j, i], gain * model[2, j, i]
            out[n, 5], out[n, 6] = x, y
            out[n, 7] = model[0, j, i]
            out[n, 8] = sigma * model[3, j, i]
            n += 1
    return n


@compiled
def layers(
    figure: Figure, bits: int, region: Region, place: FloatArray, samples: int, out: FloatCubes
) -> None:
    """The share of each pixel that each bit may ink, that the figure inks, and that is beyond the sheet.

    Args:
        figure: the target.
        bits: of its code.
        region: which places count; it ends where the sheet does.
        place: (10,) in the window.
        samples: across a pixel.
        out: (bits + 6, height, width) written: bits, figure, beyond the left, right, upper and lower edge,
            and 1 where a pixel counts.
    """
    step, first, part = 1.0 / samples, 0.5 / samples - 0.5, 1.0 / (samples * samples)
    out[:] = 0.0
    for j in range(out.shape[1]):
        for i in range(out.shape[2]):
            x, y, depth = drawn_at(place, i, j)
            out[bits + 5, j, i] = 1.0 if depth > NEAREST and counts(region, x, y) else 0.0
            for k in range(samples * samples):
                x, y, depth = drawn_at(
                    place, i + first + (k % samples) * step, j + first + (k // samples) * step
                )
                bit = bit_of(figure, bits, x, y)
                if depth <= NEAREST:
                    continue
                if abs(x) > region.half_width:
                    out[bits + (1 if x < 0.0 else 2), j, i] += part
                elif y < region.top or y > region.bottom:
                    out[bits + (3 if y < 0.0 else 4), j, i] += part
                elif bit >= 0:
                    out[bit, j, i] += part
                else:
                    out[bits, j, i] += part * ink_at(figure, bits, 0, x, y)


@compiled
def blur_layers(sharp: FloatCubes, weights: FloatArray, lines: FloatRows, out: FloatCubes) -> None:
    """Images as a point spread shows them.

    Args:
        sharp: (n, height + 2 k, width + 2 k).
        weights: (2 k + 1,) of the point spread.
        lines: (height + 2 k, width) work space.
        out: (n, height, width) written.
    """
    reach, height, width = len(weights), out.shape[1], out.shape[2]
    for layer in range(len(out)):
        for j in range(sharp.shape[1]):
            for i in range(width):
                lines[j, i] = 0.0
            for k in range(reach):
                add_row(lines[j, :], weights[k], sharp[layer, j, k : k + width])
        for j in range(height):
            for i in range(width):
                out[layer, j, i] = 0.0
            for k in range(reach):
                add_row(out[layer, j, :], weights[k], lines[j + k, :])


@compiled
def add_row(row: FloatArray, share: float, other: FloatArray) -> None:
    """Adds a share of one row to another."""
    for i in range(len(row)):
        row[i] += share * other[i]


@compiled
def normal_equations(rows: FloatRows, right: FloatArray, normal: FloatRows, sums: FloatArray) -> None:
    """The normal equations of some rows: BLAS would wake threads, which cost more than they do.

    Args:
        rows: (n, k).
        right: (n,).
        normal: (k, k) written: rows' rows.
        sums: (k,) written: rows' right.
    """
    normal[:] = 0.0
    sums[:] = 0.0
    for n in range(len(rows)):
        row = rows[n, :]
        add_row(sums, right[n], row)
        for i in range(len(row)):
            add_row(normal[i, :], row[i], row)
