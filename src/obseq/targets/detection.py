"""The compiled loops of the finders: an image between its pixels, its saddles, and discs around them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from obseq.compilation import compiled

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, FloatRows

RING = 24
"""Places on a circle around a saddle, or on an ellipse around a spot."""


@compiled
def halved(image: FloatRows, out: FloatRows) -> None:
    """The means of squares of two by two pixels."""
    for j in range(out.shape[0]):
        for i in range(out.shape[1]):
            upper = image[2 * j, 2 * i] + image[2 * j, 2 * i + 1]
            lower = image[2 * j + 1, 2 * i] + image[2 * j + 1, 2 * i + 1]
            out[j, i] = 0.25 * (upper + lower)


@compiled
def smooth(image: FloatRows, taps: FloatArray, work: FloatRows, out: FloatRows) -> None:
    """A smoothed image; the outermost pixels, as many as half the taps, are left as they are.

    Args:
        image: (height, width).
        taps: (2 k + 1,) weights.
        work: (height, width) overwritten.
        out: (height, width) written.
    """
    height, width = image.shape
    k = len(taps) // 2
    for j in range(height):
        for i in range(width):
            work[j, i] = image[j, i]
            out[j, i] = image[j, i]
        for i in range(k, width - k):
            work[j, i] = 0.0
        for n in range(len(taps)):
            weight = taps[n]
            for i in range(k, width - k):
                work[j, i] += weight * image[j, i + n - k]
    for j in range(k, height - k):
        for i in range(k, width - k):
            out[j, i] = 0.0
        for n in range(len(taps)):
            weight = taps[n]
            for i in range(k, width - k):
                out[j, i] += weight * work[j + n - k, i]


@compiled
def between(image: FloatRows, x: float, y: float) -> float:
    """The image between its pixels; at its edge beyond them."""
    x = min(max(x, 0.0), image.shape[1] - 1.001)
    y = min(max(y, 0.0), image.shape[0] - 1.001)
    i, j = math.floor(x), math.floor(y)
    x -= i
    y -= j
    upper = (1.0 - x) * image[j, i] + x * image[j, i + 1]
    lower = (1.0 - x) * image[j + 1, i] + x * image[j + 1, i + 1]
    found: float = (1.0 - y) * upper + y * lower
    return found


@compiled
def saddle_strength(image: FloatRows, out: FloatRows) -> None:
    """Minus the determinant of the second derivatives: positive at saddles."""
    height, width = image.shape
    for i in range(width):
        out[0, i] = 0.0
        out[height - 1, i] = 0.0
    for j in range(1, height - 1):
        out[j, 0] = 0.0
        out[j, width - 1] = 0.0
        for i in range(1, width - 1):
            here = 2.0 * image[j, i]
            xx = image[j, i + 1] - here + image[j, i - 1]
            yy = image[j + 1, i] - here + image[j - 1, i]
            upper = image[j - 1, i + 1] - image[j - 1, i - 1]
            xy = 0.25 * (image[j + 1, i + 1] - image[j + 1, i - 1] - upper)
            out[j, i] = xy * xy - xx * yy


@compiled
def saddles(
    image: FloatRows,
    strength: FloatRows,
    least: float,
    contrast: float,
    radius: float,
    margin: int,
    out: FloatRows,
) -> int:
    """Saddles around which light and dark alternate four times, alike after half a turn.

    Args:
        image: (height, width) smoothed.
        strength: (height, width) as `saddle_strength` writes it.
        least: strength below which nothing is looked at.
        contrast: least difference of light and dark on the circle.
        radius: of the circle, pixels.
        margin: pixels along the edges that are not looked at.
        out: (most, 5) written: x, y, strength, dark and light level.

    Returns:
        Their number; `most` when there may be more.
    """
    height, width = image.shape
    n = 0
    for j in range(margin, height - margin):
        for i in range(margin, width - margin):
            here = strength[j, i]
            if here < least:
                continue
            if not (
                here > strength[j, i - 1]
                and here >= strength[j, i + 1]
                and here > strength[j - 1, i]
                and here >= strength[j + 1, i]
                and here > strength[j - 1, i - 1]
                and here > strength[j - 1, i + 1]
                and here >= strength[j + 1, i - 1]
                and here >= strength[j + 1, i + 1]
            ):
                continue
            if _alternates(image, i, j, radius, contrast, out, n):
                out[n, 2] = here
                n += 1
                if n == len(out):
                    return n
    return n


@compiled
def _alternates(
    image: FloatRows, i: int, j: int, radius: float, contrast: float, out: FloatRows, n: int
) -> bool:
    """Whether light and dark alternate four times around a pixel; its place and levels are written."""
    xx = image[j, i + 1] - 2.0 * image[j, i] + image[j, i - 1]
    yy = image[j + 1, i] - 2.0 * image[j, i] + image[j - 1, i]
    upper = image[j - 1, i + 1] - image[j - 1, i - 1]
    xy = 0.25 * (image[j + 1, i + 1] - image[j + 1, i - 1] - upper)
    gx, gy = 0.5 * (image[j, i + 1] - image[j, i - 1]), 0.5 * (image[j + 1, i] - image[j - 1, i])
    whole = xx * yy - xy * xy
    x, y = -(yy * gx - xy * gy) / whole, -(xx * gy - xy * gx) / whole
    if abs(x) > 1.5 or abs(y) > 1.5:
        return False
    x += i
    y += j
    low, high = 1e30, -1e30
    for k in range(RING):
        turn = 2.0 * math.pi * k / RING
        value = between(image, x + radius * math.cos(turn), y + radius * math.sin(turn))
        low, high = min(low, value), max(high, value)
    if high - low < contrast:
        return False
    middle, changes, unlike = 0.5 * (low + high), 0, 0.0
    last = between(image, x + radius, y) > middle
    for k in range(1, RING + 1):
        turn = 2.0 * math.pi * k / RING
        value = between(image, x + radius * math.cos(turn), y + radius * math.sin(turn))
        other = between(image, x - radius * math.cos(turn), y - radius * math.sin(turn))
        unlike += (value - other) * (value - other)
        if (value > middle) != last:
            changes += 1
            last = not last
    if changes != 4 or unlike > 0.16 * RING * (high - low) * (high - low):
        return False
    out[n, 0], out[n, 1], out[n, 3], out[n, 4] = x, y, low, high
    return True


@compiled
def crossings(image: FloatRows, sign: float, radii: FloatArray, found: FloatRows, angles: FloatRows) -> None:
    """The directions of the two lines that cross at saddles.

    On circles of growing radius, as long as light and dark alternate four times, the angles at which light
    turns dark, and those at which dark turns light, are averaged with their doubles: half turns are alike.

    Args:
        image: (height, width).
        sign: 1, or -1 for light and dark exchanged.
        radii: (n,) of the circles, pixels.
        found: (n, 5) as `saddles` writes them.
        angles: (n, 2) written: where light turns dark, clockwise on the page, and by how much further dark
            turns light; not a number where no lines cross.
    """
    height, width = image.shape
    for n in range(len(found)):
        x, y, middle = found[n, 0], found[n, 1], 0.5 * (found[n, 3] + found[n, 4])
        falls_x = falls_y = rises_x = rises_y = 0.0
        used = 0
        for m in range(len(radii)):
            radius = radii[m]
            if x < radius or y < radius or x > width - 1 - radius or y > height - 1 - radius:
                break
            places = 2 * RING
            changes = 0
            fx = fy = rx = ry = 0.0
            last = sign * (between(image, x + radius, y) - middle)
            for k in range(1, places + 1):
                turn = 2.0 * math.pi * k / places
                value = between(image, x + radius * math.cos(turn), y + radius * math.sin(turn))
                value = sign * (value - middle)
                if (value > 0.0) != (last > 0.0):
                    changes += 1
                    angle = 2.0 * (turn - 2.0 * math.pi / places * value / (value - last))
                    if last > 0.0:
                        fx += math.cos(angle)
                        fy += math.sin(angle)
                    else:
                        rx += math.cos(angle)
                        ry += math.sin(angle)
                last = value
            if changes != 4:
                if used > 0 or radius > 3.0:
                    break
                continue
            if fx * fx + fy * fy < 3.2 or rx * rx + ry * ry < 3.2:
                break
            falls_x += radius * fx
            falls_y += radius * fy
            rises_x += radius * rx
            rises_y += radius * ry
            used += 1
        angles[n, 0] = angles[n, 1] = math.nan
        if used > 0:
            falls, rises = 0.5 * math.atan2(falls_y, falls_x), 0.5 * math.atan2(rises_y, rises_x)
            span = rises - falls
            span -= math.pi * math.floor(span / math.pi)
            angles[n, 0], angles[n, 1] = falls, span


@compiled
def discs(
    image: FloatRows,
    sign: float,
    parts: FloatArray,
    farthest: float,
    found: FloatRows,
    work: FloatRows,
    shapes: FloatRows,
) -> None:
    """The ellipses in which the dark quadrants around saddles end.

    An ellipse is `p' q p = 1` about the saddle, by least squares through the places where rays turn light;
    those far from it are left out, twice. All of its quadrants must be as light and as dark as they should.

    Args:
        image: (height, width).
        sign: 1, or -1 for light and dark exchanged.
        parts: (k,) rays in a dark quadrant, in parts of it.
        farthest: the end is not looked for farther off, pixels.
        found: (n, 7): x, y, strength, dark and light level, the angle of the dark quadrant and its width.
        work: (2 k, 3) work space.
        shapes: (n, 3) written: q11, q12, q22; not a number where there is no such ellipse.
    """
    for n in range(len(found)):
        x, y, middle = found[n, 0], found[n, 1], 0.5 * (found[n, 3] + found[n, 4])
        shapes[n, 0] = math.nan
        count = 0
        for side in range(2):
            for m in range(len(parts)):
                turn = found[n, 5] + parts[m] * found[n, 6] + side * math.pi
                u, v = math.cos(turn), math.sin(turn)
                last, step = 0.0, 1.5
                while step < farthest:
                    value = sign * (between(image, x + step * u, y + step * v) - middle)
                    if value >= 0.0 and last < 0.0:
                        reach = step - 0.5 * value / (value - last)
                        work[count, 0], work[count, 1], work[count, 2] = reach * u, reach * v, 1.0
                        count += 1
                        break
                    last = value
                    step += 0.5
        if count < 1.4 * len(parts):
            continue
        a = b = c = 0.0
        scatter = size = 0.0
        is_ellipse = True
        for _ in range(3):
            a, b, c = _centred_conic(work, count)
            if not (a > 0.0 and a * c - b * b > 0.0):
                is_ellipse = False
                break
            size = 1.0 / math.sqrt(math.sqrt(a * c - b * b))
            scatter = weight = 0.0
            for k in range(count):
                p, q = work[k, 0], work[k, 1]
                radius = math.sqrt(a * p * p + 2.0 * b * p * q + c * q * q)
                away = abs(radius - 1.0) * math.sqrt(p * p + q * q) / radius
                scatter += work[k, 2] * min(away, 3.0)
                weight += work[k, 2]
            scatter /= weight
            for k in range(count):
                p, q = work[k, 0], work[k, 1]
                radius = math.sqrt(a * p * p + 2.0 * b * p * q + c * q * q)
                away = abs(radius - 1.0) * math.sqrt(p * p + q * q) / radius
                work[k, 2] = 1.0 if away < max(0.7, 2.0 * scatter) else 0.0
        kept = 0.0
        for k in range(count):
            kept += work[k, 2]
        if not is_ellipse or kept < 0.6 * count or size < 2.5 or scatter > 0.45 + size / 40.0:
            continue
        if _has_quadrants(image, sign, x, y, found[n, 5], found[n, 6], a, b, c):
            shapes[n, 0], shapes[n, 1], shapes[n, 2] = a, b, c


@compiled
def _centred_conic(work: FloatRows, count: int) -> tuple[float, float, float]:
    """The conic `a x^2 + 2 b x y + c y^2 = 1` through points (x, y, weight) by least squares."""
    n11 = n12 = n13 = n22 = n23 = n33 = r1 = r2 = r3 = 0.0
    for k in range(count):
        x, y, w = work[k, 0], work[k, 1], work[k, 2]
        f, g, h = x * x, 2.0 * x * y, y * y
        n11 += w * f * f
        n12 += w * f * g
        n13 += w * f * h
        n22 += w * g * g
        n23 += w * g * h
        n33 += w * h * h
        r1 += w * f
        r2 += w * g
        r3 += w * h
    c11, c12, c13 = n22 * n33 - n23 * n23, n13 * n23 - n12 * n33, n12 * n23 - n13 * n22
    whole = n11 * c11 + n12 * c12 + n13 * c13
    c22, c23, c33 = n11 * n33 - n13 * n13, n12 * n13 - n11 * n23, n11 * n22 - n12 * n12
    a = (c11 * r1 + c12 * r2 + c13 * r3) / whole
    b = (c12 * r1 + c22 * r2 + c23 * r3) / whole
    c = (c13 * r1 + c23 * r2 + c33 * r3) / whole
    return a, b, c


@compiled
def _has_quadrants(
    image: FloatRows,
    sign: float,
    x: float,
    y: float,
    begin: float,
    span: float,
    a: float,
    b: float,
    c: float,
) -> bool:
    """Whether all places well inside the quadrants of an ellipse are as light or as dark as they should."""
    darkest, lightest, dark, light = 1e30, -1e30, 0.0, 0.0
    for side in range(2):
        for m in range(3):
            for k in range(3):
                part = 0.25 + 0.25 * m
                reach = 0.4 + 0.2 * k
                for is_dark in range(2):
                    turn = begin + side * math.pi
                    turn += part * span if is_dark == 1 else span + part * (math.pi - span)
                    u, v = math.cos(turn), math.sin(turn)
                    length = reach / math.sqrt(a * u * u + 2.0 * b * u * v + c * v * v)
                    value = sign * between(image, x + length * u, y + length * v)
                    if is_dark == 1:
                        lightest = max(lightest, value)
                        dark += value / 18.0
                    else:
                        darkest = min(darkest, value)
                        light += value / 18.0
    contrast = light - dark
    return contrast > 0.0 and lightest < dark + 0.5 * contrast and darkest > light - 0.5 * contrast
