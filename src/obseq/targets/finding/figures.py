"""The compiled loop that fits chequered discs roughly, and says how much of an image they explain."""

from __future__ import annotations

import math

from obseq.arrays import FloatArray, FloatRows
from obseq.compilation import compiled
from obseq.leastsquares.loops.temporaries import backward, factor_group, forward
from obseq.targets.drawing.rendering import normal_equations
from obseq.targets.finding.detection import between

RADII = (0.25, 0.4, 0.55, 0.7, 0.85, 1.0)
"""Circles in a disc on which it is looked at, in its radii."""
PLACES = 16
"""On each of them."""
MOST_PLACES = (len(RADII) + 1) * PLACES
NARROWEST = 0.04
"""Width of sheet around a disc, in its radii, from which this is looked at too."""
BLUR, SHARPEST, DULLEST = 1.0, 0.4, 4.0
"""Sigma of the point spread, pixels: at first (images have 0.6 to 1.2), the least, and the most."""
INTERPOLATED = 4.0 / 9.0
"""Mean variance of a place between pixels, over that of a pixel."""
HALF = 0.5
"""Share from which on a disc is fitted at all: whatever explains less is nearer to nothing."""
STEPS, ENOUGH = 3, 0.005
"""Of the fit at most: from the ends of its lines, a disc that is tilted by 70 degrees needs three. None
follows one that explains hardly more."""
LONGEST = 0.3
"""Share of the disc by which a step changes it at most: by more, its quadrants are others."""
UNKNOWNS = 9
"""x, y, the half axes at which light turns dark and dark turns light, point spread; gain, offset."""
DAMPING = 1e-3
"""Of the normal matrix: a share of variances that nobody will miss."""


@compiled
def fit_discs(
    image: FloatRows,
    sign: float,
    noise: float,
    gap: float,
    found: FloatRows,
    share: FloatArray,
    work: FloatRows,
    slopes: FloatRows,
    residuals: FloatArray,
    discs: FloatRows,
    normal: FloatRows,
) -> None:
    """Fits chequered discs with the sheet around them, where they explain half of it or more.

    In the discs light and dark quadrants alternate, blurred; in the middle of the gap to the code the sheet
    is light all around, which chance seldom makes.

    Args:
        image: (height, width).
        sign: 1, or -1 for light and dark exchanged.
        noise: standard deviation of a pixel.
        gap: width of the sheet between a disc and its code, in radii of the disc.
        found: (n, 11): x, y, strength, dark and light level, where light turns dark, by how much further dark
            turns light, the ellipse q11, q12, q22, and the point spread; all but strength is written anew,
            levels with the sign of light and dark.
        share: (n,) written: of the grey variance, but for noise, that a disc explains.
        work: (`MOST_PLACES`, 9) overwritten.
        slopes: (`MOST_PLACES`, `UNKNOWNS`) overwritten.
        residuals: (`MOST_PLACES`,) overwritten.
        discs: (3, `UNKNOWNS`) overwritten: the best, a trial, and the step between.
        normal: (`UNKNOWNS`, `UNKNOWNS`) overwritten.
    """
    best, trial, step = discs[0], discs[1], discs[2]
    circles = len(RADII) + (1 if gap > NARROWEST else 0)
    count = circles * PLACES
    for n in range(len(found)):
        _begin(found[n], best)
        for circle in range(circles):
            radius = RADII[circle] if circle < len(RADII) else 1.0 + 0.5 * gap
            for k in range(PLACES):
                turn, row = 2.0 * math.pi * k / PLACES, circle * PLACES + k
                first, second = radius * math.cos(turn), radius * math.sin(turn)
                work[row, 0] = best[0] + first * best[2] + second * best[4]
                work[row, 1] = best[1] + first * best[3] + second * best[5]
                work[row, 2] = sign * between(image, work[row, 0], work[row, 1])
        share[n] = _explained(work, count, best, noise)
        if share[n] < HALF:
            continue
        for _ in range(STEPS):
            if not _has_step(work, count, best, slopes, residuals, normal, step):
                break
            _move(best, step, trial)
            here = _explained(work, count, trial, noise)
            gained = here - share[n]
            if not gained > 0.0:
                break
            share[n] = here
            for k in range(UNKNOWNS):
                best[k] = trial[k]
            if gained < ENOUGH:
                break
        _end(best, found[n])


@compiled
def _begin(row: FloatArray, disc: FloatArray) -> None:
    """The half axes of a disc from the angles of its lines and its ellipse."""
    for k in range(2):
        turn = row[5] + k * row[6]
        c, s = math.cos(turn), math.sin(turn)
        length = 1.0 / math.sqrt(row[7] * c * c + 2.0 * row[8] * c * s + row[9] * s * s)
        disc[k], disc[2 + 2 * k], disc[3 + 2 * k] = row[k], c * length, s * length
    disc[6] = BLUR


@compiled
def _end(disc: FloatArray, row: FloatArray) -> None:
    """The angles of the lines and the ellipse of a disc from its half axes; its levels and point spread."""
    p, q, u, v = disc[2], disc[3], disc[4], disc[5]
    whole = (p * v - q * u) ** 2
    span = (math.atan2(v, u) - math.atan2(q, p)) / math.pi
    row[0], row[1], row[5], row[6] = disc[0], disc[1], math.atan2(q, p), math.pi * (span - math.floor(span))
    row[7], row[8], row[9] = (q * q + v * v) / whole, -(p * q + u * v) / whole, (p * p + u * u) / whole
    row[3], row[4], row[10] = disc[8] - disc[7], disc[8] + disc[7], disc[6]


@compiled
def _error_function(x: float) -> tuple[float, float]:
    """The error function to 2e-7, and `exp(-x^2)`: Hastings' formula (Abramowitz and Stegun, 7.1.26)."""
    bell, t = math.exp(-x * x), 1.0 / (1.0 + 0.3275911 * abs(x))
    tail = ((((1.061405429 * t - 1.453152027) * t + 1.421413741) * t - 0.284496736) * t + 0.254829592) * t
    share = 1.0 - tail * bell
    return (share if x >= 0.0 else -share), bell


@compiled
def _explained(work: FloatRows, count: int, disc: FloatArray, noise: float) -> float:
    """The share of the grey variance that a disc explains; gain and offset are written to it.

    Args:
        work: (count, 9): x, y, grey level; written: what is drawn there, its slopes along the first and the
            second half axis and with the point spread, and the place in half axes.
        count: of places.
        disc: (9,) unknowns.
        noise: standard deviation of a pixel.
    """
    p, q, u, v = disc[2], disc[3], disc[4], disc[5]
    whole = p * v - q * u
    area, scale = abs(whole), 1.0 / (math.sqrt(2.0) * disc[6])
    of_first, of_second = scale * area / math.hypot(u, v), scale * area / math.hypot(p, q)
    peak, one_over = 2.0 / math.sqrt(math.pi), 1.0 / whole
    s = ss = e = ee = se = 0.0
    for row in range(count):
        x, y, value = work[row, 0] - disc[0], work[row, 1] - disc[1], work[row, 2]
        first, second = (x * v - y * u) * one_over, (y * p - x * q) * one_over
        # the way from the edge, along its normal: (1 - radius) over the length of the gradient
        radius = math.sqrt(first * first + second * second)
        a, b = first * v - second * q, second * p - first * u
        steep = scale * area * radius / math.sqrt(a * a + b * b)
        away = steep * (1.0 - radius)
        share, bell = _error_function(away)
        inside, edge = 0.5 * (1.0 + share), -0.5 * peak * steep * bell / radius
        a, b = of_first * first, of_second * second
        one, one_bell = _error_function(a)
        other, other_bell = _error_function(b)
        one_slope, other_slope = peak * one_bell, peak * other_bell
        drawn, ink = 1.0 - inside - inside * one * other, 1.0 + one * other
        work[row, 3] = drawn
        work[row, 4] = -ink * edge * first - inside * one_slope * of_first * other
        work[row, 5] = -ink * edge * second - inside * one * other_slope * of_second
        spread = 0.5 * ink * peak * bell * away
        work[row, 6] = (spread + inside * (one_slope * a * other + one * other_slope * b)) / disc[6]
        work[row, 7], work[row, 8] = first, second
        s += value
        ss += value * value
        e += drawn
        ee += drawn * drawn
        se += value * drawn
    whole, common, own = ss - s * s / count, se - s * e / count, ee - e * e / count
    if not (common > 0.0 and own > 0.0 and whole > 0.0):
        return 0.0
    disc[7] = common / own
    disc[8] = (s - disc[7] * e) / count
    left = whole - common * disc[7] - INTERPOLATED * noise * noise * count
    found: float = 1.0 - max(left, 0.0) / whole
    return found


@compiled
def _has_step(
    work: FloatRows,
    count: int,
    disc: FloatArray,
    slopes: FloatRows,
    residuals: FloatArray,
    normal: FloatRows,
    step: FloatArray,
) -> bool:
    """Whether there is a step of least squares from a disc, as `_explained` left it; it is written."""
    p, q, u, v = disc[2], disc[3], disc[4], disc[5]
    gain = disc[7] / (p * v - q * u)
    for k in range(count):
        row, place = slopes[k, :], work[k, :]
        x, y = gain * (place[5] * q - place[4] * v), gain * (place[4] * u - place[5] * p)
        row[0], row[1], row[8] = x, y, 1.0
        row[2], row[3], row[4], row[5] = place[7] * x, place[7] * y, place[8] * x, place[8] * y
        row[6], row[7] = disc[7] * place[6], place[3]
        residuals[k] = place[2] - disc[8] - disc[7] * place[3]
    normal_equations(slopes[:count], residuals[:count], normal, step)
    if factor_group(normal, UNKNOWNS, DAMPING) >= 0:
        return False
    forward(normal, UNKNOWNS, step)
    backward(normal, UNKNOWNS, step)
    return True


@compiled
def _move(disc: FloatArray, step: FloatArray, out: FloatArray) -> None:
    """A disc after a step, or as much of it as may be."""
    size = math.sqrt(abs(disc[2] * disc[5] - disc[3] * disc[4]))
    most = 0.0
    for k in range(6):
        most = max(most, abs(step[k]))
    share = min(1.0, LONGEST * size / most) if most > 0.0 else 1.0
    for k in range(UNKNOWNS):
        out[k] = disc[k] + share * step[k]
    out[6] = min(max(out[6], SHARPEST), DULLEST)
