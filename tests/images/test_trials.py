"""Trials of changed blocks end where it is clear that they will not do."""

import numpy as np
import pytest
import scenes

from obseq.images.adjustment import trials
from obseq.images.adjustment.trials import Attempts, HopelessError
from obseq.leastsquares import Iteration


def _told(**solved):
    """The solution of a block that fits badly and creeps to its end, and how much is told on the way."""
    block, _, _ = scenes.block()
    block.freeze_parameters()
    block.sets[0].measures.xy[3::9] += 300.0
    said = []
    attempts = Attempts(block, block.poses, said.append, {"covariance": False})
    return attempts.solved(attempts.copy(), "nothing", **solved), len(said)


def test_a_trial_that_creeps_far_from_fitting_is_given_up():
    found, steps = _told()
    assert found.sigma0 > 100.0
    given_up, fewer = _told(limit=50.0)
    assert given_up is None
    assert fewer < 0.8 * steps
    again, as_many = _told(limit=1.01 * found.sigma0)
    assert (again.sigma0, as_many) == (found.sigma0, steps)


def _note(sigma0s, limit=50.0):
    watch = trials._Watch(limit)
    for sigma0 in sigma0s:
        watch.note(Iteration(sigma0, 1.0, 1.0, {}))


def test_what_falls_or_rises_or_serves_is_no_creeping():
    creeping = np.linspace(100.0, 99.1, trials.CREEPING + 1)
    with pytest.raises(HopelessError, match=r"stays at 99\.1"):
        _note(creeping)
    _note(creeping[1:])
    _note(np.linspace(100.0, 98.9, trials.CREEPING + 1))
    _note([*creeping[:-1], 300.0])  # points have been put where rays meet
    _note(creeping, limit=99.2)
    _note([None] * 20)
