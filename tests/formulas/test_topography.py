"""The survey formulas, each on numbers that a person can follow."""

import math

import mpmath
import numpy as np
import pytest

from obseq.formulas.special_topography import Beside, TopoAlpha, TopoBeta, TopoDHParamOff
from obseq.formulas.topography import (
    TopoAngle,
    TopoDH,
    TopoDist,
    TopoDistHz,
    TopoDX,
    TopoDY,
    TopoDZ,
    TopoHz,
    TopoScaledFrame,
    TopoZen,
)
from obseq.kernels import calculator

IDENTITY = (1, 0, 0, 0, 1, 0, 0, 0, 1)
QUARTER_LEFT = (0, -1, 0, 1, 0, 0, 0, 0, 1)
"""Instrument to frame: its x is the frame's y, its y the frame's -x (a quarter turn to the left)."""
STATION = (100.0, 200.0, 10.0, 0.0, 0.0, 0.0)


def residual(formula, target, observations, matrix=IDENTITY, station=STATION):
    """The only residual of a station formula."""
    (value,) = formula.evaluate((*station, *target), (*matrix, *observations))
    return value


def test_hz_of_a_target_due_east_is_a_quarter_turn():
    # From (100, 200) to (105, 200): due east, 90 degrees clockwise from y.
    assert residual(TopoHz(), (105, 200, 10), [0.0]) == pytest.approx(math.pi / 2, abs=1e-15)


def test_hz_counts_clockwise_from_y():
    # 3 m east, 4 m north: the angle from north, clockwise, has tangent 3/4.
    assert residual(TopoHz(), (103, 204, 50), [0.5]) == pytest.approx(math.atan2(3, 4) - 0.5, abs=1e-15)


def test_hz_reads_the_instrument_axes():
    # The instrument's y axis points west: a target due north is a quarter turn to its right.
    assert residual(TopoHz(), (100, 205, 10), [0.0], QUARTER_LEFT) == pytest.approx(math.pi / 2, abs=1e-15)


def test_hz_wraps_differences_above_half_a_turn():
    # Computed -0.1, observed 2 pi - 0.2: they differ by 0.1, not by almost a turn.
    target = (100 + math.sin(-0.1), 200 + math.cos(-0.1), 10)
    assert residual(TopoHz(), target, [2 * math.pi - 0.2]) == pytest.approx(0.1, abs=1e-14)
    # MMVII leaves a computed 3 and an observed -3 at 6; they are 2 pi - 6 apart.
    target = (100 + math.sin(3.0), 200 + math.cos(3.0), 10)
    assert residual(TopoHz(), target, [-3.0]) == pytest.approx(6 - 2 * math.pi, abs=1e-14)


def test_small_rotation_about_z_decreases_the_direction():
    # W turns the aimed vectors counter-clockwise: with W_z = 1e-6 the reading loses 1e-6 rad.
    station = (*STATION[:5], 1e-6)
    turned = residual(TopoHz(), (103, 204, 10), [0.0], station=station)
    assert turned - residual(TopoHz(), (103, 204, 10), [0.0]) == pytest.approx(-1e-6, abs=1e-15)


def test_zenith_angle_is_a_right_angle_at_the_horizon_and_small_overhead():
    assert residual(TopoZen(), (103, 204, 10), [0.0, 0.0]) == pytest.approx(math.pi / 2, abs=1e-15)
    # 5 m away horizontally, 12 m up: tangent of the zenith angle 5/12.
    assert residual(TopoZen(), (103, 204, 22), [0.0, 0.0]) == pytest.approx(math.atan2(5, 12), abs=1e-15)


def test_refraction_is_taken_off_the_computed_zenith_angle():
    assert residual(TopoZen(), (103, 204, 22), [1e-5, 0.0]) == pytest.approx(
        math.atan2(5, 12) - 1e-5, abs=1e-15
    )


def test_distance_of_the_3_4_12_box_is_13():
    (value,) = TopoDist().evaluate((1, 1, 1, 4, 5, 13), [12.5])
    assert value == pytest.approx(0.5, abs=1e-15)


@pytest.mark.parametrize(("formula", "component"), [(TopoDX(), 5.0), (TopoDY(), -3.0), (TopoDZ(), 7.0)])
def test_local_components(formula, component):
    # Target 3 m east, 5 m north, 7 m up; instrument turned left: its right is north, its front west.
    assert residual(formula, (103, 205, 17), [1.0], QUARTER_LEFT) == pytest.approx(component - 1.0, abs=1e-14)


def test_height_difference_on_the_equator():
    # At (a, 0, 0) the ellipsoid normal is x: 2 m further along x is 2 m higher. Frame = geocentric.
    a, e2 = 6378137.0, 0.00669438
    points = (a + 1.0, 0.0, 0.0, a + 3.0, 0.0, 0.0)
    (value,) = TopoDH().evaluate(points, (*IDENTITY, 0, 0, 0, a, e2, 1.5))
    assert value == pytest.approx(0.5, abs=1e-8)


def test_an_offset_moves_the_end_of_an_unknown_height_difference():
    # 2 m up along x, the vertical on the equator at longitude 0; the unknown is 1.5 m
    a, e2 = 6378137.0, 0.00669438
    points = (a + 10.0, 0, 0, a + 10.0, 0, 0)
    (value,) = TopoDHParamOff().evaluate((1.5, *points), (2.0, 0, 0, *IDENTITY, 0, 0, 0, a, e2))
    assert value == pytest.approx(0.5, abs=1e-8)


def test_height_difference_grows_with_the_square_of_the_distance():
    # 1 km along the tangent at the equator (a circle of radius a): 1000^2 / (2 a) = 0.0784 m higher.
    a, e2 = 6378137.0, 0.00669438
    (value,) = TopoDH().evaluate((a, 0, 0, a, 1000.0, 0), (*IDENTITY, 0, 0, 0, a, e2, 0.0))
    assert value == pytest.approx(math.hypot(a, 1000.0) - a, abs=1e-8)


WGS84 = (6378137.0, 0.00669438)
SIZES = (1e-3, 1.0, 100.0, 1e4, 1e6)
"""Distances of two points (m) over which a height difference is to be resolved."""


def tangent_frames(count: int, rng: np.random.Generator) -> list[tuple[float, ...]]:
    """Context of the equation in level frames anywhere on the Earth, up to 5 km above the ellipsoid."""
    a, e2 = WGS84
    frames = []
    places = rng.uniform((-3.1, -1.55, -100.0), (3.1, 1.55, 5e3), (count, 3))
    for longitude, latitude, height in places.tolist():
        (sl, cl), (sp, cp) = ((math.sin(x), math.cos(x)) for x in (longitude, latitude))
        normal = a / math.sqrt(1 - e2 * sp**2)
        origin = ((normal + height) * cp * cl, (normal + height) * cp * sl, (normal * (1 - e2) + height) * sp)
        frames.append((-sl, -sp * cl, cp * cl, cl, -sp * sl, cp * sl, 0.0, cp, sp, *origin, a, e2, 0.0))
    return frames


def height(point, observations):
    """Bowring's height of a point of the frame, in high precision."""
    *rows, tx, ty, tz, a, e2, _ = observations
    x, y, z = (mpmath.fdot(rows[3 * i : 3 * i + 3], point) + t for i, t in enumerate((tx, ty, tz)))
    p, b_over_a = mpmath.hypot(x, y), mpmath.sqrt(1 - e2)
    parametric = mpmath.atan2(z * (b_over_a + e2 * a / mpmath.sqrt(p * p + z * z)), p)
    latitude = mpmath.atan2(
        z * b_over_a + e2 * a * mpmath.sin(parametric) ** 3,
        b_over_a * (p - e2 * a * mpmath.cos(parametric) ** 3),
    )
    sine = mpmath.sin(latitude)
    return p * mpmath.cos(latitude) + z * sine - a * mpmath.sqrt(1 - e2 * sine**2)


@pytest.mark.parametrize("size", SIZES)
def test_height_differences_carry_the_rounding_of_the_points_only(size):
    rng = np.random.default_rng(11)
    observations = np.array(tangent_frames(20, rng))
    starts = size * rng.normal(size=(20, 3)) * (1, 1, 0.1)
    ends = starts + size * rng.normal(size=(20, 3)) * (1, 1, 0.1)
    found = calculator("TopoDH").values(np.hstack([starts, ends]), observations)[:, 0]
    with mpmath.workdps(50):
        exact = [
            height([mpmath.mpf(x) for x in end], [mpmath.mpf(x) for x in o])
            - height([mpmath.mpf(x) for x in start], [mpmath.mpf(x) for x in o])
            for start, end, o in zip(starts.tolist(), ends.tolist(), observations.tolist(), strict=True)
        ]
    errors = np.abs(found - np.array(exact, dtype=float))
    assert (errors <= 1e-15 * np.linalg.norm(ends - starts, axis=1)).all(), errors.max() / size


def test_polar_angles_count_as_a_mathematician_does():
    # 3 m along x, 4 m along y, 5 m up: alpha from x towards y, beta above the plane of both.
    target = (103, 204, 15)
    assert residual(TopoAlpha(), target, [0.5]) == pytest.approx(math.atan2(4, 3) - 0.5, abs=1e-15)
    assert residual(TopoBeta(), target, [0.5]) == pytest.approx(math.pi / 4 - 0.5, abs=1e-15)


@pytest.mark.parametrize(
    ("formula", "moved", "rest"),
    [
        (TopoHz(), Beside(TopoHz()), [0.1]),
        (TopoZen(), Beside(TopoZen()), [1e-5, 0.1]),
        (TopoAlpha(), Beside(TopoAlpha()), [0.1]),
        (TopoBeta(), Beside(TopoBeta()), [0.1]),
        (TopoDX(), Beside(TopoDX()), [0.1]),
        (TopoDY(), Beside(TopoDY()), [0.1]),
        (TopoDZ(), Beside(TopoDZ()), [0.1]),
    ],
)
def test_an_offset_moves_the_target(formula, moved, rest):
    # A prism 1 m east, 2 m south and 3 m above its mark, relative to the instrument.
    target, offset = (103, 204, 50), (1.0, -2.0, 3.0)
    expected = residual(formula, (104, 202, 53), rest)
    assert residual(moved, target, [*offset, *rest]) == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize(
    ("plain", "axis"), [(TopoDX(), (1, 0, 0)), (TopoDY(), (0, 1, 0)), (TopoDZ(), (0, 0, 1))]
)
def test_a_scale_multiplies_what_was_read(plain, axis):
    # 100 ppm of 2 m are 0.2 mm: what was read is too short by that.
    without = residual(plain, (103, 202, 53), [2.0])
    state = (*STATION, 103, 202, 50, 1e-4)
    (found,) = TopoScaledFrame().evaluate(state, [*IDENTITY, 0.0, 0.0, 3.0, *axis, 2.0])
    assert found == pytest.approx(without - 2e-4, abs=1e-13)


def test_an_offset_moves_the_end_of_a_distance():
    (value,) = Beside(TopoDist()).evaluate((1, 1, 1, 4, 5, 10), [0.0, 0.0, 3.0, 12.5])
    assert value == pytest.approx(0.5, abs=1e-15)


def test_horizontal_distance_leaves_out_what_is_along_the_vertical():
    # 3 m east, 4 m north, 12 m up: 5 m in the horizon. With the vertical along x, 4 and 12 remain.
    ends = (100.0, 200.0, 10.0, 103.0, 204.0, 22.0)
    (flat,) = TopoDistHz().evaluate(ends, (0.0, 0.0, 1.0, 4.9))
    assert flat == pytest.approx(0.1, abs=1e-13)
    (tilted,) = TopoDistHz().evaluate(ends, (1.0, 0.0, 0.0, 0.0))
    assert tilted == pytest.approx(math.hypot(4, 12), abs=1e-13)


def test_an_offset_moves_the_end_of_a_horizontal_distance():
    # the target stands 2 m above its mark, leaning 3 m to the east: 3 - 3 m east and 4 m north remain
    ends, leaning = (100.0, 200.0, 10.0, 103.0, 204.0, 22.0), (-3.0, 0.0, 2.0)
    (found,) = Beside(TopoDistHz()).evaluate(ends, (*leaning, 0.0, 0.0, 1.0, 3.9))
    assert found == pytest.approx(0.1, abs=1e-13)


def test_angle_counts_clockwise_from_the_backsight():
    # Back to the north, ahead 3 m east and 4 m north; the other way round it is the rest of the turn.
    station, north, ahead = (100.0, 200.0, 10.0), (100.0, 250.0, 0.0), (103.0, 204.0, 50.0)
    angle = math.atan2(3, 4)
    (forth,) = TopoAngle().evaluate((*station, *north, *ahead), (*IDENTITY, 0.0))
    assert forth == pytest.approx(angle, abs=1e-15)
    (back,) = TopoAngle().evaluate((*station, *ahead, *north), (*IDENTITY, 2 * math.pi - angle - 0.1))
    assert back == pytest.approx(0.1, abs=1e-14)
