"""Data snooping finds what was planted, stops where it must, and errs as often as its level says."""

import numpy as np
import pytest
from scipy.special import ndtr

import obseq
from obseq.errors import InputError
from obseq.leastsquares.statistics.hypothesis_tests import normal_critical, tau_critical
from obseq.leastsquares.statistics.snooping import Snooping, SnoopingEnd, snoop
from obseq.leastsquares.statistics.snooping_tests import Statistic

N_POINTS = 8


def levelling(seed, blunders=(), sigma=0.002, scale=1.0):
    """Height differences between all pairs of points, point 0 fixed; `scale` is how wrong the sigmas are."""
    system = obseq.LeastSquares()
    points = system.add_scalars([f"H{k}" for k in range(N_POINTS)], np.zeros(N_POINTS))
    system.freeze(points[:1])
    i, j = np.triu_indices(N_POINTS, 1)
    one = np.ones((len(i), 1))
    batch = system.add_linear([points[i], points[j]], [-one, one], np.zeros(len(i)), sigma)
    draw(system, batch, seed, blunders, scale)
    return system, batch


def draw(system, batch, seed, blunders=(), scale=1.0):
    """Gives a levelling the heights and the observations of a seed."""
    rng = np.random.default_rng(seed)
    heights = rng.uniform(100, 200, N_POINTS)
    system.set_values(np.arange(N_POINTS), heights[:, None])
    i, j = batch.blocks
    observations = batch.observations.copy()
    observations[:, -1] = heights[j] - heights[i] + scale * batch.sigmas[:, 0] * rng.normal(size=len(i))
    for row, size in blunders:
        observations[row, -1] += size
    batch.observations = observations


@pytest.mark.parametrize("statistic", ["w", "tau"])
def test_planted_blunders_are_found_and_sized(statistic):
    system, batch = levelling(4, blunders=((5, 0.08), (17, -0.05), (20, 0.03)))
    found = snoop(system, 0.01, statistic)
    assert [rejection.row for rejection in found.rejections] == [5, 17, 20]
    sizes = [rejection.blunder for rejection in found.rejections]
    assert sizes[2] == pytest.approx(0.03, abs=0.008)  # the last one, estimated without the others
    assert sizes[0] > 0.04
    assert found.end is SnoopingEnd.CLEAN
    assert not batch.active[[5, 17, 20]].any()
    assert found.result.redundancy == 21 - 3
    assert found.columns()["observation"][0].startswith("linear H0 -> ")
    assert found.rejections[0].p_value < 0.01 / (5 if statistic == "tau" else 1000)


def test_reinstating_gives_the_first_solution_back():
    system, _ = levelling(3, blunders=((5, 0.08),))
    first = system.solve()
    found = snoop(system)
    assert found.result.cost < 0.2 * first.cost
    found.reinstate()
    assert system.solve().cost == pytest.approx(first.cost, rel=1e-12)


def test_limit_and_choice_of_batches():
    system, batch = levelling(3, blunders=((5, 0.08), (17, -0.05)))
    found = snoop(system, max_rejections=1)
    assert found.end is SnoopingEnd.LIMIT
    assert len(found.rejections) == 1
    assert found.suspects == (batch.label(17),)
    found.reinstate()
    nothing = snoop(system, batches=[])
    assert nothing.end is SnoopingEnd.UNTESTABLE
    assert nothing.rejections == ()


def test_observations_that_cannot_be_told_apart_are_named_and_kept():
    system = obseq.LeastSquares()
    (a,) = system.add_scalars(["a"], [0.0])
    batch = system.add_linear([[a, a]], [np.ones((2, 1))], [1.0, 2.0], 0.01, labels=["one", "two"])
    found = snoop(system)
    assert found.end is SnoopingEnd.INSEPARABLE
    assert found.suspects == ("linear one", "linear two")
    assert batch.active.all()


def test_an_error_reinstates():
    system, batch = levelling(3, blunders=((5, 0.08),))
    calls = []
    solve = system.solve

    def failing(**options):
        calls.append(options)
        if len(calls) == 2:
            raise InputError("the second solution fails")
        return solve(**options)

    system.solve = failing
    with pytest.raises(InputError, match="second solution"):
        snoop(system, solve_options={"max_iterations": 5})
    assert batch.active.all()
    assert calls[0]["max_iterations"] == 5


def left_out_first(system, batch, errors, level, statistic):
    """Row that snooping leaves out first of observations with errors (n,), -1 where it leaves out none."""
    rows = batch.observations.copy()
    rows[:, -1] = errors
    batch.observations = rows
    found = snoop(system, level, statistic, max_rejections=1)
    found.reinstate()
    return (*(rejection.row for rejection in found.rejections), -1)[0]


@pytest.mark.parametrize(("statistic", "scale"), [("w", 1.0), ("tau", 1.0), ("tau", 7.0)])
def test_clean_networks_are_rejected_at_the_level(statistic, scale):
    """By dense algebra, on many draws; snooping leaves out the same, where something is and where not."""
    level, draws, redundancy = 0.10, 4000, 21
    system, batch = levelling(0)
    sigma, (i, j) = batch.sigmas[0, 0], batch.blocks
    design = (np.eye(N_POINTS)[j] - np.eye(N_POINTS)[i])[:, 1:]
    left = np.eye(len(i)) - design @ np.linalg.pinv(design)
    errors = scale * sigma * np.random.default_rng(6).normal(size=(len(i), draws))
    judged = np.abs(left @ errors) / np.sqrt(np.diag(left))[:, None] / sigma
    single = 1.0 - (1.0 - level) ** (1.0 / len(i))
    limit = normal_critical(single) if statistic == "w" else tau_critical(single, redundancy)
    if statistic == "tau":
        judged /= np.sqrt(np.sum(np.square(left @ errors), axis=0) / redundancy) / sigma
    rejected = judged.max(axis=0) > limit
    # Sidak's level is exact for independent tests; those of residuals are slightly dependent
    assert 0.05 < np.mean(rejected) < level + 3 * np.sqrt(level * (1 - level) / draws)
    for draw in (*range(30), *np.flatnonzero(rejected)[:20].tolist()):
        expected = judged[:, draw].argmax() if rejected[draw] else -1
        assert left_out_first(system, batch, errors[:, draw], level, statistic) == expected


def test_w_does_not_forgive_sigmas_that_are_too_small():
    found = [snoop(levelling(seed, scale=3.0)[0], 0.05, Statistic.W, max_rejections=1) for seed in range(20)]
    assert sum(bool(snooping.rejections) for snooping in found) > 15


def test_the_level_is_where_the_decision_changes():
    p_value = snoop(levelling(11)[0], 0.999, max_rejections=1).rejections[0].p_value
    assert 0.01 < p_value < 0.9
    assert snoop(levelling(11)[0], p_value * 1.001, max_rejections=1).rejections
    assert not snoop(levelling(11)[0], p_value * 0.999, max_rejections=1).rejections
    w = np.abs(snoop(levelling(11)[0], 1e-9).reliability.observations[0].w).max()
    assert p_value == pytest.approx(1 - (1 - 2 * ndtr(-w)) ** 28, rel=1e-9)


def test_single_level():
    system, batch = levelling(11)
    loose: Snooping = snoop(system, 0.2, overall=False, max_rejections=1)
    assert loose.rejections  # one of 28 exceeds its own 20 % limit almost surely
    loose.reinstate()
    assert not snoop(system, 0.001).rejections
    assert batch.active.all()
