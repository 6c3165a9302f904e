"""Robust weights: their functions, their solutions against scipy's, and what they do to blunders."""

import numpy as np
import pytest
from scipy.optimize import least_squares, linprog

from obseq import InputError
from obseq.errors import SingularSystemError
from obseq.leastsquares import (
    IGG3,
    L1,
    Attenuated,
    Cauchy,
    GemanMcClure,
    Huber,
    LeastSquares,
    Tukey,
    graduated,
)
from obseq.leastsquares.problem.losses import named_loss


@pytest.mark.parametrize(
    ("loss", "u", "weights"),
    [
        (Huber(1.5), [0.0, 1.5, 3.0], [1.0, 1.0, 0.5]),
        (L1(0.1), [0.0, 0.1, 4.0], [10.0, 10.0, 0.25]),
        (Cauchy(2.0), [0.0, 2.0, 6.0], [1.0, 0.5, 0.1]),
        (GemanMcClure(3.0), [0.0, 3.0, 6.0], [1.0, 0.25, 0.04]),
        (Tukey(4.0), [0.0, 2.0, 4.0, 9.0], [1.0, 0.5625, 0.0, 0.0]),
        (IGG3(1.5, 4.5), [1.0, 3.0, 4.5, 9.0], [1.0, 0.125, 0.0, 0.0]),
        (Attenuated(2.0), [0.0, 2.0, 6.0], [1.0, 0.5, 0.25]),
        (Attenuated(2.0, exponent=2.0), [2.0, 6.0], [0.5, 0.1]),
        (Attenuated(None, threshold=3.0), [2.0, 3.0, 3.1], [1.0, 1.0, 0.0]),
    ],
)
def test_weights_by_hand(loss, u, weights):
    assert loss.weights(np.array(u)) == pytest.approx(weights)


@pytest.mark.parametrize(
    "loss", [Huber(), L1(), Cauchy(), GemanMcClure(), Tukey(), IGG3(), Attenuated(2.0, 9.0)]
)
def test_a_wider_loss_is_the_same_on_another_scale(loss):
    u = np.linspace(0.0, 12.0, 25)
    shape = loss.widened(3.0).weights(3.0 * u)
    scale = 3.0 if isinstance(loss, L1) else 1.0
    assert scale * shape == pytest.approx(loss.weights(u))


@pytest.mark.parametrize(
    "make",
    [lambda: Huber(0.0), lambda: Cauchy(-1.0), lambda: IGG3(2.0, 1.0), lambda: Attenuated(1.0, -2.0)],
)
def test_constants_are_positive(make):
    with pytest.raises(InputError, match="must be"):
        make()


def line(loss, blunders=True, seed=0):
    """y = 2 + 0.5 x with noise of 0.1, three of thirty values off by up to 40 sigmas."""
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, 10.0, 30)
    y = 2.0 + 0.5 * x + rng.normal(0.0, 0.1, 30)
    if blunders:
        y[[4, 17, 28]] += [4.0, -2.5, 3.0]
    system = LeastSquares()
    ids = system.add_vectors(["line"], [[0.0, 0.0]], ["offset", "slope"])
    design = np.column_stack([np.ones(30), x])
    batch = system.add_linear([ids.repeat(30)], [design], y, 0.1)
    batch.loss = loss
    return system, ids, batch, design, y


@pytest.mark.parametrize(
    ("loss", "name", "scale"), [(Huber(1.345), "huber", 1.345), (Cauchy(2.385), "cauchy", 2.385)]
)
def test_solutions_as_scipy_finds_them(loss, name, scale):
    system, ids, _, design, y = line(loss)
    result = system.solve(max_iterations=200, tolerance=1e-10)
    expected = least_squares(
        lambda p: (design @ p - y) / 0.1,
        [2.0, 0.5],
        loss=name,
        f_scale=scale,
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    assert result.converged
    assert result.values(ids)[0] == pytest.approx(expected.x, abs=1e-7)


def test_least_absolute_residuals_as_linear_programming_finds_them():
    system, ids, _, design, y = line(L1(1e-7))
    result = system.solve(max_iterations=300, tolerance=1e-9)
    n = len(y)
    program = linprog(
        np.concatenate([np.zeros(2), np.ones(2 * n)]),
        A_eq=np.hstack([design, np.eye(n), -np.eye(n)]),
        b_eq=y,
        bounds=[(None, None)] * 2 + [(0, None)] * (2 * n),
    )
    assert result.values(ids)[0] == pytest.approx(program.x[:2], abs=1e-5)


@pytest.mark.parametrize("loss", [Tukey(), IGG3(), GemanMcClure(), Attenuated(1.0, threshold=6.0)])
def test_blunders_lose_their_weight(loss):
    system, ids, batch, *_ = line(loss)
    system.solve(before_iteration=graduated({batch: loss}), max_iterations=60)
    weights = batch.robust_weights()
    assert weights[[4, 17, 28]].max() < 0.05
    assert np.median(weights) > 0.5
    clean = line(None, blunders=False)
    expected = clean[0].solve().values(clean[1])
    assert system.values(ids) == pytest.approx(expected, abs=0.04)


def test_without_blunders_nothing_is_lost():
    system, ids, batch, *_ = line(Huber(6.0), blunders=False)
    plain, same, *_ = line(None, blunders=False)
    assert system.solve().values(ids) == pytest.approx(plain.solve().values(same), abs=1e-12)
    assert batch.robust_weights() == pytest.approx(np.ones(30))


def test_statistics_are_those_of_the_final_weights():
    system, ids, batch, design, y = line(Tukey())
    system.set_values(ids, [[2.0, 0.5]])
    result = system.solve(max_iterations=100, covariance="all")
    weights = Tukey().weights(np.abs(result.normalised_residuals(batch)).ravel())
    assert batch.robust_weights() == pytest.approx(weights, abs=1e-12)
    residuals = (design @ result.values(ids)[0] - y) / 0.1
    assert result.cost == pytest.approx(np.sum(weights * residuals**2))
    normal = design.T @ (weights[:, None] * design) / 0.01
    assert result.covariance(ids, a_priori=True)[0] == pytest.approx(np.linalg.inv(normal), rel=1e-4)


def test_one_weight_for_all_residuals_of_an_observation():
    system = LeastSquares()
    points = system.add_points(["A", "B"], [[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]])
    turn = system.add_rotations(["R"], [np.eye(3)])
    ids = {"frame": turn, "p1": points[:1], "p2": points[1:]}
    batch = system.add("TopoSubFrame", ids, [[0.0, 0.0, 0.0]], [[1.0, 2.0, 1.0]], loss=Cauchy(2.0))
    system.equations().reweight()
    u = np.hypot(3.0, 2.0)
    assert batch.robust_weights() == pytest.approx([1.0 / (1.0 + (u / 2.0) ** 2)])
    assert batch.weights[:, 0] ** 2 * [1.0, 4.0, 1.0] == pytest.approx(batch.robust_weights().repeat(3))


def test_a_loss_is_had_by_its_name_too():
    system = LeastSquares()
    ids = system.add_scalars(["x"], np.zeros(1))
    batch = system.add_linear([ids], [np.ones((1, 1))], [1.0], 0.1)
    batch.loss = "tukey"
    assert batch.loss == Tukey()
    with pytest.raises(InputError, match="'hubert'; nearest names: huber"):
        batch.loss = "hubert"


@pytest.mark.parametrize(
    ("name", "loss"),
    [
        ("Geman-McClure", GemanMcClure()),
        ("geman_mcclure", GemanMcClure()),
        ("IGG-III", IGG3()),
        ("HUBER", Huber()),
    ],
)
def test_a_name_is_written_in_any_way(name, loss):
    assert named_loss(name) == loss


@pytest.mark.parametrize("strategy", ["gauss-newton", "levenberg-marquardt"])
def test_a_loss_that_rejects_everything_is_told_with_its_groups(strategy):
    system = LeastSquares()
    ids = system.add_scalars(["x"], np.full(1, 50.0))
    for group, n in (("near", 2), ("far", 3)):
        batch = system.add_linear([np.repeat(ids, n)], [np.ones((n, 1))], np.ones(n), 0.1, group=group)
        batch.loss = "tukey"
    with pytest.raises(SingularSystemError) as refused:
        system.solve(strategy=strategy)
    told = "The loss leaves 5 of 5 observations no weight: 2 of 2 of near (Tukey), 3 of 3 of far (Tukey); "
    assert str(refused.value).startswith(told) and refused.value.unknowns == ("x",)


@pytest.mark.parametrize("strategy", ["gauss-newton", "levenberg-marquardt"])
def test_a_loss_that_leaves_priors_alone_is_told_and_one_beside_other_observations_is_not(strategy):
    system = LeastSquares()
    x = system.add_scalars(["x"], np.full(1, 50.0))
    system.add_prior(x, [[50.0]], 0.5)
    batch = system.add_linear([np.repeat(x, 3)], [np.ones((3, 1))], np.ones(3), 0.1, group="far")
    batch.loss = "tukey"
    with pytest.raises(
        SingularSystemError, match=r"leaves 3 of 3 observations no weight: 3 of 3 of far.*So only priors say"
    ):
        system.solve(strategy=strategy)
    system.add_linear([x], [np.ones((1, 1))], [50.0], 0.1)
    assert system.solve(strategy=strategy).values(x)[0] == pytest.approx([50.0])


def test_a_loss_that_rejects_little_is_not_to_blame_for_what_nothing_determines():
    system = LeastSquares()
    x, y = system.add_scalars(["x", "y"], np.zeros(2))
    batch = system.add_linear([np.repeat(x, 4)], [np.ones((4, 1))], [0.0, 0.1, -0.1, 9.0], 0.1)
    system.add_linear([[x], [y]], [[[0.0]], [[0.0]]], [0.0], 0.1)
    batch.loss = "tukey"
    with pytest.raises(SingularSystemError, match=r"^the observations leave 1 unknown\(s\) undetermined: y"):
        system.solve()


def test_what_a_loss_leaves_no_weight_does_not_count_in_the_redundancy():
    """Ten readings of one length, three of them beyond the threshold: as if these had not been made."""
    rng = np.random.default_rng(2)
    readings = 5.0 + rng.normal(0.0, 0.1, 10)
    readings[[1, 4, 8]] += 30.0
    results = []
    for kept, loss in (
        (np.arange(10), Attenuated(None, 5.0, 2.0)),
        (np.delete(np.arange(10), [1, 4, 8]), None),
    ):
        system = LeastSquares()
        (a,) = system.add_scalars(["a"], [5.0])
        n = len(kept)
        batch = system.add_linear([np.repeat(a, n)], [np.ones((n, 1))], readings[kept], 0.1)
        batch.loss = loss
        results.append(system.solve(covariance=True))
    with_loss, without = results
    assert (
        (with_loss.n_observations, with_loss.redundancy)
        == (without.n_observations, without.redundancy)
        == (7, 6)
    )
    assert with_loss.sigma0 == pytest.approx(without.sigma0, rel=1e-12)
    np.testing.assert_allclose(with_loss.precisions([0]), without.precisions([0]), rtol=1e-12)
