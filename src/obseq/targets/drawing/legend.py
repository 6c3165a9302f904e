"""The legend of a sheet: the name in two halves, upright in the upper corners, turned in the lower ones."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from obseq.arrays import FloatRows
    from obseq.targets.specification import Specification

CELL = (6, 8)
"""Width and height of a letter with the space around it, dots."""

_ROWS = {
    "0": "01110 10001 10011 10101 11001 10001 01110",
    "1": "00100 01100 00100 00100 00100 00100 01110",
    "2": "01110 10001 00001 00110 01000 10000 11111",
    "3": "01110 10001 00001 00110 00001 10001 01110",
    "4": "00010 00110 01010 10010 11111 00010 00010",
    "5": "11111 10000 11110 00001 00001 10001 01110",
    "6": "00110 01000 10000 11110 10001 10001 01110",
    "7": "11111 00001 00010 00100 01000 01000 01000",
    "8": "01110 10001 10001 01110 10001 10001 01110",
    "9": "01110 10001 10001 01111 00001 00010 01100",
    "A": "01110 10001 10001 11111 10001 10001 10001",
    "B": "11110 10001 10001 11110 10001 10001 11110",
    "C": "01110 10001 10000 10000 10000 10001 01110",
    "D": "11110 10001 10001 10001 10001 10001 11110",
    "E": "11111 10000 10000 11110 10000 10000 11111",
    "F": "11111 10000 10000 11110 10000 10000 10000",
    "G": "01110 10001 10000 10111 10001 10001 01111",
    "H": "10001 10001 10001 11111 10001 10001 10001",
    "I": "01110 00100 00100 00100 00100 00100 01110",
    "J": "00111 00010 00010 00010 00010 10010 01100",
    "K": "10001 10010 10100 11000 10100 10010 10001",
    "L": "10000 10000 10000 10000 10000 10000 11111",
    "M": "10001 11011 10101 10101 10001 10001 10001",
    "N": "10001 11001 10101 10011 10001 10001 10001",
    "O": "01110 10001 10001 10001 10001 10001 01110",
    "P": "11110 10001 10001 11110 10000 10000 10000",
    "Q": "01110 10001 10001 10001 10101 10010 01101",
    "R": "11110 10001 10001 11110 10100 10010 10001",
    "S": "01111 10000 10000 01110 00001 00001 11110",
    "T": "11111 00100 00100 00100 00100 00100 00100",
    "U": "10001 10001 10001 10001 10001 10001 01110",
    "V": "10001 10001 10001 10001 10001 01010 00100",
    "W": "10001 10001 10001 10101 10101 11011 10001",
    "X": "10001 10001 01010 00100 01010 10001 10001",
    "Y": "10001 10001 01010 00100 00100 00100 00100",
    "Z": "11111 00001 00010 00100 01000 10000 11111",
    "-": "00000 00000 00000 11111 00000 00000 00000",
    "_": "00000 00000 00000 00000 00000 00000 11111",
    ".": "00000 00000 00000 00000 00000 01100 01100",
}
_UNKNOWN = "11111 10001 10001 10001 10001 10001 11111"


def dots(letter: str) -> list[tuple[int, int]]:
    """Column and line of the dots of a letter; small letters are drawn as large ones."""
    rows = _ROWS.get(letter.upper(), _UNKNOWN).split()
    return [(i, j) for j, row in enumerate(rows) for i, dot in enumerate(row) if dot == "1"]


def dot_size(letters: int, radius: float) -> float:
    """Side of a dot, so that the box of a half of the name in the corner just touches the circle; units.

    The box has its corner at (-radius, -radius).
    """
    width, height = CELL[0] * letters, CELL[1]
    longer = max(width, height)
    x, y = width / longer, height / longer
    a, b = x * x + y * y, -2.0 * radius * (x + y)
    length = (-b - math.sqrt(b * b - 4.0 * a * radius * radius)) / (2.0 * a)
    return length * y / CELL[1]


def halves(name: str) -> tuple[str, str]:
    """What stands on the left and on the right; the first half is the longer one."""
    cut = (len(name) + 1) // 2
    return name[:cut], name[cut:]


def legend_boxes(spec: Specification, name: str) -> list[tuple[int, int, int, int]]:
    """Left, top, right and bottom of each dot in the drawing before reduction, pixels."""
    raster, (left, right) = spec.raster, halves(name)
    radius = spec.geometry.radii[2]
    dot = dot_size(len(left), radius) * raster.scale
    first = [max(middle - radius * raster.scale, 0.0) for middle in raster.middle]
    begin = raster.width - first[0] - CELL[0] * len(right) * dot
    boxes = []
    for text, x in ((left, first[0]), (right, begin)):
        for k, letter in enumerate(text):
            for i, j in dots(letter):
                u, v = x + (k * CELL[0] + i + 0.5) * dot, first[1] + (j + 0.5) * dot
                boxes.append((int(u), int(v), int(u + dot), int(v + dot)))
    return boxes + [_turned(box, raster.middle) for box in boxes]


def legend_places(spec: Specification, name: str) -> FloatRows:
    """(k, 4) left, upper, right and lower edge of each dot, units."""
    boxes = np.array(legend_boxes(spec, name), dtype=float).reshape(-1, 4)
    found: FloatRows = (boxes - 0.5 - np.tile(spec.raster.middle, 2)) / spec.raster.scale
    return found


def _turned(box: tuple[int, int, int, int], middle: tuple[float, float]) -> tuple[int, int, int, int]:
    """A box turned by half a turn about the middle of the figure."""
    x, y = (round(2.0 * value) - 1 for value in middle)
    left, top, right, bottom = box
    return x - right + 1, y - bottom + 1, x - left + 1, y - top + 1
