"""The compiled loops of the finders: an image between its pixels, its saddles, and discs around them."""

from __future__ import annotations

import math

from obseq.arrays import FloatArray, FloatRows
from obseq.compilation import compiled

RING = 24
"""Places on a circle around a saddle, or on an ellipse around a spot."""
NEAREST, SURELY = 1.5, 4.0
"""Pixels from a saddle between which the contrast beside its lines is taken: the smallest disc is larger."""
BESIDE, BESIDE_SHARE = 1.0, 0.06
"""Pixels from a line to where both sides are looked at, and what is added on the way for its direction."""
NARROWEST = 0.25
"""Radians of the narrowest quadrant: a tilt of 80 degrees."""
UNLIKE = 0.05
"""Mean squared difference of places half a turn apart, in contrasts squared: noise makes 0.03 of it where the
contrast is the least that is looked at."""
INSIDE = 0.8
"""Share of a disc within which circles see its lines only."""
BEYOND = 0.35
"""Steps by which the contrast falls short of half, after which a line has ended: it may begin again soon."""
UNLIKELY = 5.0
"""And the likelihood ratio, its logarithm, by which noise alone does not make it end."""


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
        taps: (2 k + 1,) weights, alike on both sides.
        work: (height, width) overwritten.
        out: (height, width) written.
    """
    height, width = image.shape
    k = len(taps) // 2
    end = width - k
    for j in range(height):
        row, line = image[j, :], work[j, k:end]
        for i in range(end - k):
            line[i] = taps[k] * row[k + i]
        for m in range(1, k + 1, 2):
            n = min(m + 1, k)
            far = taps[k + n] if n > m else 0.0
            pairs = row[k - m : end - m], row[k + m : end + m], row[k - n : end - n], row[k + n : end + n]
            _add_pairs(*pairs, taps[k + m], far, line)
    for j in range(height):
        is_edge = j < k or j >= height - k
        for i in range(width if is_edge else k):
            out[j, i], out[j, width - 1 - i] = image[j, i], image[j, width - 1 - i]
        if is_edge:
            continue
        line, middle = out[j, k:end], work[j, k:end]
        for i in range(end - k):
            line[i] = taps[k] * middle[i]
        for m in range(1, k + 1, 2):
            n = min(m + 1, k)
            far = taps[k + n] if n > m else 0.0
            pairs = work[j - m, k:end], work[j + m, k:end], work[j - n, k:end], work[j + n, k:end]
            _add_pairs(*pairs, taps[k + m], far, line)


@compiled
def _add_pairs(
    a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, near: float, far: float, out: FloatArray
) -> None:
    """Adds the sums of two pairs of rows, each with a weight."""
    for i in range(len(out)):
        out[i] += near * (a[i] + b[i]) + far * (c[i] + d[i])


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
    circle: FloatRows,
    margin: int,
    out: FloatRows,
) -> int:
    """Saddles around which light and dark alternate four times, alike after half a turn.

    Args:
        image: (height, width) smoothed.
        strength: (height, width) as `saddle_strength` writes it.
        least: strength below which nothing is looked at.
        contrast: least difference of light and dark on the circle.
        circle: (`RING`, 3) places on it around a saddle, in turn: x and y, pixels; the rest is overwritten.
        margin: pixels along the edges that are not looked at: the circle does not go there.
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
            if _alternates(image, i, j, circle, contrast, out[n]):
                out[n, 2] = here
                n += 1
                if n == len(out):
                    return n
    return n


@compiled
def _alternates(
    image: FloatRows, i: int, j: int, circle: FloatRows, contrast: float, out: FloatArray
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
        value = between(image, x + circle[k, 0], y + circle[k, 1])
        circle[k, 2] = value
        low, high = min(low, value), max(high, value)
    if high - low < contrast:
        return False
    middle, changes, unlike = 0.5 * (low + high), 0, 0.0
    last = circle[RING - 1, 2]
    for k in range(RING):
        value, opposite = circle[k, 2], circle[(k + RING // 2) % RING, 2]
        changes += (value > middle) != (last > middle)
        unlike += (value - opposite) ** 2
        last = value
    if changes != 4 or unlike > UNLIKE * RING * (high - low) * (high - low):
        return False
    out[0], out[1], out[3], out[4] = x, y, low, high
    return True


@compiled
def discs(
    image: FloatRows,
    sign: float,
    noise: float,
    radii: FloatArray,
    ways: FloatRows,
    farthest: float,
    found: FloatRows,
    shapes: FloatRows,
) -> None:
    """The chequered discs around saddles.

    Along both lines that cross in a disc, one side is light and the other dark as far as the disc goes.
    Beyond, the sheet is on both sides, also where bits are near to the disc. The four ends say where its
    ellipse `p' q p = 1` is. All of its quadrants must be as light and as dark as they should.

    Args:
        image: (height, width).
        sign: 1, or -1 for light and dark exchanged.
        noise: standard deviation of a pixel.
        radii: (k,) of the circles on which the lines are looked for, pixels.
        ways: (2 `RING`, 2) directions all around, in turn.
        farthest: the end is not looked for farther off, pixels.
        found: (n, 5) as `saddles` writes them.
        shapes: (n, 5) written: where light turns dark, clockwise on the page, by how much further dark turns
            light, q11, q12, q22; not a number where there is no such ellipse.
    """
    for n in range(len(found)):
        x, y, middle = found[n, 0], found[n, 1], 0.5 * (found[n, 3] + found[n, 4])
        shapes[n, 0] = math.nan
        first = second = begin = span = 0.0
        reach = SURELY
        for _ in range(2):
            begin, span = _crossing(image, sign, x, y, middle, radii, ways, reach)
            if not NARROWEST < span < math.pi - NARROWEST:
                break
            first = _length(image, sign, noise, x, y, begin, farthest)
            second = _length(image, -sign, noise, x, y, begin + span, farthest)
            reach = INSIDE * min(first, second)
        if not (NARROWEST < span < math.pi - NARROWEST and first > 2.5 and second > 2.5):
            continue
        p, q = first * math.cos(begin), first * math.sin(begin)
        u, v = second * math.cos(begin + span), second * math.sin(begin + span)
        whole = (p * v - q * u) ** 2
        a, b, c = (q * q + v * v) / whole, -(p * q + u * v) / whole, (p * p + u * u) / whole
        if _has_quadrants(image, sign, x, y, begin, span, a, b, c):
            shapes[n, 0], shapes[n, 1] = begin, span
            shapes[n, 2], shapes[n, 3], shapes[n, 4] = a, b, c


@compiled
def _crossing(
    image: FloatRows,
    sign: float,
    x: float,
    y: float,
    middle: float,
    radii: FloatArray,
    ways: FloatRows,
    reach: float,
) -> tuple[float, float]:
    """The directions of the two lines that cross at a saddle: the first, and the angle between them.

    On circles of growing radius, as long as light and dark alternate four times, the angles at which light
    turns dark, and those at which dark turns light, are averaged with their doubles: half turns are alike.
    The angle between them is 0 where no lines cross.
    """
    height, width = image.shape
    falls_x = falls_y = rises_x = rises_y = 0.0
    used = 0
    for radius in radii:
        if x < radius or y < radius or x > width - 1 - radius or y > height - 1 - radius:
            break
        if used > 0 and radius > reach:
            break
        changes = 0
        fx = fy = rx = ry = 0.0
        last = sign * (between(image, x + radius, y) - middle)
        for k in range(1, 2 * RING + 1):
            way = k % (2 * RING)
            value = sign * (between(image, x + radius * ways[way, 0], y + radius * ways[way, 1]) - middle)
            if (value > 0.0) != (last > 0.0):
                changes += 1
                angle = 2.0 * math.pi / RING * (k - value / (value - last))
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
    if used == 0:
        return 0.0, 0.0
    falls, rises = 0.5 * math.atan2(falls_y, falls_x), 0.5 * math.atan2(rises_y, rises_x)
    span = rises - falls
    return falls, span - math.pi * math.floor(span / math.pi)


@compiled
def _length(
    image: FloatRows, sign: float, noise: float, x: float, y: float, angle: float, farthest: float
) -> float:
    """How far light and dark lie beside a line through a saddle, the mean of both ways; 0 for no end.

    Of all ends, the one at which the contrast in front of it exceeds half of that at the saddle most, and
    that beyond falls short of it.

    Args:
        image: (height, width).
        sign: 1 where growing angles are dark, -1 where they are light.
        noise: standard deviation of a pixel.
        x: of the saddle.
        y: likewise.
        angle: of the line.
        farthest: the end is not looked for farther off, pixels.
    """
    total = 0.0
    for way in range(2):
        turn = angle + way * math.pi
        u, v = math.cos(turn), math.sin(turn)
        height, seen, excess, most, end = 0.0, 0, 0.0, 0.0, 0.0
        step = NEAREST
        while step < farthest:
            aside = BESIDE + BESIDE_SHARE * step
            p, q = x + step * u, y + step * v
            dark = between(image, p - aside * v, q + aside * u)
            contrast = sign * (between(image, p + aside * v, q - aside * u) - dark)
            if step < SURELY:
                height += contrast
                seen += 1
                excess = 0.5 * height
                most, end = excess, step
            else:
                excess += contrast - 0.5 * height / seen
                if excess > most:
                    most, end = excess, step
                elif excess < most - BEYOND * height / seen - UNLIKELY * noise * noise * seen / height:
                    break
            step += 0.5
        if step >= farthest or height <= 0.0:
            return 0.0
        total += end + 0.25
    return 0.5 * total


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
