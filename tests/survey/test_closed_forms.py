"""Every closed form finds the point that the observations were computed from."""

import math
import random

import pytest

from obseq.survey.initial import closed_forms as forms

TURN = 2.0 * math.pi


def nearest(solutions, point):
    return min((math.dist(solution, point) for solution in solutions), default=math.inf)


@pytest.fixture(params=range(40))
def scene(request):
    """A point to find, three known ones and a circle zero, anywhere in a square of 200 m."""
    chance = random.Random(request.param)
    plane = [(chance.uniform(-100, 100), chance.uniform(-100, 100)) for _ in range(4)]
    space = [tuple(chance.uniform(-100, 100) for _ in range(3)) for _ in range(4)]
    return plane, space, chance.uniform(-3, 3)


def test_plane(scene):
    (p, a, b, c), _, g0 = scene
    to = {q: forms.azimuth(q, p) for q in (a, b)}
    readings = [forms.azimuth(p, q) - g0 for q in (a, b, c)]
    assert nearest(forms.intersect_rays(a, to[a], b, to[b]), p) < 1e-6
    assert nearest(forms.ray_and_circle(a, to[a], b, math.dist(b, p)), p) < 1e-6
    assert nearest(forms.two_circles(a, math.dist(a, p), b, math.dist(b, p)), p) < 1e-6
    assert nearest(forms.resection((a, b, c), tuple(readings)), p) < 1e-6
    assert nearest(forms.ray_and_arc(a, to[a], b, c, readings[2] - readings[1]), p) < 1e-6
    lengths = forms.second_lengths(math.dist(a, b), math.dist(p, a), readings[1] - readings[0])
    assert min(abs(length - math.dist(p, b)) for length in lengths) < 1e-6
    vectors = [
        forms.polar((0, 0), reading, math.dist(p, q)) for reading, q in zip(readings, (a, b), strict=False)
    ]
    position, zero = forms.from_two_vectors(a, vectors[0], b, vectors[1])
    assert math.dist(position, p) < 1e-6
    assert abs(forms.wrap(zero - g0)) < 1e-9


def test_space(scene):
    _, (p, a, b, c), _ = scene
    to = {q: tuple((x - y) / math.dist(p, q) for x, y in zip(p, q, strict=True)) for q in (a, b)}
    assert nearest(forms.ray_and_sphere(a, to[a], b, math.dist(b, p)), p) < 1e-6
    assert nearest(forms.nearest_of_two_rays(a, to[a], b, to[b]), p) < 1e-6
    assert nearest(forms.trilateration((a, b, c), tuple(math.dist(q, p) for q in (a, b, c))), p) < 1e-6


def test_by_hand():
    # towards north-east from the origin, towards north-west from (10, 0): they meet at (5, 5)
    assert nearest(forms.intersect_rays((0, 0), math.pi / 4, (10, 0), -math.pi / 4), (5, 5)) < 1e-12
    # 3-4-5 triangle: left of a -> b first
    assert forms.two_circles((0.0, 0.0), 3.0, (5.0, 0.0), 4.0) == [
        pytest.approx((1.8, 2.4)),
        pytest.approx((1.8, -2.4)),
    ]


def test_what_has_no_solution():
    assert forms.intersect_rays((0, 0), 0.0, (10, 0), 0.0) == []
    assert forms.intersect_rays((0, 0), math.pi, (10, 0), -math.pi / 4) == []
    assert forms.two_circles((0, 0), 1.0, (10, 0), 1.0) == []
    assert forms.two_circles((0, 0), 1.0, (0, 0), 1.0) == []
    assert forms.ray_and_circle((0, 0), 0.0, (50, 10), 5.0) == []
    assert forms.from_two_vectors((0, 0), (1, 1), (0, 0), (2, 1)) is None
    assert forms.trilateration(((0, 0, 0), (1, 0, 0), (2, 0, 0)), (1, 1, 1)) == []


def test_a_near_miss_of_two_circles_is_their_nearest_point():
    assert forms.two_circles((0, 0), 5.0, (10.05, 0), 5.0) == [pytest.approx((5.025, 0))] * 2
