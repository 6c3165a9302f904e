"""The compiled loop that says how much of an image a chequered disc explains, before it is fitted."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from obseq.compilation import compiled
from obseq.targets.finding.detection import between

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, FloatRows

RADII = (0.25, 0.4, 0.55, 0.7, 0.85)
"""Circles in a disc on which it is looked at, in its radii."""
PLACES = 32
"""On each of them."""
NARROWEST = 0.04
"""Width of sheet around a disc, in its radii, from which this is looked at too."""
BLUR = 1.0
"""Sigma of the point spread, pixels, as far as it is known then: images have 0.6 to 1.2."""
INTERPOLATED = 4.0 / 9.0
"""Mean variance of a place between pixels, over that of a pixel."""


@compiled
def explained(
    image: FloatRows, sign: float, noise: float, gap: float, found: FloatRows, share: FloatArray
) -> None:
    """The share of the grey variance, but for noise, that chequered discs explain with the sheet around.

    In the discs light and dark quadrants alternate, blurred; in the middle of the gap to the code the sheet
    is light all around, which chance seldom makes.

    Args:
        image: (height, width).
        sign: 1, or -1 for light and dark exchanged.
        noise: standard deviation of a pixel.
        gap: width of the sheet between a disc and its code, in radii of the disc.
        found: (n, 10): x, y, strength, dark and light level, where light turns dark, by how much further dark
            turns light, and the ellipse q11, q12, q22.
        share: (n,) written.
    """
    circles = len(RADII) + (1 if gap > NARROWEST else 0)
    count = circles * PLACES
    scale = 1.0 / (math.sqrt(2.0) * BLUR)
    for n in range(len(found)):
        x, y, begin, end = found[n, 0], found[n, 1], found[n, 5], found[n, 5] + found[n, 6]
        a, b, c = found[n, 7], found[n, 8], found[n, 9]
        p, q = math.cos(begin), math.sin(begin)
        length = 1.0 / math.sqrt(a * p * p + 2.0 * b * p * q + c * q * q)
        p, q = p * length, q * length
        u, v = math.cos(end), math.sin(end)
        length = 1.0 / math.sqrt(a * u * u + 2.0 * b * u * v + c * v * v)
        u, v = u * length, v * length
        area = abs(p * v - q * u)
        far_of_first, far_of_second = area / math.hypot(u, v), area / math.hypot(p, q)
        s = ss = e = ee = se = 0.0
        for circle in range(circles):
            radius = RADII[circle] if circle < len(RADII) else 1.0 + 0.5 * gap
            for k in range(PLACES):
                turn = 2.0 * math.pi * k / PLACES
                first, second = math.cos(turn), math.sin(turn)
                # the way from the edge, along its normal: (1 - radius) over the length of the gradient
                slope = math.hypot(first * v - second * q, second * p - first * u) / area
                inside = 0.5 * (1.0 + math.erf(scale * (1.0 - radius) / slope))
                quadrants = math.erf(scale * radius * first * far_of_first)
                quadrants *= math.erf(scale * radius * second * far_of_second)
                drawn = 1.0 - inside - inside * quadrants
                value = sign * between(
                    image, x + radius * (first * p + second * u), y + radius * (first * q + second * v)
                )
                s += value
                ss += value * value
                e += drawn
                ee += drawn * drawn
                se += value * drawn
        whole = ss - s * s / count
        common, own = se - s * e / count, ee - e * e / count
        share[n] = 0.0
        if common > 0.0 and own > 0.0 and whole > 0.0:
            left = whole - common * common / own - INTERPOLATED * noise * noise * count
            share[n] = 1.0 - max(left, 0.0) / whole
