"""The compiled loops of drawings: the colour of each place of a target."""

from __future__ import annotations

import math
from typing import NamedTuple

from obseq.arrays import FloatArray, FloatRows
from obseq.compilation import compiled

QUARTER, TURN = math.pi / 2, 2.0 * math.pi
ROWS_APART = math.sqrt(2.0) / 4
"""Height at which the rows of a sheet with the figure at the top meet, below the figure, in half widths."""


LATTICE, GENERATOR, TINY = 16, 5, 1e-6
"""Places in a cell that an edge crosses, each with its mirror image about the middle of the cell. All columns
and lines differ, none is on a diagonal: an edge along the axes, or at half a right angle, is not shifted."""


class Figure(NamedTuple):
    """A geometry as loops take it; the fields of `Geometry`, in units."""

    begin: float
    end: float
    half_width: float
    angle: float
    is_chequered: bool
    grows: bool
    in_rows: bool
    at_top: bool
    forwards: bool
    mark: float
    mark_x: float
    mark_y: float
    rings: float
    finest: float


@compiled
def bit_of(figure: Figure, bits: int, x: float, y: float) -> int:
    """Which bit has ink at a place when it is 1; -1 where none has."""
    half_width = figure.half_width
    if figure.in_rows:
        if y <= half_width and (figure.at_top or y >= -half_width):
            return -1
        half = bits // 2
        is_second = y > half_width * (1.0 + ROWS_APART) if figure.at_top else y > 0.0
        column = math.floor((x + half_width) / (2.0 * half_width) * half)
        if is_second and not figure.at_top and not figure.forwards:
            column = half - 1 - column
        column = min(max(column, 0), half - 1)
        return column + half if is_second else column
    r = math.sqrt(x * x + y * y)
    if r < figure.begin or r >= figure.end:
        return -1
    turn = (math.atan2(y, x) - figure.angle) * (1.0 if figure.grows else -1.0)
    place = bits * turn / TURN
    place -= bits * math.floor(place / bits)
    return min(math.floor(place), bits - 1)


@compiled
def ink_at(figure: Figure, bits: int, code: int, x: float, y: float) -> float:
    """1 where ink is, 0 where the sheet shows; the sheet has no end and no legend."""
    bit = bit_of(figure, bits, x, y)
    if bit >= 0:
        return 1.0 if (code >> bit) & 1 else 0.0
    square = x * x + y * y
    if square >= 1.0:
        return 0.0
    if figure.rings > 0.0 and square < figure.rings * figure.rings:
        ratio = max(figure.finest, math.sqrt(square)) / figure.rings
        ink = 1.0
        while ratio < 1.0:
            ratio *= 2.0
            ink = 1.0 - ink
        return ink
    if abs(x - figure.mark_x) + abs(y - figure.mark_y) < figure.mark:
        return 1.0
    if not figure.is_chequered:
        return 1.0
    quadrant = math.floor((math.atan2(y, x) - figure.angle) / QUARTER)
    return 1.0 if quadrant % 2 else 0.0


@compiled
def paint(figure: Figure, bits: int, code: int, place: FloatArray, out: FloatRows) -> None:
    """The ink of a grid of places.

    Args:
        figure: the target.
        bits: of its code.
        code: its code.
        place: (3,) column and line of the centre of the figure, and places in a unit.
        out: (height, width) written: 1 where ink is.
    """
    for j in range(out.shape[0]):
        y = (j - place[1]) / place[2]
        for i in range(out.shape[1]):
            out[j, i] = ink_at(figure, bits, code, (i - place[0]) / place[2], y)


@compiled
def paint_places(
    figure: Figure, bits: int, code: int, boxes: FloatRows, places: FloatRows, out: FloatArray
) -> None:
    """The ink of places of a sheet.

    Args:
        figure: the target.
        bits: of its code.
        code: its code.
        boxes: (k, 4) left, upper, right and lower edges of further ink, units: the dots of the legend.
        places: (n, 2) units.
        out: (n,) written: 1 where ink is.
    """
    for n in range(len(places)):
        x, y = places[n, 0], places[n, 1]
        out[n] = ink_at(figure, bits, code, x, y)
        for k in range(len(boxes)):
            if boxes[k, 0] <= x < boxes[k, 2] and boxes[k, 1] <= y < boxes[k, 3]:
                out[n] = 1.0


@compiled
def bit_sums(figure: Figure, bits: int, place: FloatArray, width: int, height: int, out: FloatRows) -> None:
    """Number of the places of each bit, and sums of their columns and lines.

    Args:
        figure: the target.
        bits: of its codes.
        place: (3,) as in `paint`.
        width: places in a line.
        height: lines.
        out: (bits, 3) added to.
    """
    for j in range(height):
        y = (j - place[1]) / place[2]
        for i in range(width):
            bit = bit_of(figure, bits, (i - place[0]) / place[2], y)
            if bit >= 0:
                out[bit, 0] += 1.0
                out[bit, 1] += i
                out[bit, 2] += j


@compiled
def smooth_table(figure: Figure, bits: int, code: int, place: FloatArray, out: FloatRows) -> None:
    """The share of ink in each cell of a grid: cells that no edge crosses are looked at once.

    Args:
        figure: the target.
        bits: of its code.
        code: its code.
        place: (3,) column and line of the centre of the figure, and cells in a unit.
        out: (height, width) written.
    """
    paint(figure, bits, code, place, out)
    height, width = out.shape
    marks = 2.0
    for j in range(1, height - 1):
        for i in range(1, width - 1):
            here = out[j, i] % marks >= 1.0
            for dj in range(-1, 2):
                for di in range(-1, 2):
                    if (out[j + dj, i + di] % marks >= 1.0) != here:
                        out[j, i] = marks + (1.0 if here else 0.0)
    for j in range(height):
        for i in range(width):
            if out[j, i] >= marks:
                total = 0.0
                for k in range(LATTICE):
                    u = (k + 0.75) / LATTICE - 0.5 + TINY
                    v = ((k * GENERATOR) % LATTICE + 0.25) / LATTICE - 0.5 + TINY
                    for side in range(2):
                        w = 1.0 - 2.0 * side
                        x, y = (i + w * u - place[0]) / place[2], (j + w * v - place[1]) / place[2]
                        total += ink_at(figure, bits, code, x, y)
                out[j, i] = total / (2 * LATTICE)
