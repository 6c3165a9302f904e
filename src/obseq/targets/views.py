"""Pictures of what was found: images with the targets drawn over them, and a page of all targets cut out."""

from __future__ import annotations

import base64
import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.printable import printable_line
from obseq.targets.drawing.legend import dots
from obseq.targets.finding.levels import sampled
from obseq.targets.measures import named
from obseq.targets.pictures import png_bytes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from obseq.arrays import Array, FloatArray
    from obseq.targets.finding.finder import Found, Target

GREEN, ORANGE, RED = (0, 200, 0), (255, 150, 0), (230, 0, 0)
CUT = 96
"""Pixels of a side of a target that is cut out."""
AROUND = 1.15
"""Half widths of a sheet that are cut out."""
CROSS = 4
LEAST_LETTER = 2


def overlay(image: Array, found: Found) -> Array:
    """(height, width, 3) the image with its targets: named ones green, others orange, refused ones red."""
    canvas = np.repeat(_shown(image)[:, :, None], 3, axis=2)
    for refusal in found.refused:
        _mark(canvas, np.array([refusal.x, refusal.y]), RED, 2)
    for name, target in named(found):
        colour = GREEN if target.name else ORANGE
        _mark(canvas, target.centre, colour, CROSS)
        turns = np.linspace(0.0, 2.0 * math.pi, 400)
        edge = target.fit.placed.pixels(np.column_stack((np.cos(turns), np.sin(turns))))
        _dot(canvas, edge, colour)
        size = max(LEAST_LETTER, round(target.fit.placed.unit / 10.0))
        _write(canvas, name, target.centre + target.fit.placed.unit * np.array([0.8, 0.8]), colour, size)
    return canvas


def _shown(image: Array) -> Array:
    """Grey levels as 8 bits: those of 16 from the darkest to the lightest, but for a thousandth."""
    if image.dtype == np.uint8:
        return image
    low, high = np.quantile(image, [0.001, 0.999])
    shown: Array = np.clip((image - low) * (255.0 / max(high - low, 1.0)), 0, 255).astype(np.uint8)
    return shown


def _dot(canvas: Array, places: Array, colour: tuple[int, int, int]) -> None:
    x, y = np.round(places).astype(int).T
    inside = (x >= 0) & (y >= 0) & (x < canvas.shape[1]) & (y < canvas.shape[0])
    canvas[y[inside], x[inside]] = colour


def _mark(canvas: Array, place: FloatArray, colour: tuple[int, int, int], arm: int) -> None:
    ways = np.arange(-arm, arm + 1)
    zero = np.zeros_like(ways)
    _dot(canvas, place + np.vstack((np.column_stack((ways, zero)), np.column_stack((zero, ways)))), colour)


def _write(canvas: Array, text: str, place: FloatArray, colour: tuple[int, int, int], size: int) -> None:
    steps = np.stack(np.meshgrid(np.arange(size), np.arange(size)), axis=-1).reshape(-1, 2)
    for k, letter in enumerate(text):
        for i, j in dots(letter):
            _dot(canvas, place + size * np.array([6 * k + i, j]) + steps, colour)


def cut_out(image: Array, target: Target, half_width: float) -> Array:
    """(96, 96) a target as its sheet is seen from the front, uint8."""
    ways = AROUND * half_width * np.linspace(-1.0, 1.0, CUT)
    places = np.stack(np.meshgrid(ways, ways), axis=-1).reshape(-1, 2)
    pixels = target.fit.placed.pixels(places)
    grey = sampled(image, pixels[:, 0], pixels[:, 1]).reshape(CUT, CUT)
    fit = target.fit
    light, dark = max(fit.offset, fit.offset + fit.gain), min(fit.offset, fit.offset + fit.gain)
    scaled: Array = np.clip(30.0 + (grey - dark) * (195.0 / max(light - dark, 1e-6)), 0, 255).astype(np.uint8)
    return scaled


def cells_of(
    image: Array, name: str, found: Found, half_widths: Mapping[str, float]
) -> list[tuple[float, str]]:
    """Each target of an image, cut out, for `page_text`: likeness to its drawing, and text.

    Args:
        image: (height, width).
        name: of it.
        found: its targets.
        half_widths: of the sheets, by family, units.
    """
    return [
        (target.fit.likeness, _cell(image, name, label, target, half_widths))
        for label, target in named(found)
    ]


def page_text(cells: Sequence[tuple[float, str]]) -> str:
    """A page of all targets, cut out, the worst first."""
    ordered = sorted(cells, key=lambda cell: cell[0])
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>Targets</title><style>'
        "body{font:14px sans-serif;margin:1em}figure{display:inline-block;margin:.4em;width:9.5em}"
        "img{width:96px;height:96px;display:block}figcaption{font-size:12px}</style>"
        f"<h1>{len(cells)} targets</h1><p>The least like their drawings come first.</p>"
        f"{''.join(text for _, text in ordered)}</html>\n"
    )


def _cell(image: Array, where: str, name: str, target: Target, half_widths: Mapping[str, float]) -> str:
    picture = base64.b64encode(png_bytes(cut_out(image, target, half_widths[target.family]))).decode()
    sigma = math.sqrt(float(np.trace(target.covariance)) / 2.0)
    x, y = target.centre
    label, place = _escaped(name), _escaped(where)
    corrected = f"<br>{target.corrected} bit corrected" if target.corrected else ""
    size = f"{target.size:.0f} px, tilt {math.degrees(target.tilt):.0f}&deg;{corrected}"
    return (
        f'<figure><img alt="{label}" src="data:image/png;base64,{picture}"><figcaption><b>{label}</b> {place}'
        f"<br>x {x:.2f} y {y:.2f}<br>sigma {sigma:.3f} px, likeness {target.fit.likeness:.3f}"
        f"<br>{size}</figcaption></figure>"
    )


def _escaped(text: str) -> str:
    return printable_line(text).replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
