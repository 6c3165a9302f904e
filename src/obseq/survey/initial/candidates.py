"""Candidate positions of one point: every way in which few of its relations determine it.

The computation is done in the local east, north, up frame of one known neighbour, with parallel plumb lines;
`relations.refine` removes what this neglects.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import field
from typing import NamedTuple, TypeVar

from obseq.dataclass import dataclass
from obseq.survey.initial import closed_forms as forms
from obseq.survey.initial.closed_forms import Plane, Space, minus, plus
from obseq.survey.initial.known import Known, Matrix, times, transposed_times
from obseq.survey.initial.relations import Measured, Relation
from obseq.survey.sights.sights import direction

Item = TypeVar("Item")

_MOST = 5
"""Rays, circles or readings that are combined with each other; more are thinned out evenly."""


class Candidate(NamedTuple):
    """A possible position (frame), its method, and the relations that determine it."""

    position: Space
    method: str
    used: tuple[Relation, ...]
    has_height: bool = True


class _Ray(NamedTuple):
    start: Plane
    azimuth: float
    other: int
    used: tuple[Relation, ...]


class _Circle(NamedTuple):
    centre: Plane
    radius: float
    other: int
    used: tuple[Relation, ...]


class _Reading(NamedTuple):
    target: Plane
    angle: float
    other: int
    used: tuple[Relation, ...]
    length: float | None
    length_used: tuple[Relation, ...]


class _Flat(NamedTuple):
    """A horizontal position in the local frame."""

    position: Plane
    method: str
    used: tuple[Relation, ...]


@dataclass
class Surroundings:
    """The relations of one point, sorted by shape, in the local frame of a known neighbour."""

    known: Known
    relations: list[Relation]
    origin: Space
    vertical: Matrix
    origin_height: float
    local: dict[int, Space] = field(default_factory=dict)
    rays: list[_Ray] = field(default_factory=list)
    circles: list[_Circle] = field(default_factory=list)
    readings: dict[int, list[_Reading]] = field(default_factory=dict)

    def to_frame(self, position: Space) -> Space:
        """A local position in the frame of the computation."""
        return plus(self.origin, transposed_times(self.vertical, position))


def survey_surroundings(known: Known, relations: list[Relation]) -> Surroundings | None:
    """Sorts the relations; None when no neighbour has a position."""
    located = [c.other for c in relations if known.is_settled[c.other]]
    if not located:
        return None
    placed = [other for other in located if known.is_placed(other)]
    reference = (placed or located)[0]
    origin, vertical = known.position_of(reference), known.vertical_of(reference)
    around = Surroundings(known, relations, origin, vertical, known.height_of(origin, vertical))
    for other in located:
        around.local[other] = times(vertical, minus(known.position_of(other), origin))
    _find_circles(around)
    _find_readings(around)
    _find_rays(around)
    return around


def _of_kind(around: Surroundings, *kinds: Measured) -> list[Relation]:
    return [c for c in around.relations if c.kind in kinds]


def _find_circles(around: Surroundings) -> None:
    """Horizontal distances: measured, or reduced by a zenith angle or by known heights."""
    for c in _of_kind(around, Measured.HORIZONTAL, Measured.HORIZONTAL_AT):
        around.circles.append(_Circle(around.local[c.other][:2], c.value, c.other, (c,)))
    zeniths = {c.other: c for c in reversed(_of_kind(around, Measured.ZENITH_AT, Measured.ZENITH))}
    rises = {c.other: c for c in reversed(_of_kind(around, Measured.RISE_AT, Measured.RISE))}
    levels = _of_kind(around, Measured.LEVEL)
    for c in _of_kind(around, Measured.DISTANCE):
        centre = around.local[c.other]
        if c.other in zeniths:
            radius = c.value * math.sin(zeniths[c.other].value)
            around.circles.append(_Circle(centre[:2], radius, c.other, (c, zeniths[c.other])))
            continue
        if c.other in rises:
            difference, reducing = rises[c.other].value, rises[c.other]
        elif levels:
            difference, reducing = levels[0].value - around.origin_height - centre[2], levels[0]
        else:
            continue
        square = (c.value - difference) * (c.value + difference)
        if square > 0.0:
            around.circles.append(_Circle(centre[:2], math.sqrt(square), c.other, (c, reducing)))


def _find_readings(around: Surroundings) -> None:
    """Readings made at the point with an unknown G0, by station, with the horizontal distance if known."""
    circles = {circle.other: circle for circle in reversed(around.circles)}
    for c in _of_kind(around, Measured.READING_AT):
        if c.g0 is None:
            circle = circles.get(c.other)
            length, used = (circle.radius, circle.used) if circle else (None, ())
            reading = _Reading(around.local[c.other][:2], c.value, c.other, (c,), length, used)
            around.readings.setdefault(c.station, []).append(reading)


def _find_rays(around: Surroundings) -> None:
    """Azimuths from known points, and back from an instrument whose zero is known at the point."""
    for c in _of_kind(around, Measured.AZIMUTH):
        around.rays.append(_Ray(around.local[c.other][:2], c.value, c.other, (c,)))
    for c in _of_kind(around, Measured.READING_AT):
        if c.g0 is not None:
            start = around.local[c.other][:2]
            around.rays.append(_Ray(start, c.value + c.g0 + math.pi, c.other, (c,)))
    forward = {ray.other: ray for ray in reversed(around.rays)}
    for readings in around.readings.values():
        _turn_into_rays(around, readings, forward)


def _turn_into_rays(around: Surroundings, readings: list[_Reading], forward: dict[int, _Ray]) -> None:
    """A sight in both directions gives G0 at the point: the other readings become rays."""
    tied = next((reading for reading in readings if reading.other in forward), None)
    if tied is None:
        return
    ray = forward[tied.other]
    for reading in readings:
        if reading is not tied and reading.other not in forward:
            azimuth = ray.azimuth + math.pi - tied.angle + reading.angle + math.pi
            used = (*ray.used, *tied.used, *reading.used)
            around.rays.append(_Ray(reading.target, azimuth, reading.other, used))


def unique_positions(around: Surroundings) -> Iterator[Candidate]:
    """Positions by methods that have one solution."""
    ways = (_by_centring, _by_polar, _by_two_rays, _by_own_readings)
    for flat in itertools.chain.from_iterable(way(around) for way in ways):
        yield from _with_heights(around, flat)
    yield from _by_rays_in_space(around)


def paired_positions(around: Surroundings) -> Iterator[Candidate]:
    """Positions by methods that have two solutions."""
    for flat in itertools.chain(_by_circles(around), _by_reading_and_length(around), _by_ray_and_arc(around)):
        yield from _with_heights(around, flat)
    yield from _by_spheres(around)


def _thinned(items: list[Item]) -> list[Item]:
    """At most `_MOST` items, spread evenly over the list."""
    step = max(1.0, len(items) / _MOST)
    return [items[int(k * step)] for k in range(min(len(items), _MOST))]


def _by_centring(around: Surroundings) -> Iterator[_Flat]:
    """The plan of a point plumb above or below."""
    norths = {c.other: c for c in reversed(_of_kind(around, Measured.NORTH))}
    for east in _of_kind(around, Measured.EAST):
        position = around.local[east.other][:2]
        yield _Flat(position, "centring", (east, norths[east.other]))


def _by_polar(around: Surroundings) -> Iterator[_Flat]:
    circles = {circle.other: circle for circle in reversed(around.circles)}
    for ray in around.rays:
        circle = circles.get(ray.other)
        if circle is not None:
            position = forms.polar(ray.start, ray.azimuth, circle.radius)
            yield _Flat(position, "azimuth and distance", ray.used + circle.used)


def _by_two_rays(around: Surroundings) -> Iterator[_Flat]:
    by_azimuth = sorted(around.rays, key=lambda ray: ray.azimuth % math.pi)
    for a, b in itertools.combinations(_thinned(by_azimuth), 2):
        for position in forms.intersect_rays(a.start, a.azimuth, b.start, b.azimuth):
            yield _Flat(position, "intersection", a.used + b.used)


def _by_own_readings(around: Surroundings) -> Iterator[_Flat]:
    """Free station (two vectors) and resection (three readings)."""
    for readings in around.readings.values():
        vectors = [reading for reading in readings if reading.length is not None]
        for a, b in itertools.combinations(_thinned(vectors), 2):
            yield from _free_station(a, b, a.length or 0.0, b.length or 0.0, "free station")
        for triple in itertools.islice(itertools.combinations(_thinned(readings), 3), 12):
            a, b, c = triple
            for position in forms.resection((a.target, b.target, c.target), (a.angle, b.angle, c.angle)):
                yield _Flat(position, "resection", a.used + b.used + c.used)


def _free_station(a: _Reading, b: _Reading, length_a: float, length_b: float, method: str) -> Iterator[_Flat]:
    vectors = [direction(r.angle, math.pi / 2.0, length)[:2] for r, length in ((a, length_a), (b, length_b))]
    solution = forms.from_two_vectors(a.target, vectors[0], b.target, vectors[1])
    if solution is not None:
        yield _Flat(solution[0], method, a.used + b.used + a.length_used + b.length_used)


def _by_circles(around: Surroundings) -> Iterator[_Flat]:
    circles = _thinned(around.circles)
    for ray in _thinned(around.rays):
        for circle in circles:
            if circle.other != ray.other:
                for position in forms.ray_and_circle(ray.start, ray.azimuth, circle.centre, circle.radius):
                    yield _Flat(position, "direction and distance", ray.used + circle.used)
    for a, b in itertools.combinations(circles, 2):
        for position in forms.two_circles(a.centre, a.radius, b.centre, b.radius):
            yield _Flat(position, "two distances", a.used + b.used)


def _by_reading_and_length(around: Surroundings) -> Iterator[_Flat]:
    """Two readings at the point and one distance: a second distance by the law of cosines."""
    for readings in around.readings.values():
        for a, b in itertools.permutations(_thinned(readings), 2):
            if a.length is None or b.length is not None:
                continue
            base = math.hypot(b.target[0] - a.target[0], b.target[1] - a.target[1])
            for length in forms.second_lengths(base, a.length, b.angle - a.angle):
                yield from _free_station(a, b, a.length, length, "angle and distance")


def _by_ray_and_arc(around: Surroundings) -> Iterator[_Flat]:
    for ray in _thinned(around.rays)[:3]:
        for readings in around.readings.values():
            for a, b in itertools.combinations(_thinned(readings)[:4], 2):
                if ray.other in (a.other, b.other):
                    continue
                angle = b.angle - a.angle
                for position in forms.ray_and_arc(ray.start, ray.azimuth, a.target, b.target, angle):
                    yield _Flat(position, "direction and angle", ray.used + a.used + b.used)


def _with_heights(around: Surroundings, flat: _Flat) -> Iterator[Candidate]:
    """The horizontal position at the heights that its relations allow; without height if there is none."""
    heights = list(heights_at(around, flat.position, flat.used))
    for height, relation in heights:
        used = flat.used if relation in flat.used else (*flat.used, relation)
        yield Candidate(around.to_frame((*flat.position, height)), flat.method, used)
    if not heights:
        others = [around.local[c.other][2] for c in flat.used if c.other in around.local]
        height = sum(others) / len(others)
        yield Candidate(around.to_frame((*flat.position, height)), flat.method, flat.used, has_height=False)


def heights_at(
    around: Surroundings, position: Plane, preferred: tuple[Relation, ...] = ()
) -> Iterator[tuple[float, Relation]]:
    """Local heights at a horizontal position: one if some relation gives it, else both of a distance."""

    def rank(c: Relation) -> tuple[bool, bool, float]:
        is_angle = c.kind in (Measured.ZENITH, Measured.ZENITH_AT)
        return c not in preferred, is_angle, _flat_distance(around, c, position)

    direct = (
        Measured.LEVEL,
        Measured.RISE,
        Measured.RISE_AT,
        Measured.ZENITH,
        Measured.ZENITH_AT,
    )
    for c in sorted(_of_kind(around, *direct), key=rank):
        height = _height_from(around, c, _flat_distance(around, c, position))
        if height is not None:
            yield height, c
            return
    for c in sorted(_of_kind(around, Measured.DISTANCE), key=rank)[:1]:
        half = math.sqrt(max(c.value**2 - _flat_distance(around, c, position) ** 2, 0.0))
        for side in sorted({-half, half}):
            yield around.local[c.other][2] + side, c


def _flat_distance(around: Surroundings, c: Relation, position: Plane) -> float:
    other = around.local.get(c.other)
    return 0.0 if other is None else math.hypot(position[0] - other[0], position[1] - other[1])


def _height_from(around: Surroundings, c: Relation, flat_distance: float) -> float | None:
    if c.kind == Measured.LEVEL:
        return c.value - around.origin_height
    base = around.local[c.other][2]
    if c.kind in (Measured.RISE, Measured.RISE_AT):
        return base + (c.value - c.lift) * (1.0 if c.kind == Measured.RISE else -1.0)
    if math.sin(c.value) < 1e-6:
        return None
    rise = flat_distance / math.tan(c.value) - c.lift
    return base + (rise if c.kind == Measured.ZENITH else -rise)


def _space_rays(around: Surroundings) -> list[tuple[Space, Space, tuple[Relation, ...], int]]:
    """Half-lines in space: an azimuth and a zenith angle with the same known point."""
    zeniths = {c.other: c for c in reversed(_of_kind(around, Measured.ZENITH_AT, Measured.ZENITH))}
    rays = []
    for ray in around.rays:
        zenith = zeniths.get(ray.other)
        if zenith is not None:
            is_there = zenith.kind == Measured.ZENITH
            angle, lift = (zenith.value, -zenith.lift) if is_there else (math.pi - zenith.value, zenith.lift)
            x, y, z = around.local[ray.other]
            start = (x, y, z + lift)
            rays.append((start, direction(ray.azimuth, angle), (*ray.used, zenith), ray.other))
    return _thinned(rays)


def _by_rays_in_space(around: Surroundings) -> Iterator[Candidate]:
    """Intersection in space, for points in the vertical plane of two stations; direction and height."""
    rays = _space_rays(around)
    for a, b in itertools.combinations(rays, 2):
        for position in forms.nearest_of_two_rays(a[0], a[1], b[0], b[1]):
            yield Candidate(around.to_frame(position), "intersection in space", a[2] + b[2])
    levels = _of_kind(around, Measured.LEVEL)
    for start, way, used, _ in rays:
        for level in levels[:1]:
            height = level.value - around.origin_height - start[2]
            if way[2] * height > 0.0 and abs(height) < 1e6 * abs(way[2]):
                t = height / way[2]
                position = (start[0] + t * way[0], start[1] + t * way[1], start[2] + height)
                yield Candidate(around.to_frame(position), "direction and height", (*used, level))


def _by_spheres(around: Surroundings) -> Iterator[Candidate]:
    distances = [c for c in _of_kind(around, Measured.DISTANCE) if c.other in around.local]
    spheres = _thinned(distances)
    for start, way, used, other in _space_rays(around):
        for c in spheres:
            if c.other != other:
                for position in forms.ray_and_sphere(start, way, around.local[c.other], c.value):
                    yield Candidate(around.to_frame(position), "direction and distance", (*used, c))
    for a, b, c in itertools.islice(itertools.combinations(spheres, 3), 8):
        centres = (around.local[a.other], around.local[b.other], around.local[c.other])
        for position in forms.trilateration(centres, (a.value, b.value, c.value)):
            yield Candidate(around.to_frame(position), "trilateration", (a, b, c))
