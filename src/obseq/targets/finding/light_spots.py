"""The compiled loops of the finders: light spots that look like ellipses."""

from __future__ import annotations

import math

from obseq.arrays import ByteRows, FloatArray, FloatRows, IntArray
from obseq.compilation import compiled
from obseq.targets.finding.detection import RING, between


@compiled
def above_mean(image: FloatRows, reach: int, least: float, sums: FloatArray, out: ByteRows) -> None:
    """Marks pixels that are lighter than the mean of the square around them.

    Args:
        image: (height, width).
        reach: half the side of the square.
        least: by how much.
        sums: (width + 1,) work space.
        out: (height, width) written: 1 where lighter, 0 elsewhere.
    """
    height, width = image.shape
    for i in range(width):
        total = 0.0
        for j in range(min(reach, height)):
            total += image[j, i]
        sums[i] = total
    for j in range(height):
        if j + reach < height:
            for i in range(width):
                sums[i] += image[j + reach, i]
        if j - reach - 1 >= 0:
            for i in range(width):
                sums[i] -= image[j - reach - 1, i]
        lines = min(j + reach, height - 1) - max(j - reach, 0) + 1
        total = 0.0
        for i in range(min(reach, width)):
            total += sums[i]
        for i in range(width):
            if i + reach < width:
                total += sums[i + reach]
            if i - reach - 1 >= 0:
                total -= sums[i - reach - 1]
            columns = min(i + reach, width - 1) - max(i - reach, 0) + 1
            out[j, i] = 1 if image[j, i] * lines * columns > total + least * lines * columns else 0


@compiled
def spots(marks: ByteRows, stack: IntArray, least: int, most: int, out: FloatRows) -> int:
    """Parts of marked pixels that hang together and have the second moments of an ellipse of their area.

    Args:
        marks: (height, width) 1 where marked; cleared.
        stack: (height * width,) work space.
        least: pixels of the smallest part.
        most: pixels of the largest.
        out: (n, 6) written: x, y, moments xx, xy, yy, and area.

    Returns:
        Their number; n when there may be more.
    """
    height, width = marks.shape
    n = 0
    for line in range(height):
        for column in range(width):
            if marks[line, column] == 0:
                continue
            marks[line, column] = 0
            stack[0] = line * width + column
            depth, area, touches = 1, 0, False
            x = y = xx = xy = yy = 0.0
            while depth > 0:
                depth -= 1
                j, i = stack[depth] // width, stack[depth] % width
                area += 1
                u, v = float(i - column), float(j - line)
                x += u
                y += v
                xx += u * u
                xy += u * v
                yy += v * v
                if i == 0 or j == 0 or i == width - 1 or j == height - 1:
                    touches = True
                if i > 0 and marks[j, i - 1] != 0:
                    marks[j, i - 1] = 0
                    stack[depth] = j * width + i - 1
                    depth += 1
                if i + 1 < width and marks[j, i + 1] != 0:
                    marks[j, i + 1] = 0
                    stack[depth] = j * width + i + 1
                    depth += 1
                if j > 0 and marks[j - 1, i] != 0:
                    marks[j - 1, i] = 0
                    stack[depth] = (j - 1) * width + i
                    depth += 1
                if j + 1 < height and marks[j + 1, i] != 0:
                    marks[j + 1, i] = 0
                    stack[depth] = (j + 1) * width + i
                    depth += 1
            if touches or area < least or area > most:
                continue
            x /= area
            y /= area
            xx = xx / area - x * x + 1.0 / 12.0
            xy = xy / area - x * y
            yy = yy / area - y * y + 1.0 / 12.0
            of_ellipse = 4.0 * math.pi * math.sqrt(max(xx * yy - xy * xy, 1e-12))
            if area < 0.8 * of_ellipse or area > 1.25 * of_ellipse:
                continue
            out[n, 0], out[n, 1] = x + column, y + line
            out[n, 2], out[n, 3], out[n, 4], out[n, 5] = xx, xy, yy, float(area)
            n += 1
            if n == len(out):
                return n
    return n


@compiled
def stand_out(image: FloatRows, found: FloatRows, levels: FloatRows) -> None:
    """Which spots are light all over and dark all around.

    Args:
        image: (height, width).
        found: (n, 6) as `spots` writes them.
        levels: (n, 2) written: dark around and light inside; both the same where it is no such spot.
    """
    for n in range(len(found)):
        xx, xy, yy = found[n, 2], found[n, 3], found[n, 4]
        a = 2.0 * math.sqrt(xx)
        b = 2.0 * xy / math.sqrt(xx)
        c = 2.0 * math.sqrt(max(yy - xy * xy / xx, 1e-9))
        darkest, lightest, light, dark = 1e30, -1e30, 0.0, 0.0
        for k in range(RING):
            turn = 2.0 * math.pi * k / RING
            u, v = a * math.cos(turn), b * math.cos(turn) + c * math.sin(turn)
            inside = between(image, found[n, 0] + 0.45 * u, found[n, 1] + 0.45 * v)
            outside = between(image, found[n, 0] + 1.5 * u, found[n, 1] + 1.5 * v)
            darkest, lightest = min(darkest, inside), max(lightest, outside)
            light += inside / RING
            dark += outside / RING
        contrast = light - dark
        is_spot = darkest > dark + 0.6 * contrast and lightest < dark + 0.45 * contrast
        levels[n, 0] = dark
        levels[n, 1] = light if is_spot else dark
