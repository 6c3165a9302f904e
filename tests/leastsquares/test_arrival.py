"""When iterations end: at any scale, unit and sigma, and nowhere else."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import obseq
from obseq.codegen import compile_formula
from obseq.errors import DivergenceError, SingularSystemError
from obseq.formulas.base import Formula
from obseq.formulas.blocks import Angle, Length, Number, Point2
from obseq.formulas.functions import Scalar, angle_difference, atan2, exp, sin, sqrt
from obseq.kernels.layout import LANES
from obseq.leastsquares import LeastSquares, LevenbergMarquardt, StopReason
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.iterations.arrival import is_balanced, resolution, roughness, rounding_of_sum

SEARCHING = ("controlled", "levenberg-marquardt", "dogleg")
ALL = ("gauss-newton", *SEARCHING)


class Wave(Formula):
    def residual(self, a: Number, *, y: Number, x: Number) -> Scalar:
        return sin(a * x) - y


class Saturation(Formula):
    def residual(self, a: Number, b: Number, *, y: Number, x: Number) -> Scalar:
        return a * (1 - exp(-b * x)) - y


class Reading(Formula):
    def residual(self, station: Point2, target: Point2, zero: Angle, *, reading: Angle) -> Scalar:
        return angle_difference(atan2(target.x - station.x, target.y - station.y) - zero, reading)


class Distance(Formula):
    def residual(self, a: Point2, b: Point2, *, distance: Length) -> Scalar:
        return sqrt((b.x - a.x) ** 2 + (b.y - a.y) ** 2) - distance


class Cancelling(Formula):
    """A height difference that loses 1e-9 m to the size of the Earth."""

    def residual(self, a: Number, b: Number, *, difference: Length) -> Scalar:
        return sqrt((6.4e6 + b) ** 2) - sqrt((6.4e6 + a) ** 2) - difference


@pytest.fixture(scope="module")
def kernels():
    return {
        type(f).__name__: compile_formula(f)
        for f in (Wave(), Saturation(), Reading(), Distance(), Cancelling())
    }


def wave(kernels, seed):
    rng = np.random.default_rng(seed)
    system = obseq.LeastSquares()
    (a,) = system.add_scalars(["a"], [0.5])
    x, y = np.array([1.0, 2.0, 3.0, 4.0]), rng.normal(0, 2, 4)
    system.add(kernels["Wave"], {"a": np.repeat(a, 4)}, np.column_stack([y, x]), 1.0)
    return system, a, x, y


@pytest.mark.parametrize("strategy", SEARCHING)
def test_large_residuals_end_at_a_stationary_point(kernels, strategy):
    for seed in range(15):
        system, a, x, y = wave(kernels, seed)
        result = system.solve(max_iterations=100, strategy=strategy)
        value = result.values([a])[0, 0]
        slope = float(np.sum((np.sin(value * x) - y) * x * np.cos(value * x)))
        weight = float(np.sum((x * np.cos(value * x)) ** 2))
        assert result.converged, seed
        assert abs(slope) / np.sqrt(weight) < 1e-5 * result.sigma0, seed


def trilateration(scale, sigma, noise, offset=5.0, seed=0):
    rng = np.random.default_rng(seed)
    known, place = rng.uniform(0, 100, (6, 3)), np.array([40.0, 60.0, 30.0])
    lengths = np.linalg.norm(known - place, axis=1) + rng.normal(0, noise, 6)
    system = obseq.LeastSquares()
    base = system.add_points(list("ABCDEF"), scale * known)
    (p,) = system.add_points(["P"], [scale * (place + rng.normal(0, offset, 3))])
    system.freeze(base)
    system.add("Dist3D", {"p1": base, "p2": [p]}, scale * lengths, sigma)
    return system, p, scale * place


@pytest.mark.parametrize("strategy", ALL)
@pytest.mark.parametrize("noise", [0.0, 1e-3, 3.0])
def test_scales_and_sigmas_make_no_difference(strategy, noise):
    counts = set()
    for scale in (1e-6, 1.0, 1e7):
        for sigma in (1e-9, 1.0, 1e3):
            system, p, place = trilateration(scale, sigma, noise)
            result = system.solve(strategy=strategy)
            assert result.converged
            assert abs(result.values([p])[0] - place).max() <= scale * max(5 * noise, 1e-9)
            counts.add(len(result.iterations))
    assert max(counts) - min(counts) <= 1
    assert max(counts) <= 12


@pytest.mark.parametrize("strategy", ALL)
@pytest.mark.parametrize("zero_size", [1.0, 1e-3])
def test_national_coordinates_with_orientations_near_zero(kernels, strategy, zero_size):
    rng = np.random.default_rng(0)
    n, north = 12, 6.8e6
    true = rng.uniform(0, 300, (n, 2)) + np.array([north / 8, north])
    start = true + rng.normal(0, 0.3, (n, 2))
    start[:3] = true[:3]
    i, j = np.nonzero(~np.eye(n, dtype=bool))
    d, zero = true[j] - true[i], zero_size * rng.uniform(-3, 3, n)
    sigma_r, sigma_d = 1e-3 * np.pi / 200, 0.0003
    readings = np.arctan2(d[:, 0], d[:, 1]) - zero[i] + rng.normal(0, sigma_r, len(i))
    lengths = np.hypot(*d.T) + rng.normal(0, sigma_d, len(i))
    for tolerance in (1e-6, 1e-9, 0.0):
        system = obseq.LeastSquares()
        p = system.add_points([f"P{k}" for k in range(n)], start)
        z = system.add_scalars([f"zero {k}" for k in range(n)], zero + 0.01)
        system.freeze(p[:3])
        system.add(kernels["Reading"], {"station": p[i], "target": p[j], "zero": z[i]}, readings, sigma_r)
        system.add(kernels["Distance"], {"a": p[i], "b": p[j]}, lengths, sigma_d)
        result = system.solve(tolerance=tolerance, strategy=strategy)
        assert result.converged and (tolerance or result.stop_reason is StopReason.ROUNDING)
        assert len(result.iterations) <= 5


@pytest.mark.parametrize("strategy", ["gauss-newton", "levenberg-marquardt"])
def test_the_end_is_as_near_as_the_tolerance_says_though_the_last_step_was_longer(strategy):
    is_longer = []
    for tolerance in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        system, p, _ = trilateration(1.0, 1.0, 3.0)
        result = system.solve(tolerance=tolerance, strategy=strategy)
        end, limit = system.values([p])[0].copy(), tolerance * result.sigma0
        is_longer.append(result.iterations[-1].length > limit)
        system.solve(tolerance=0.0, strategy=strategy)
        equations = system.equations()
        normal = equations.pattern.dense(equations.assemble().values)
        gap = end - system.values([p])[0]
        assert np.sqrt(gap @ normal @ gap) <= 1.5 * limit + 1e-12, tolerance
    assert any(is_longer) or strategy != "gauss-newton"  # the other bends its steps here


@pytest.mark.parametrize("strategy", ALL)
def test_what_a_formula_loses_inside_is_recognised(kernels, strategy):
    rng = np.random.default_rng(3)
    heights = rng.uniform(0, 10, 12)
    start, end = np.arange(12), (np.arange(12) + 1) % 12
    measured = heights[end] - heights[start] + rng.normal(0, 3e-4, 12)
    system = obseq.LeastSquares()
    ids = system.add_scalars([f"H{k}" for k in range(12)], np.zeros(12))
    system.freeze(ids[:1])
    system.add(kernels["Cancelling"], {"a": ids[start], "b": ids[end]}, measured, 3e-4)
    result = system.solve(strategy=strategy, tolerance=1e-9)
    assert result.stop_reason is StopReason.ROUNDING
    assert len(result.iterations) <= 4
    again = system.solve(strategy=strategy, tolerance=1e-9)
    assert again.converged
    assert len(again.iterations) <= 2


@pytest.mark.parametrize("strategy", ALL)
def test_residuals_of_zero_are_nothing_but_rounding(kernels, strategy):
    for seed in range(10):
        heights = np.random.default_rng(seed).uniform(0, 100, 12)
        start, end = np.arange(11), np.arange(1, 12)
        start, end = np.append(start, start), np.append(end, end)  # measured twice, with equal results
        system = obseq.LeastSquares()
        ids = system.add_scalars([f"H{k}" for k in range(12)], np.where(np.arange(12) == 0, heights, 0.0))
        system.freeze(ids[:1])
        blocks = {"a": ids[start], "b": ids[end]}
        system.add(kernels["Cancelling"], blocks, (heights[end] - heights[start]).round(6), 1e-4)
        result = system.solve(strategy=strategy)
        assert result.converged, (seed, result.stop_reason)
        assert result.evaluations <= 24, (
            seed
        )  # four for each share of a step that rounding is looked for along


@pytest.mark.parametrize("strategy", ALL)
def test_one_unknown_that_is_known_absurdly_well_ends_no_iterations(strategy):
    """Its last digit is worth more than all that the others still move."""
    system = obseq.LeastSquares()
    pillars = system.add_points(["A", "B", "C"], [[0, 0, 0], [100, 0, 0], [0, 100, 0]])
    target = system.add_points(["P"], [[50.0, 10.0, 30.0]])
    system.freeze(pillars)
    distances = np.linalg.norm([[50, 50, 20], [-50, 50, 20], [50, -50, 20]], axis=1)
    system.add("Dist3D", {"p1": pillars, "p2": target}, observations=distances, sigmas=1.0)
    system.add_prior(system.add_scalars(["x"], [2.6e6]), [[2.6e6]], [[1e-14]])
    result = system.solve(strategy=strategy)
    assert result.converged
    np.testing.assert_allclose(result.values(target), [[50, 50, 20]], atol=1e-5)


def test_resolution_and_roughness_are_those_of_the_numbers(kernels):
    system = obseq.LeastSquares()
    a, b = system.add_scalars(["a", "b"], [3.0, 1024.0])
    system.add_prior([a, b], [[0.0], [0.0]], [[0.5], [0.25]])
    weights = np.array([4.0, 16.0])
    expected = np.finfo(float).eps * np.sqrt(4.0 * 9.0 + 16.0 * 1024.0**2)
    assert resolution(system.unknowns, weights) == pytest.approx(expected)
    system.add(kernels["Cancelling"], {"a": [a], "b": [b]}, [1021.0], 1e-3)
    equations = system.equations()
    found = roughness(equations, np.array([1e-7, -1e-7]))
    assert 1e-8 < found < 1e-5  # some 1e-9 m in units of 1 mm
    assert system.values([a])[0, 0] == 3.0


@pytest.mark.parametrize("size", [1e-3, 1e-2, 0.1])
def test_a_residual_that_bends_is_not_taken_for_rounding(kernels, size):
    system, *_ = wave(kernels, 0)
    bend = size**3 / 27.0 * 4.0**3 / np.sqrt(20.0)  # the third difference of the sine of 4 a
    found = roughness(system.equations(), np.array([size]))
    assert found < max(1e-13, 1e-4 * bend)


def test_controlled_steps_are_those_of_gauss_newton_where_these_descend():
    plain, *_ = trilateration(1.0, 0.01, 0.01)
    held, *_ = trilateration(1.0, 0.01, 0.01)
    expected, found = plain.solve(), held.solve(strategy="controlled")
    assert [step.length for step in found.iterations] == pytest.approx(
        [s.length for s in expected.iterations]
    )
    assert found.stop_reason is expected.stop_reason


@pytest.mark.parametrize("strategy", SEARCHING)
@pytest.mark.parametrize("rate", [-0.9, -0.5, 0.5, 0.8])
def test_where_full_steps_swing_or_creep_the_minimum_is_found_in_few(kernels, strategy, rate):
    # sin(a x) - y at x = 1 and 0.5 with residuals v that balance at a = 1: full steps shrink there by
    # sum(v x^2 sin(x)) / sum(x^2 cos(x)^2), which is the rate for these v
    x = np.array([1.0, 0.5])
    v = np.array([1.0, -np.cos(1.0) / (0.5 * np.cos(0.5))])
    v *= rate * np.sum(np.square(x * np.cos(x))) / np.sum(v * x**2 * np.sin(x))
    counts = {}
    for name in ("gauss-newton", strategy):
        system = obseq.LeastSquares()
        (a,) = system.add_scalars(["a"], [1.02])
        rows = np.column_stack([np.sin(x) - v, x])
        system.add(kernels["Wave"], {"a": np.repeat(a, 2)}, rows, 1.0)
        result = system.solve(max_iterations=200, strategy=name)
        assert result.converged
        assert result.values([a])[0, 0] == pytest.approx(1.0, abs=1e-4)
        counts[name] = len(result.iterations)
    assert counts[strategy] <= 8
    assert counts["gauss-newton"] > 2 * counts[strategy]


def test_a_rejected_trial_evaluates_residuals_only(monkeypatch):
    counted = []
    original = NormalEquations.collect

    def collect(self):
        counted.append(1)
        return original(self)

    monkeypatch.setattr(NormalEquations, "collect", collect)
    system, *_ = trilateration(1.0, 0.01, 10.0, offset=300.0, seed=2)
    result = system.solve(max_iterations=100, strategy="controlled")
    assert result.converged
    assert len(counted) == len(result.iterations)
    assert result.evaluations > len(counted)  # some trials were rejected


def saturation(kernels, a, b):
    system = obseq.LeastSquares()
    ids = system.add_scalars(["a", "b"], [a, b])
    x = np.array([1.0, 2.0, 3.0, 5.0, 7.0, 10.0])
    y = np.array([109.0, 149.0, 149.0, 191.0, 213.0, 224.0])
    blocks = {"a": ids[:1].repeat(6), "b": ids[1:].repeat(6)}
    system.add(kernels["Saturation"], blocks, np.column_stack([y, x]), 1.0)
    return system, ids


def test_a_diverging_gauss_newton_says_so_and_gives_back_the_best_values(kernels):
    system, ids = saturation(kernels, 100.0, 3.0)
    with pytest.raises(DivergenceError, match=r"diverges .*step of .*iteration \d.*controlled"):
        system.solve(max_iterations=50)
    assert np.isfinite(system.values(ids)).all()
    assert np.abs(system.values(ids)).max() < 1e4


def test_gauss_newton_that_came_down_and_lost_an_unknown_says_so(kernels):
    system, _ = saturation(kernels, 50.0, 0.01)
    costs = []
    with pytest.raises(
        DivergenceError, match=r"diverges \(a step of .* no influence any more: b \(iteration 3"
    ):
        system.solve(max_iterations=50, progress=lambda step: costs.append(step.cost))
    assert system.equations().assemble().cost == pytest.approx(min(costs))


def test_gauss_newton_that_swings_says_so(kernels):
    verdicts = set()
    for seed in range(40):
        system, *_ = wave(kernels, seed)
        result = system.solve(max_iterations=60)
        verdicts.add(result.stop_reason)
        if result.stop_reason is StopReason.OSCILLATES:
            late = [step.length for step in result.iterations[30:]]
            assert max(late[15:]) > 0.7 * max(late[:15])
            assert not result.converged
            assert f"oscillate (iteration 60: a step of {result.iterations[-1].max_step:.3g}" in result.ending
    assert verdicts >= {StopReason.STEP, StopReason.OSCILLATES}


def test_a_plateau_is_no_minimum(kernels):
    system, _ = saturation(kernels, 100.0, 800.0)
    with pytest.raises(SingularSystemError, match="undetermined: b"):
        system.solve(max_iterations=200, strategy=LevenbergMarquardt(damping=1e-4))


def free_network(scale=1.0):
    rng = np.random.default_rng(1)
    true = rng.uniform(0, 100, (6, 3))
    i, j = np.triu_indices(6, 1)
    measured = np.linalg.norm(true[j] - true[i], axis=1) + rng.normal(0, 0.01, 15)
    system = obseq.LeastSquares()
    ids = system.add_points([f"P{k}" for k in range(6)], scale * (true + rng.normal(0, 0.01, true.shape)))
    system.add("Dist3D", {"p1": ids[i], "p2": ids[j]}, scale * measured, scale * 0.01)
    return system, ids


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e5])
def test_levenberg_marquardt_counts_the_defect_of_a_free_gauge(scale):
    system, ids = free_network(scale)
    system.set_datum(ids)
    expected = system.solve()
    system, _ = free_network(scale)
    found = system.solve(strategy="levenberg-marquardt", max_iterations=50)
    assert found.converged
    assert found.redundancy == expected.redundancy == 3
    assert found.sigma0 == pytest.approx(expected.sigma0, rel=1e-6)
    assert found.iterations[0].sigma0 == pytest.approx(expected.iterations[0].sigma0, rel=1e-6)


def test_a_free_gauge_is_refused_by_the_others():
    system, _ = free_network()
    with pytest.raises(SingularSystemError, match="undetermined"):
        system.solve(strategy="controlled")


@pytest.mark.parametrize("strategy", ["gauss-newton", "controlled", "levenberg-marquardt", "qr", "lsmr"])
@pytest.mark.parametrize("degree", [7, 9])
def test_steps_of_an_ill_conditioned_fit_that_are_rounding_have_arrived(degree, strategy):
    """Coefficients of a polynomial through exact values: condition 1e9 and more, right to what it leaves."""
    powers = np.vander(np.arange(21.0), degree + 1, increasing=True)
    system = LeastSquares()
    ids = system.add_vectors(["c"], np.zeros((1, degree + 1)))
    system.add_linear([ids.repeat(21)], [powers], powers.sum(axis=1), 1.0)
    result = system.solve(strategy=strategy)
    assert result.stop_reason is StopReason.ROUNDING
    assert len(result.iterations) <= 6
    spread = np.finfo(float).eps * np.linalg.cond(powers)
    assert result.values(ids)[0] == pytest.approx(np.ones(degree + 1), abs=spread)


def test_a_gradient_that_tells_something_is_no_rounding():
    """The same fit, one observation moved by 1e-3 of its sigma: each strategy still sees it."""
    powers = np.vander(np.arange(21.0), 8, increasing=True)
    system = LeastSquares()
    ids = system.add_vectors(["c"], np.ones((1, 8)))
    batch = system.add_linear([ids.repeat(21)], [powers], powers.sum(axis=1), 1.0)
    assert is_balanced(system.equations())
    batch.observations = powers.sum(axis=1) + 1e-3 * (np.arange(21) == 0)
    assert not is_balanced(system.equations())


def test_a_sum_of_many_squares_is_as_rounded_as_its_additions_make_it():
    """Of 16,384 tiles 64 eps, three standard deviations: next to no sum is farther off."""
    tiles, limit = 128**2, rounding_of_sum(SimpleNamespace(batches=[SimpleNamespace(n=LANES * 128**2)]))
    assert limit == 64.0 * np.finfo(np.float64).eps
    squares = np.square(np.random.default_rng(3).normal(size=(200, tiles)))
    off = [abs(np.cumsum(row)[-1] / math.fsum(row) - 1.0) / limit for row in squares]
    assert np.mean(np.array(off) > 1.0) < 0.01
    assert 0.15 < np.percentile(off, 68) < 0.5


def test_few_squares_are_rounded_by_sixteen_last_digits():
    one = SimpleNamespace(batches=[SimpleNamespace(n=12), SimpleNamespace(n=7)])
    assert rounding_of_sum(one) == 16.0 * np.finfo(np.float64).eps
