"""When the iterations of a block end."""

from dataclasses import replace

import numpy as np
import pytest
import scenes

from obseq.leastsquares import StopReason


def test_the_iterations_end_by_themselves():
    solution = scenes.block(noise=0.1)[0].solve()
    assert solution.result.stop_reason in (StopReason.STEP, StopReason.ROUNDING)
    assert 0.8 < solution.sigma0 < 1.2
    assert not solution.is_behind.any()


@pytest.mark.parametrize("seed", [37, 38])
def test_iterations_that_are_near_their_end_go_on_where_no_limit_was_given(seed):
    """Gross errors and a calibration that three images hardly determine: slow, and not hopeless."""
    rng = np.random.default_rng(seed)
    block, _, _ = scenes.block(n_images=3, n_control=4)
    (part,) = block.sets
    xy = part.measures.xy.copy()
    xy[rng.integers(len(xy), size=6)] += rng.normal(0.0, 60.0, (6, 2))
    block.sets = [replace(part, measures=replace(part.measures, xy=xy))]
    found, ended = block.solve(covariance=False), block.solve(max_iterations=50, covariance=False)
    assert (found.converged, ended.converged, len(ended.iterations)) == (True, False, 50)
    again = block.solve(max_iterations=1000, covariance=False)
    assert again.converged
    assert found.sigma0 == pytest.approx(again.sigma0, rel=1e-9)


def test_iterations_far_from_their_end_stop_at_the_usual_number():
    block, _, _ = scenes.block(n_control=10, n_points=60)
    (part,) = block.sets
    block.sets = [replace(part, measures=replace(part.measures, xy=part.measures.xy[:, ::-1].copy()))]
    found = block.solve(covariance=False)
    assert not found.converged
    assert len(found.iterations) == len(block.solve(max_iterations=50, covariance=False).iterations)
