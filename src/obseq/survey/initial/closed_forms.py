"""Positions from a minimum of observations, in closed form, as a surveyor computes them by hand.

Plane coordinates are (east, north); azimuths are clockwise from north, in radians. Functions that may have
several solutions return all of them, in a fixed order; none is preferred.
"""

from __future__ import annotations

import math

Plane = tuple[float, float]
Space = tuple[float, float, float]
TURN = 2.0 * math.pi
_LARGEST_COTANGENT = 1e9


def azimuth(a: Plane, b: Plane) -> float:
    """Azimuth of b seen from a."""
    return math.atan2(b[0] - a[0], b[1] - a[1])


def wrap(angle: float) -> float:
    """The angle in [-pi, pi]."""
    return math.remainder(angle, TURN)


def polar(a: Plane, direction: float, length: float) -> Plane:
    """The point at an azimuth and a distance from a."""
    return a[0] + length * math.sin(direction), a[1] + length * math.cos(direction)


def intersect_rays(a: Plane, azimuth_a: float, b: Plane, azimuth_b: float) -> list[Plane]:
    """Intersection of two half-lines; empty when they are parallel or meet behind an end."""
    sine = math.sin(azimuth_a - azimuth_b)
    if sine == 0.0:
        return []
    east, north = b[0] - a[0], b[1] - a[1]
    length_a = (east * math.cos(azimuth_b) - north * math.sin(azimuth_b)) / sine
    length_b = (east * math.cos(azimuth_a) - north * math.sin(azimuth_a)) / sine
    return [polar(a, azimuth_a, length_a)] if length_a > 0.0 and length_b > 0.0 else []


def ray_and_circle(a: Plane, azimuth_a: float, centre: Plane, radius: float) -> list[Plane]:
    """Points of a half-line at a distance from a centre: 0, 1 or 2; the tangent point for a near miss."""
    east, north = centre[0] - a[0], centre[1] - a[1]
    along = east * math.sin(azimuth_a) + north * math.cos(azimuth_a)
    across = east * math.cos(azimuth_a) - north * math.sin(azimuth_a)
    half = _half_chord(radius, across)
    if half is None:
        return []
    lengths = {along - half, along + half}
    return [polar(a, azimuth_a, length) for length in sorted(lengths) if length > 0.0]


def two_circles(a: Plane, radius_a: float, b: Plane, radius_b: float) -> list[Plane]:
    """Points at given distances from a and b: left of a -> b, then right; one twice for a near miss."""
    base = math.hypot(b[0] - a[0], b[1] - a[1])
    if base == 0.0:
        return []
    along = (base * base + radius_a * radius_a - radius_b * radius_b) / (2.0 * base)
    half = _half_chord(radius_a, along)
    if half is None:
        return []
    east, north = (b[0] - a[0]) / base, (b[1] - a[1]) / base
    return [
        (a[0] + along * east + side * north, a[1] + along * north - side * east) for side in (-half, half)
    ]


def _half_chord(radius: float, offset: float) -> float | None:
    """Half the chord at a distance from the centre; 0 when it is missed by less than 2 %."""
    square = (radius - offset) * (radius + offset)
    if square >= 0.0:
        return math.sqrt(square)
    return 0.0 if abs(offset) <= 1.02 * radius else None


def from_two_vectors(a: Plane, vector_a: Plane, b: Plane, vector_b: Plane) -> tuple[Plane, float] | None:
    """Free station: an instrument sees a and b at known vectors of its own plumb frame.

    Returns:
        The position of the instrument and G0 (azimuth of its zero); None when a and b coincide.
    """
    seen, real = azimuth(vector_a, vector_b), azimuth(a, b)
    if a == b or vector_a == vector_b:
        return None
    g0 = wrap(real - seen)
    east = [p[0] - v[0] * math.cos(g0) - v[1] * math.sin(g0) for p, v in ((a, vector_a), (b, vector_b))]
    north = [p[1] + v[0] * math.sin(g0) - v[1] * math.cos(g0) for p, v in ((a, vector_a), (b, vector_b))]
    return (sum(east) / 2.0, sum(north) / 2.0), g0


def second_lengths(base: float, length_a: float, angle: float) -> list[float]:
    """Distances to b by the law of cosines: a is at `length_a`, a to b is `base`, the angle a, b is seen."""
    across = length_a * math.sin(angle)
    half = _half_chord(base, across)
    if half is None:
        return []
    along = length_a * math.cos(angle)
    return [length for length in sorted({along - half, along + half}) if length > 0.0]


def resection(targets: tuple[Plane, Plane, Plane], readings: tuple[float, float, float]) -> list[Plane]:
    """Three-point resection (Pierlot's ToTal form); empty on the circle through the targets.

    The formula holds for lines, not half-lines: the caller checks the sense of the readings.
    """
    (x1, y1), (x2, y2), (x3, y3) = targets
    x1, y1, x3, y3 = x1 - x2, y1 - y2, x3 - x2, y3 - y2
    t12, t23 = _cotangent(readings[0] - readings[1]), _cotangent(readings[1] - readings[2])
    t31 = _cotangent(readings[2] - readings[0])
    x12, y12 = x1 + t12 * y1, y1 - t12 * x1
    x23, y23 = x3 - t23 * y3, y3 + t23 * x3
    x31, y31 = (x3 + x1) + t31 * (y3 - y1), (y3 + y1) - t31 * (x3 - x1)
    k31 = x1 * x3 + y1 * y3 + t31 * (x1 * y3 - x3 * y1)
    determinant = (x12 - x23) * (y23 - y31) - (y12 - y23) * (x23 - x31)
    if determinant == 0.0:
        return []
    return [(x2 + k31 * (y12 - y23) / determinant, y2 + k31 * (x23 - x12) / determinant)]


def _cotangent(angle: float) -> float:
    sine = math.sin(angle)
    large = math.copysign(_LARGEST_COTANGENT, sine * math.cos(angle))
    return math.cos(angle) / sine if abs(sine) * _LARGEST_COTANGENT > 1.0 else large


def ray_and_arc(a: Plane, azimuth_a: float, b: Plane, c: Plane, angle: float) -> list[Plane]:
    """Points of a half-line that see b and c under an angle (reading of c minus reading of b)."""

    def misfit(length: float) -> float:
        east, north = polar(a, azimuth_a, length)
        first, second = (b[0] - east, b[1] - north), (c[0] - east, c[1] - north)
        cross = second[0] * first[1] - second[1] * first[0]
        dot = first[0] * second[0] + first[1] * second[1]
        return cross * math.cos(angle) - dot * math.sin(angle)

    scale = max(math.hypot(b[0] - a[0], b[1] - a[1]), math.hypot(c[0] - a[0], c[1] - a[1]))
    before, here, after = misfit(-scale), misfit(0.0), misfit(scale)
    roots = _roots((after + before) / 2.0 - here, (after - before) / 2.0, here)
    return [polar(a, azimuth_a, root * scale) for root in roots if root > 0.0]


def _roots(a: float, b: float, c: float) -> list[float]:
    """Real roots of a x^2 + b x + c, in increasing order."""
    if abs(a) <= 1e-14 * (abs(b) + abs(c)):
        return [-c / b] if b != 0.0 else []
    square = b * b - 4.0 * a * c
    if square < 0.0:
        return []
    q = -0.5 * (b + math.copysign(math.sqrt(square), b))
    return sorted({q / a, c / q} if q != 0.0 else {0.0})


def ray_and_sphere(a: Space, direction: Space, centre: Space, radius: float) -> list[Space]:
    """Points of a half-line in space (unit direction) at a distance from a centre."""
    to_centre = minus(centre, a)
    along = _dot(to_centre, direction)
    across = math.sqrt(max(_dot(to_centre, to_centre) - along * along, 0.0))
    half = _half_chord(radius, across)
    if half is None:
        return []
    return [_along(a, direction, length) for length in sorted({along - half, along + half}) if length > 0.0]


def nearest_of_two_rays(a: Space, direction_a: Space, b: Space, direction_b: Space) -> list[Space]:
    """Middle of the shortest segment between two half-lines in space (unit directions)."""
    cosine, offset = _dot(direction_a, direction_b), minus(b, a)
    square_sine = 1.0 - cosine * cosine
    if square_sine <= 1e-12:
        return []
    along_a, along_b = _dot(offset, direction_a), _dot(offset, direction_b)
    length_a = (along_a - cosine * along_b) / square_sine
    length_b = (cosine * along_a - along_b) / square_sine
    if length_a <= 0.0 or length_b <= 0.0:
        return []
    first, second = _along(a, direction_a, length_a), _along(b, direction_b, length_b)
    return [((first[0] + second[0]) / 2.0, (first[1] + second[1]) / 2.0, (first[2] + second[2]) / 2.0)]


def trilateration(centres: tuple[Space, Space, Space], radii: tuple[float, float, float]) -> list[Space]:
    """The two points at given distances from three centres (mirrored by their plane)."""
    a, b, c = centres
    base = math.sqrt(_dot(minus(b, a), minus(b, a)))
    if base == 0.0:
        return []
    first = scaled(minus(b, a), 1.0 / base)
    along = _dot(minus(c, a), first)
    rest = minus(minus(c, a), scaled(first, along))
    across = math.sqrt(_dot(rest, rest))
    if across <= 1e-9 * base:
        return []
    second = scaled(rest, 1.0 / across)
    x = (radii[0] ** 2 - radii[1] ** 2 + base * base) / (2.0 * base)
    y = (radii[0] ** 2 - radii[2] ** 2 + along * along + across * across - 2.0 * along * x) / (2.0 * across)
    half = _half_chord(radii[0], math.hypot(x, y))
    if half is None:
        return []
    foot, third = _along(_along(a, first, x), second, y), _cross(first, second)
    return [_along(foot, third, height) for height in sorted({-half, half})]


def _dot(a: Space, b: Space) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Space, b: Space) -> Space:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def minus(a: Space, b: Space) -> Space:
    """Difference of two points."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scaled(a: Space, factor: float) -> Space:
    """A vector times a number."""
    return a[0] * factor, a[1] * factor, a[2] * factor


def plus(a: Space, b: Space) -> Space:
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _along(a: Space, direction: Space, length: float) -> Space:
    return a[0] + length * direction[0], a[1] + length * direction[1], a[2] + length * direction[2]
