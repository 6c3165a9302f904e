"""Drawings of targets: arrays of pixels, and outlines for paper."""

from __future__ import annotations

import math

import numpy as np

from obseq.arrays import Array, FloatArray, FloatRows
from obseq.targets.drawing.legend import legend_boxes
from obseq.targets.drawing.painting import ROWS_APART, Figure, bit_sums, paint
from obseq.targets.specification import REDUCTION, Specification


def figure_of(spec: Specification) -> Figure:
    """The geometry of a set as loops take it."""
    geometry = spec.geometry
    begin, end, _, half_width = geometry.radii
    turn = geometry.angle + math.pi / 4
    c, s = math.cos(turn), math.sin(turn)
    x, y = geometry.mark_place
    return Figure(
        begin,
        end,
        half_width,
        geometry.angle,
        geometry.is_chequered,
        geometry.grows,
        geometry.in_rows,
        geometry.at_top,
        geometry.is_lower_row_forwards,
        geometry.mark,
        x * c - y * s,
        x * s + y * c,
        geometry.rings,
        1.0 / spec.raster.scale,
    )


def inked_bits(spec: Specification, code: int) -> int:
    """The code with ink where bits are 1: turned round where zeros are drawn."""
    return code if spec.geometry.zero_is_sheet else code ^ ((1 << spec.bits) - 1)


def bits_drawn(spec: Specification, code: int) -> FloatArray:
    """(bits,) 1 where a bit of a code has ink, 0 where it has none."""
    return np.array([inked_bits(spec, code) >> bit & 1 for bit in range(spec.bits)], dtype=float)


def draw(spec: Specification, name: str, *, legend: bool = True) -> Array:
    """The drawing of a target, reduced.

    Returns:
        (height, width) uint8: 600 pixels across.

    Raises:
        InputError: the set has no such name.
    """
    ink = painted(spec, inked_bits(spec, spec.code_of(name)))
    if legend:
        for left, top, right, bottom in legend_boxes(spec, name):
            ink[top:bottom, left:right] = 1.0
    height, width = ink.shape
    parts = ink.reshape(height // REDUCTION, REDUCTION, width // REDUCTION, REDUCTION)
    share = parts.mean(axis=(1, 3))
    white = 1.0 - share if spec.geometry.is_white else share
    pixels: Array = np.round(255.0 * white).astype(np.uint8)
    return pixels


def painted(spec: Specification, code: int) -> FloatRows:
    """(height, width) where ink is, before reduction, without legend."""
    raster = spec.raster
    out = np.empty((raster.height, raster.width))
    paint(figure_of(spec), spec.bits, code, _grid(spec), out)
    return out


def _grid(spec: Specification) -> FloatArray:
    return np.array([*spec.raster.middle, spec.raster.scale])


def centre(spec: Specification) -> FloatArray:
    """(2,) the middle of the figure in the reduced drawing, pixels."""
    return np.array(spec.raster.middle) / REDUCTION


def corners(spec: Specification) -> FloatRows:
    """(2, 2) the first two corners of the chequered disc in the reduced drawing, pixels, as rows."""
    unit = spec.raster.scale / REDUCTION
    return centre(spec) + unit * spec.fit_matrix().T


def bit_centres(spec: Specification) -> FloatRows:
    """(bits, 2) the middle of the area of each bit in the reduced drawing, pixels."""
    raster = spec.raster
    sums = np.zeros((spec.bits, 3))
    bit_sums(figure_of(spec), spec.bits, _grid(spec), raster.width, raster.height, sums)
    return sums[:, 1:] / sums[:, :1] / REDUCTION


def row_box(spec: Specification, bit: int) -> tuple[float, float, float, float]:
    """Left, upper, right and lower edge of a bit that stands in a row, units."""
    geometry, half = spec.geometry, spec.bits // 2
    radius, column, is_second = geometry.radii[3], bit % half, bit >= half
    if is_second and not geometry.at_top and not geometry.is_lower_row_forwards:
        column = half - 1 - column
    left = -radius + column * 2.0 * radius / half
    right = left + 2.0 * radius / half
    _, _, top, bottom = geometry.sheet
    if geometry.at_top:
        middle = radius * (1.0 + ROWS_APART)
        return (left, middle, right, bottom) if is_second else (left, radius, right, middle)
    return (left, radius, right, bottom) if is_second else (left, top, right, -radius)
