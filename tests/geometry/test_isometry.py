"""Rigid motions from pairs of points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from obseq.geometry import DegenerateGeometryError, RigidMotion, exponential, isometry, similarity

SQUARE = np.array([[-10.0, 0.0, 0.0], [0.0, -50.0, 0.0], [20.0, 0.0, 0.0], [0.0, 50.0, 0.0]])


def motion(seed: int) -> RigidMotion:
    generator = np.random.default_rng(seed)
    return RigidMotion(
        generator.uniform(-1000.0, 1000.0, 3), exponential(np.pi * generator.uniform(-1.0, 1.0, 3))
    )


@given(st.integers(0, 10_000))
def test_a_flat_square_gives_the_motion_back(seed) -> None:
    """The points of MMVII's bench example 4, all in one plane."""
    true = motion(seed)
    found = isometry(SQUARE, true.to_world(SQUARE))
    assert found.rotation == pytest.approx(true.rotation, abs=1e-13)
    assert found.centre == pytest.approx(true.centre, abs=1e-11)


@given(st.integers(0, 10_000))
def test_three_pairs_give_it_exactly(seed) -> None:
    true, points = motion(seed), SQUARE[[0, 1, 2]] + [1.0, 2.0, 3.0]
    found = isometry(points, true.to_world(points))
    assert found.rotation == pytest.approx(true.rotation, abs=1e-13)
    assert found.centre == pytest.approx(true.centre, abs=1e-11)


@given(st.integers(0, 10_000))
def test_a_similarity_finds_the_scale_too(seed) -> None:
    true = motion(seed)
    scale, found = similarity(SQUARE, 2.5 * true.to_world(SQUARE))
    assert scale == pytest.approx(2.5)
    assert found.rotation == pytest.approx(true.rotation, abs=1e-12)
    assert found.centre == pytest.approx(2.5 * true.centre, abs=1e-10)


def test_least_squares_beats_its_neighbours() -> None:
    generator = np.random.default_rng(3)
    source = generator.uniform(-10.0, 10.0, (12, 3))
    target = motion(3).to_world(source) + 0.1 * generator.standard_normal((12, 3))
    found = isometry(source, target)
    best = np.sum((found.to_world(source) - target) ** 2)
    for w, shift in zip(generator.normal(0, 0.01, (50, 3)), generator.normal(0, 0.01, (50, 3)), strict=True):
        moved = RigidMotion(found.centre + shift, found.rotation @ exponential(w))
        assert np.sum((moved.to_world(source) - target) ** 2) > best


def test_far_coordinates_lose_little() -> None:
    source = SQUARE + np.array([657700.0, 6860700.0, 100.0])
    true = motion(4)
    found = isometry(source, true.to_world(source))
    assert found.to_world(source) == pytest.approx(true.to_world(source), abs=1e-8)


def test_collinear_points_are_refused() -> None:
    line = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]])
    with pytest.raises(DegenerateGeometryError, match=r"3 source points are on one line.*Add a point"):
        isometry(line, SQUARE[:3])
    with pytest.raises(DegenerateGeometryError, match="3 target points are on one line"):
        isometry(SQUARE[:3], line)
    with pytest.raises(DegenerateGeometryError, match="at one place"):
        isometry(np.zeros((3, 3)), np.zeros((3, 3)))


def test_too_few_or_bad_pairs_are_refused() -> None:
    with pytest.raises(DegenerateGeometryError, match="needs three pairs of points, there are 2"):
        isometry(SQUARE[:2], SQUARE[:2])
    with pytest.raises(DegenerateGeometryError, match=r"not \(4, 3\) and \(3, 3\)"):
        isometry(SQUARE, SQUARE[:3])
    unknown = SQUARE.copy()
    unknown[2] = np.nan
    with pytest.raises(DegenerateGeometryError, match="target point"):
        isometry(SQUARE, unknown)
