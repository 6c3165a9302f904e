"""Vectors are tested as one observation: at the level announced, along any axes, as leaving out says."""

import numpy as np
import pytest
from scipy import special

import obseq
from obseq.errors import InputError
from obseq.leastsquares import SnoopingEnd, reliability, snoop
from obseq.leastsquares.statistics.distributions import beta_above, non_central_above
from obseq.leastsquares.statistics.hypothesis_tests import non_centrality, normal_critical, tau_critical
from obseq.leastsquares.statistics.joint_levels import (
    joint_critical,
    joint_level,
    joint_ratio_critical,
    shared_level,
)

PAIRS = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3), (3, 4), (2, 4)])
FACTOR = np.array([[3.0, 0, 0], [1.0, 2.0, 0], [6.0, 3.0, 4.0]]) * 1e-3


class Vectors:
    """Vectors among five points, one of them held, along axes that are turned."""

    def __init__(self, axes=None):
        turn, n = np.eye(3) if axes is None else axes, len(PAIRS)
        self.turn = turn
        self.system = obseq.LeastSquares()
        points = self.system.add_points(list("ABCDE"), np.zeros((5, 3)))
        self.system.freeze(points[:1])
        self.parts = [np.tile(-turn, (n, 1)), np.tile(turn, (n, 1))]
        ends = [np.repeat(points[end], 3) for end in PAIRS.T]
        labels = [f"{'XYZ'[k % 3]} {k // 3}" for k in range(3 * n)]
        self.batch = self.system.add_linear(ends, self.parts, np.zeros(3 * n), 1.0, labels)
        self.batch.correlate_all([turn @ FACTOR @ FACTOR.T @ turn.T] * n)
        self.groups = {self.batch: list(np.arange(3 * n).reshape(-1, 3))}

    def tests(self, errors):
        """The tests with errors (n, 3) along the axes that are not turned, and the solution."""
        rows = np.hstack([*self.parts, (errors @ self.turn.T).reshape(-1, 1)])
        self.batch.observations = rows
        solution = self.system.solve(covariance=True)
        return reliability(self.system, solution, groups=self.groups).of(self.batch).joint, solution


def errors(seed, vector=None, bias=(0, 0, 0)):
    found = np.random.default_rng(seed).normal(size=(len(PAIRS), 3)) @ FACTOR.T
    if vector is not None:
        found[vector] += bias
    return found


def test_leaving_a_vector_out_lowers_the_sum_of_squares_by_its_test():
    network, planted = Vectors(), errors(1, 4, (0.0, 0.0, 0.1))
    tests, before = network.tests(planted)
    for row in range(12, 15):
        network.batch.set_active(row, False)
    after = network.system.solve(covariance=True)
    assert before.cost - after.cost == pytest.approx(tests[4].statistic, rel=1e-9)
    left = after.residuals(network.batch)[12:15, 0]
    assert tests[4].degrees == 3 and tests[4].blunder == pytest.approx(-left, rel=1e-9)


def test_vectors_without_covariance_are_tested_as_with_a_diagonal_one():
    bare, joined, sigmas = Vectors(), Vectors(), np.array([0.003, 0.002, 0.004])
    bare.batch.clusters, bare.batch.sigmas = None, np.tile(sigmas, len(PAIRS))[:, None]
    joined.batch.correlate_all([np.diag(np.square(sigmas))] * len(PAIRS))
    found, expected = (network.tests(errors(8, 2, (0.01, 0.02, 0.0)))[0] for network in (bare, joined))
    assert len(found) == len(PAIRS)
    for one, other in zip(found, expected, strict=True):
        assert one.rows.tolist() == other.rows.tolist() and one.degrees == other.degrees
        assert one.statistic == pytest.approx(other.statistic, rel=1e-9)
        assert one.blunder == pytest.approx(other.blunder, rel=1e-9)
    bare.groups = {bare.batch: [np.array([2, 3])]}
    with pytest.raises(InputError, match="of the same unknowns"):
        bare.tests(errors(8))


def test_the_test_is_the_same_along_other_axes():
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    plain, turned = (Vectors(axes).tests(errors(2, 0, (0.01, 0, 0.02)))[0] for axes in (None, turn))
    for one, other in zip(plain, turned, strict=True):
        assert one.statistic == pytest.approx(other.statistic, rel=1e-8)
        assert other.blunder == pytest.approx(turn @ one.blunder, abs=1e-9)


def test_without_errors_the_test_is_chi_square():
    """Errors of the estimates are normal with a covariance S, and T is their square in units of S."""
    network, n = Vectors(), len(PAIRS)
    units = np.eye(3 * n).reshape(3 * n, n, 3)
    linear = np.array([network.tests(one)[0][5].blunder for one in units]).T
    spread = linear @ np.kron(np.eye(n), FACTOR @ FACTOR.T) @ linear.T
    test = network.tests(errors(7))[0][5]
    assert test.blunder == pytest.approx(linear @ errors(7).ravel(), rel=1e-9)
    assert test.statistic == pytest.approx(test.blunder @ np.linalg.solve(spread, test.blunder), rel=1e-9)


def test_limits_find_one_error_with_one_power():
    shift = non_centrality(0.001, 0.80) ** 2
    for degrees in (1, 2, 3, 6):
        critical = joint_critical(0.001, 0.80, degrees)
        assert special.chndtr(critical, degrees, shift) == pytest.approx(0.20)
    assert joint_critical(0.001, 0.80, 1) == normal_critical(0.001) ** 2
    assert joint_level(0.001, 0.80, 3) == pytest.approx(special.chdtrc(3, joint_critical(0.001, 0.80, 3)))


def test_levels_of_all_tests_add_up():
    level = shared_level(0.01, {1: 6, 3: 8}, 0.80)
    none = (1 - level) ** 6 * (1 - joint_level(level, 0.80, 3)) ** 8
    assert none == pytest.approx(0.99, abs=1e-9)


def test_limits_by_the_variance_factor_of_all():
    assert joint_ratio_critical(0.001, 0.80, 1, 12) == pytest.approx(tau_critical(0.001, 12) ** 2)
    assert joint_ratio_critical(0.001, 0.80, 3, 3) == float("inf")


@pytest.mark.parametrize(
    "x, degrees, shift", [(12.0, 3, 17.0), (0.5, 2, 3.0), (250.0, 3, 200.0), (4.0, 5, 0.0)]
)
def test_non_central_chi_square(x, degrees, shift):
    expected = 1.0 - special.chndtr(x, degrees, shift) if shift else special.chdtrc(degrees, x)
    assert non_central_above(x, degrees, shift) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("y, a, b", [(0.3, 1.5, 6.0), (0.01, 1.5, 5000.0), (0.9, 0.5, 3.0), (0.0, 1, 1)])
def test_beta(y, a, b):
    assert beta_above(y, a, b) == pytest.approx(special.betaincc(a, b, y), rel=1e-9)


@pytest.mark.parametrize("statistic", ["w", "tau"])
def test_snooping_leaves_out_the_vector_of_which_no_component_stands_out(statistic):
    network = Vectors()
    network.tests(errors(3, 5, (0.035, 0.035, 0.035)))
    found = snoop(network.system, 0.01, statistic, groups=network.groups)
    (gone,) = found.rejections
    assert {gone.row, *(row for _, row in gone.companions)} == {15, 16, 17}
    assert gone.degrees == 3 and gone.statistic > gone.critical and gone.p_value < 0.01
    assert len(gone.blunders) == 3 and gone.blunder == gone.blunders[0]


@pytest.mark.parametrize("error", [0.0, 1e4])
def test_a_vector_of_which_only_a_combination_is_controlled_is_tested_as_one(error):
    """Each component has less redundancy than is taken for control, what they are together a little more."""
    system = obseq.LeastSquares()
    point, along = system.add_points(["P"], np.zeros((1, 3))), np.array([[1.0, 0.0, 1.05]]) / 1.45
    vector = system.add_linear([np.repeat(point, 3)], [np.eye(3)], np.zeros(3), 1.0, list("XYZ"))
    for _ in range(20):
        system.add_linear([point], [along], [error], 840.0 * 20**0.5)
    groups = {vector: [np.arange(3)]}
    quality = reliability(system, system.solve(covariance=True), groups=groups)
    assert not quality.of(vector).controlled.any() and quality.of(vector).joint[0].degrees == 1
    found = snoop(system, 0.01, groups=groups)
    assert (found.end, found.suspects) == (
        (SnoopingEnd.NEEDED, ("linear Z",)) if error else (SnoopingEnd.CLEAN, ())
    )


def test_a_vector_that_is_needed_stays():
    network = Vectors()
    network.tests(errors(4, 7, (0.3, 0, 0)))
    for row in range(18, 21):  # the other vector to E
        network.batch.set_active(row, False)
    quality = reliability(network.system, network.system.solve(covariance=True), groups=network.groups)
    last = quality.of(network.batch).joint[-1]
    assert last.degrees == 0 and np.isnan(last.statistic) and not last.blunder.any()
    with pytest.raises(InputError, match="without this observation"):
        quality.left_out(network.batch, 21)
