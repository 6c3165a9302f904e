"""The compiled loops of ring targets: the ellipse of a spot's edge, and the levels of the bits around it."""

from __future__ import annotations

import math

from obseq.arrays import FloatArray, FloatRows
from obseq.compilation import compiled
from obseq.leastsquares.loops.temporaries import backward, factor_group, forward
from obseq.targets.finding.detection import between

RAYS = 32
"""Rays from the middle of a spot to its edge."""
FEWEST_RAYS = 26
"""Of them, those that must meet the edge."""
NEAREST, FARTHEST = 0.4, 1.7
"""Of the half axes: where rays begin and end."""
FEWEST_STEPS, MOST_STEPS = 14, 60
"""Of a ray; between them, four in a pixel."""
CONIC = 5
"""Coefficients of `a x^2 + b x y + c y^2 + d x + e y = 1`."""
OFF_EDGE, OFF_LARGE_EDGE = 0.2, 25.0
"""Pixels by which the edge may differ from its ellipse in the mean; twice as many at such half axes."""
THREADS = 5
"""Radii in the middle half of the ring of the code, whose median is read."""
SKIPPED = 5
"""Of a bit, one part of so many at each end is not read: it may show its neighbour."""
PHASE, SCATTER, FIRST_BIT = 0, 1, 2
"""Where `ring_bits` writes."""


@compiled
def edge_ellipses(image: FloatRows, sign: float, work: FloatRows, spots: FloatRows) -> None:
    """The ellipses on which spots have the level between light and dark.

    Args:
        image: (height, width).
        sign: 1 for light spots, -1 for dark ones: levels have that sign then.
        work: (`CONIC` + 2, `RAYS`) overwritten.
        spots: (n, 8) x, y, both half axes (x and y of the first, of the second), dark level around and light
            level inside; place and axes are written anew, x is not a number where there is no ellipse.
    """
    for n in range(len(spots)):
        spot = spots[n]
        if not (_meets_edge(image, sign, spot, work[CONIC]) and _fits_ellipse(spot, work)):
            spot[0] = math.nan


@compiled
def _meets_edge(image: FloatRows, sign: float, spot: FloatArray, reaches: FloatArray) -> bool:
    """Whether most rays meet the edge: where, in half axes, is written; 0 where they do not."""
    length = math.sqrt(abs(spot[2] * spot[5] - spot[3] * spot[4]))
    middle = 0.5 * (spot[6] + spot[7])
    steps = max(FEWEST_STEPS, min(MOST_STEPS, math.ceil(4.0 * (FARTHEST - NEAREST) * length)))
    step = (FARTHEST - NEAREST) / (steps - 1)
    missed = 0
    for ray in range(RAYS):
        turn = 2.0 * math.pi * ray / RAYS
        c, s = math.cos(turn), math.sin(turn)
        u, v = c * spot[2] + s * spot[4], c * spot[3] + s * spot[5]
        reaches[ray], last = 0.0, 0.0
        for k in range(steps):
            reach = NEAREST + k * step
            value = sign * between(image, spot[0] + reach * u, spot[1] + reach * v) - middle
            if last > 0.0 and value <= 0.0:
                reaches[ray] = reach - step * value / (value - last)
                break
            last = value
        missed += reaches[ray] == 0.0
        if missed > RAYS - FEWEST_RAYS:
            return False
    return True


@compiled
def _fits_ellipse(spot: FloatArray, work: FloatRows) -> bool:
    """Whether an ellipse goes through the ends of the rays: its place and half axes are written.

    The conic is found by linear least squares in the half axes of the spot, where it is nearly a circle.
    """
    reaches, conic = work[CONIC], work[CONIC + 1]
    for i in range(CONIC):
        conic[i] = 0.0
        for j in range(CONIC):
            work[i, j] = 0.0
    for ray in range(RAYS):
        turn = 2.0 * math.pi * ray / RAYS
        x, y = reaches[ray] * math.cos(turn), reaches[ray] * math.sin(turn)
        if reaches[ray] > 0.0:
            row = (x * x, x * y, y * y, x, y)
            for i in range(CONIC):
                conic[i] += row[i]
                for j in range(i + 1):
                    work[i, j] += row[i] * row[j]
    if factor_group(work, CONIC, 0.0) >= 0:
        return False
    forward(work, CONIC, conic)
    backward(work, CONIC, conic)
    a, b, c, d, e = conic[0], 0.5 * conic[1], conic[2], 0.5 * conic[3], 0.5 * conic[4]
    whole = a * c - b * b
    if not (a > 0.0 and whole > 0.0):
        return False
    x, y = (b * e - c * d) / whole, (b * d - a * e) / whole
    size = 1.0 - d * x - e * y
    # the ellipse about its middle: (p - m)' [a b; b c] (p - m) = size; its axes are the inverse's root
    p, q = math.sqrt(size * c / whole), -b * math.sqrt(size / (whole * c))
    v = math.sqrt(size / c)
    length = math.sqrt(p * v * abs(spot[2] * spot[5] - spot[3] * spot[4]))
    if not _is_near(reaches, x, y, a / size, b / size, c / size, length):
        return False
    one, two, three, four = spot[2], spot[3], spot[4], spot[5]
    spot[0] += x * one + y * three
    spot[1] += x * two + y * four
    spot[2], spot[3] = p * one + q * three, p * two + q * four
    spot[4], spot[5] = v * three, v * four
    return True


@compiled
def _is_near(reaches: FloatArray, x: float, y: float, a: float, b: float, c: float, length: float) -> bool:
    """Whether the ends of the rays lie on an ellipse of a mean half axis, pixels."""
    off, count = 0.0, 0
    for ray in range(RAYS):
        if reaches[ray] > 0.0:
            turn = 2.0 * math.pi * ray / RAYS
            u, v = reaches[ray] * math.cos(turn) - x, reaches[ray] * math.sin(turn) - y
            off += abs(math.sqrt(a * u * u + 2.0 * b * u * v + c * v * v) - 1.0)
            count += 1
    return off / count * length <= OFF_EDGE * (1.0 + length / OFF_LARGE_EDGE)


@compiled
def light_share(
    image: FloatRows, sign: float, spot: FloatArray, radius: float, places: int, limit: float
) -> float:
    """The share of a ring around a spot that is lighter than a limit.

    Args:
        image: (height, width).
        sign: 1 for light spots, -1 for dark ones.
        spot: (8,) as `edge_ellipses` writes it.
        radius: of the ring, in half axes.
        places: on it.
        limit: a level with that sign.
    """
    count = 0
    for k in range(places):
        turn = 2.0 * math.pi * (k + 0.5) / places
        c, s = radius * math.cos(turn), radius * math.sin(turn)
        x, y = spot[0] + c * spot[2] + s * spot[4], spot[1] + c * spot[3] + s * spot[5]
        count += sign * between(image, x, y) > limit
    share: float = count / places
    return share


@compiled
def ring_bits(
    image: FloatRows,
    sign: float,
    spot: FloatArray,
    begin: float,
    end: float,
    cell: int,
    levels: FloatArray,
    out: FloatArray,
) -> None:
    """The levels of the bits of the ring around a spot, cut where they scatter least.

    Args:
        image: (height, width).
        sign: 1 for light spots, -1 for dark ones: levels have that sign then.
        spot: (8,) as `edge_ellipses` writes it.
        begin: inner radius of the ring, in half axes.
        end: and outer.
        cell: places in a bit.
        levels: (bits * cell + `THREADS`,) overwritten.
        out: (2 + bits,) written: the place where the first bit begins, the mean scatter within bits over that
            of all, infinite where there is none, and the mean level of each bit.
    """
    bits = len(out) - FIRST_BIT
    places = bits * cell
    whole = _read(image, sign, spot, begin, end, places, levels)
    skip, best = max(1, cell // SKIPPED), math.inf
    for phase in range(cell):
        scatter = 0.0
        for bit in range(bits):
            scatter += _scatter(levels, places, phase + bit * cell + skip, cell - 2 * skip)[1] / bits
        if scatter < best:
            best, out[PHASE] = scatter, phase
    out[SCATTER] = best / whole if whole > 0.0 else math.inf
    for bit in range(bits):
        first = int(out[PHASE]) + bit * cell + skip
        out[FIRST_BIT + bit] = _scatter(levels, places, first, cell - 2 * skip)[0]


@compiled
def _read(
    image: FloatRows,
    sign: float,
    spot: FloatArray,
    begin: float,
    end: float,
    places: int,
    levels: FloatArray,
) -> float:
    """The levels of the places of a ring, medians across it; their standard deviation."""
    for k in range(places):
        turn = 2.0 * math.pi * (k + 0.5) / places
        c, s = math.cos(turn), math.sin(turn)
        u, v = c * spot[2] + s * spot[4], c * spot[3] + s * spot[5]
        for thread in range(THREADS):
            radius = begin + (end - begin) * (0.25 + 0.5 * thread / (THREADS - 1))
            value = sign * between(image, spot[0] + radius * u, spot[1] + radius * v)
            at = places + thread
            while at > places and levels[at - 1] > value:
                levels[at] = levels[at - 1]
                at -= 1
            levels[at] = value
        levels[k] = levels[places + THREADS // 2]
    return _scatter(levels, places, 0, places)[1]


@compiled
def _scatter(levels: FloatArray, places: int, first: int, count: int) -> tuple[float, float]:
    """Mean and standard deviation of some places of a ring, from one on."""
    mean = square = 0.0
    for k in range(first, first + count):
        mean += levels[k % places] / count
    for k in range(first, first + count):
        square += (levels[k % places] - mean) ** 2
    return mean, math.sqrt(square / count)
