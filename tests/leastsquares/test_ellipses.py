"""Ellipses by hand, by quadratic forms, and by how often they hold the true point."""

import numpy as np
import pytest
from scipy import special

import obseq
from obseq.errors import InputError
from obseq.leastsquares.statistics.ellipses import (
    confidence_factor,
    error_ellipses,
    error_ellipsoids,
    relative_precision,
)


def observed_points(covariances, values=None):
    """Points observed through linear rows so that their covariances are those given, sigma0 a priori."""
    covariances = np.asarray(covariances, dtype=float)
    n, k = covariances.shape[:2]
    system = obseq.LeastSquares()
    true = np.arange(n * k, dtype=float).reshape(n, k) ** 2 if values is None else np.asarray(values, float)
    points = system.add_points([f"P{i}" for i in range(n)], true)
    for i in range(n):
        rows = np.linalg.inv(np.linalg.cholesky(covariances[i]))
        system.add_linear([[points[i]] * k], [rows], rows @ true[i], 1.0)
    return system, points


def test_axes_along_the_coordinates():
    system, points = observed_points([np.diag([4.0, 1.0]), np.diag([1.0, 9.0])])
    ellipses = error_ellipses(system.solve(covariance=True), points, a_priori=True)
    np.testing.assert_allclose(ellipses.semi_major, [2.0, 3.0])
    np.testing.assert_allclose(ellipses.semi_minor, [1.0, 1.0])
    np.testing.assert_allclose(ellipses.bearing, [np.pi / 2, 0.0], atol=1e-12)  # east, then north
    assert ellipses.columns()["point"] == ["P0", "P1"]


def test_bearing_is_clockwise_from_y():
    # long axis towards bearing 30 degrees: direction (sin 30, cos 30)
    along, across = np.array([0.5, np.sqrt(0.75)]), np.array([np.sqrt(0.75), -0.5])
    system, points = observed_points([9.0 * np.outer(along, along) + np.outer(across, across)])
    ellipses = error_ellipses(system.solve(covariance=True), points, a_priori=True)
    assert ellipses.bearing[0] == pytest.approx(np.radians(30))
    assert ellipses.semi_major[0] == pytest.approx(3.0)


def test_ellipsoid_has_the_eigenvectors():
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(3, 3))
    system, points = observed_points([factor @ factor.T])
    ellipsoids = error_ellipsoids(system.solve(covariance=True), points, a_priori=True)
    axes, directions = ellipsoids.semi_axes[0], ellipsoids.directions[0]
    np.testing.assert_allclose(directions.T @ np.diag(axes**2) @ directions, factor @ factor.T, rtol=1e-9)
    assert (np.diff(axes) < 0).all()
    assert len(ellipsoids.columns()) == 7


def test_confidence_factors_are_tabulated_ones():
    assert confidence_factor(None, 2, None) == 1.0
    assert confidence_factor(0.95, 2, None) == pytest.approx(2.4477, abs=1e-4)
    assert confidence_factor(0.95, 3, None) == pytest.approx(2.7955, abs=1e-4)
    assert confidence_factor(0.95, 2, 10) == pytest.approx(np.sqrt(2 * 4.1028), abs=1e-4)
    assert confidence_factor(1 - np.exp(-0.5), 2, None) == pytest.approx(1.0)  # the 39 % of the standard one
    with pytest.raises(InputError, match="level"):
        confidence_factor(95.0, 2, None)


@pytest.mark.slow
def test_ellipses_hold_the_true_point_as_often_as_they_say():
    rng, inside, level, trials = np.random.default_rng(4), 0, 0.9, 600
    system = obseq.LeastSquares()
    (point,) = system.add_points(["P"], [[0.0, 0.0]])
    batch = system.add_linear([[point] * 7], [np.zeros((7, 2))], np.zeros(7), 1.0)
    for _ in range(trials):
        rows = rng.normal(size=(7, 2))
        batch.observations = np.column_stack([rows, rng.normal(size=7)])
        result = system.solve(covariance=True)
        ellipse = error_ellipses(result, [point], level)
        x, y = result.values([point])[0]
        s, c = np.sin(ellipse.bearing[0]), np.cos(ellipse.bearing[0])
        along, across = x * s + y * c, x * c - y * s
        inside += (along / ellipse.semi_major[0]) ** 2 + (across / ellipse.semi_minor[0]) ** 2 <= 1.0
    assert abs(inside / trials - level) < 3.5 * np.sqrt(level * (1 - level) / trials)


def levelled_chain():
    """Three points along x, 100 m apart, joined by coordinate differences of sigma 3 mm and 4 mm."""
    system = obseq.LeastSquares()
    a, b, c = system.add_points(["A", "B", "C"], [[0.0, 0.0], [100.0, 0.0], [200.0, 0.0]])
    eye = np.eye(2)
    for first, second in ((a, b), (b, c)):
        system.add_linear([[first] * 2, [second] * 2], [-eye, eye], [100.0, 0.0], [0.003, 0.004])
    system.add_prior([a], [[0.0, 0.0]], 1.0)
    return system, (a, b, c)


def test_relative_precision_forgets_the_common_position():
    system, (a, b, c) = levelled_chain()
    result = system.solve(covariance=True)
    found = relative_precision(result, [a, a, c], [b, c, b], a_priori=True)
    np.testing.assert_allclose(found.distance, [100.0, 200.0, 100.0])
    np.testing.assert_allclose(found.precision, [0.003, 0.003 * np.sqrt(2), 0.003], rtol=1e-6)
    np.testing.assert_allclose(found.ratio, found.precision / found.distance)
    # across the line, 4 mm at 100 m; 4 mm sqrt(2) at 200 m
    np.testing.assert_allclose(found.bearing_precision, [4e-5, 4e-5 / np.sqrt(2), 4e-5], rtol=1e-6)
    ellipses = found.ellipses()
    assert ellipses.names[1] == "A - C"
    np.testing.assert_allclose(ellipses.semi_major, [0.004, 0.004 * np.sqrt(2), 0.004], rtol=1e-6)
    np.testing.assert_allclose(ellipses.bearing, 0.0, atol=1e-9)
    assert len(found.columns()) == 6


def test_many_pairs_are_those_of_the_whole_covariance():
    rng = np.random.default_rng(2)
    system = obseq.LeastSquares()
    n = 90
    points = system.add_points([str(k) for k in range(n)], rng.uniform(0, 100, (n, 2)))
    values = system.values(points)
    eye = np.eye(2)
    for k in range(n - 1):
        pair = [[points[k]] * 2, [points[k + 1]] * 2]
        system.add_linear(pair, [-eye, eye], values[k + 1] - values[k], rng.uniform(0.01, 0.03))
    system.add_prior(points, values, 0.02)
    result = system.solve(covariance=True)
    first, second = rng.permutation(n), rng.permutation(n)
    keep = first != second
    found = relative_precision(result, points[first[keep]], points[second[keep]], a_priori=True)
    whole = result.covariance_between(points, points, a_priori=True).reshape(n, 2, n, 2)
    for m, (i, j) in enumerate(zip(first[keep], second[keep], strict=True)):
        expected = whole[i, :, i] + whole[j, :, j] - whole[i, :, j] - whole[j, :, i]
        np.testing.assert_allclose(found.covariance[m], expected, atol=1e-15)


def test_errors_name_the_points():
    system, (a, b, _) = levelled_chain()
    with pytest.raises(InputError, match="covariance=True"):
        error_ellipses(system.solve(), [a], a_priori=True)
    result = system.solve(covariance=True)
    with pytest.raises(InputError, match="A and A are at the same place"):
        relative_precision(result, [a], [a])
    with pytest.raises(InputError, match="ask for the ellipses"):
        error_ellipsoids(result, [a, b], a_priori=True)
    scalar = system.add_scalars(["s"], [0.0])
    with pytest.raises(InputError, match="'s' is a Scalar, not a point"):
        error_ellipses(result, scalar)
    assert special.chdtr(2, 1.0) == pytest.approx(0.3935, abs=1e-4)
