"""A page that shows residuals on the frame of image 1: one offline SVG in HTML, before and after the fit."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from obseq.arrays import FloatArray
from obseq.images.epipolar.field import Fit, percentiles

WIDTH = 560
"""Of a map, in CSS pixels."""
QUANTILE = 0.95
"""Share of the points whose residual is shown within the range of colours."""
SHOWN = (0, 5, 10, 15, 19, 20)
"""Which of the twenty-one percentiles the page shows."""
MOST = 20_000
"""Points that are drawn; of more, evenly spread ones."""


def residual_page(
    title: str,
    pixels: FloatArray,
    values: FloatArray,
    size: tuple[int, int],
    fit: Fit | None = None,
    said: Sequence[str] = (),
) -> str:
    """An HTML page with a map of the residuals, and one of what the fit leaves.

    Args:
        title: of the page: the two images.
        pixels: (n, 2) points of image 1.
        values: (n,) residuals, pixels.
        size: (width, height) of image 1.
        fit: the fit whose remainder is shown, if any.
        said: what stands first: the verdict, and what was left out.
    """
    maps = [("Residuals", values)]
    if fit is not None:
        maps.append(
            (f"Without the polynomial of degree {fit.polynomial.degree}", values - fit.polynomial(pixels))
        )
    words = "".join(f"<p>{escape(line)}</p>" for line in said)
    reach = float(np.quantile(np.abs(values), QUANTILE)) if len(values) else 0.0
    figures = "".join(_figure(name, pixels, part, size, reach or 1.0) for name, part in maps)
    return (
        "<!DOCTYPE html>\n<html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width'>"
        f"<title>{escape(title)}</title><style>{STYLE}</style></head><body>"
        f"<h1>{escape(title)}</h1>{words}<p>{len(values)} points; pixels of the first image, half the "
        "distance to the epipolar line, positive clockwise of the epipolar direction.</p>"
        f"<main>{figures}</main></body></html>\n"
    )


STYLE = (
    ":root{color-scheme:light dark}body{font:15px system-ui;margin:1rem auto;max-width:76rem;padding:0 1rem}"
    "main{display:flex;flex-wrap:wrap;gap:2rem}figure{margin:0;max-width:100%}svg{max-width:100%;height:auto;"
    "border:1px solid #888;background:#f6f6f4}td,th{padding:.1rem .6rem;text-align:right}"
)


def _figure(name: str, pixels: FloatArray, values: FloatArray, size: tuple[int, int], reach: float) -> str:
    rows = "".join(
        f"<tr><td>{5 * k} %</td><td>{value:.3f}</td></tr>"
        for k, value in enumerate(percentiles(values))
        if k in SHOWN
    )
    return (
        f"<figure><figcaption><h2>{escape(name)}</h2></figcaption>{_map(pixels, values, size, reach)}"
        f"<p>Colours from -{reach:.3f} (blue) to +{reach:.3f} px (red).</p>"
        f"<table><tr><th>of the points within</th><th>px</th></tr>{rows}</table></figure>"
    )


def _map(pixels: FloatArray, values: FloatArray, size: tuple[int, int], reach: float) -> str:
    width, height = size
    scale = WIDTH / max(width, 1)
    radius = max(width, height) / 250.0
    chosen = np.unique(np.linspace(0, len(values) - 1, min(len(values), MOST)).astype(np.int64))
    dots = "".join(
        f"<circle cx='{x:.1f}' cy='{y:.1f}' r='{radius:.1f}' fill='{_colour(value / reach)}'/>"
        for (x, y), value in zip(pixels[chosen], values[chosen], strict=True)
    )
    return (
        f"<svg width='{WIDTH}' height='{height * scale:.0f}' viewBox='0 0 {width} {height}' role='img' "
        f"aria-label='map of residuals'>{dots}</svg>"
    )


def _colour(share: float) -> str:
    """From blue through grey to red."""
    t = float(np.clip(share, -1.0, 1.0))
    low, middle, high = np.array([33, 102, 172]), np.array([190, 190, 190]), np.array([178, 24, 43])
    mixed = middle + abs(t) * ((high if t > 0 else low) - middle)
    return "#" + "".join(f"{round(part):02x}" for part in mixed)
