"""A second adjustment without what is accused."""

import numpy as np
import pytest
import scenes
from accused import diagnosis

from obseq.errors import InputError
from obseq.images import ControlPoints
from obseq.images.diagnosing.diagnosis import diagnosed
from obseq.images.diagnosing.without_accused import without_accused


def _block():
    block, _, _ = scenes.block(n_images=5, n_points=16, n_control=7)
    block.freeze_parameters("K.|p.|b.")
    return block


@pytest.mark.parametrize("is_held", [False, True])
def test_the_adjustment_without_what_is_accused_is_what_the_diagnosis_said(is_held):
    block = _block()
    if is_held:
        block.control = ControlPoints.of(block.control.names, block.control.coordinates)
    block.sets[0].measures.xy[20] += [40.0, 10.0]
    block.control.coordinates[2, 1] += 0.8
    block.initialise()
    solution = block.solve()
    found = diagnosed(solution, block.poses)
    assert len(found.accused) == 2
    rest = without_accused(solution, found)
    rest.initialise()
    second = rest.solve()
    assert second.sigma0 == pytest.approx(found.sigma0, rel=1e-6)
    assert second.result.redundancy == found.redundancy
    assert len(rest.sets[0].measures) == len(block.sets[0].measures) - 1
    free = ControlPoints.of(["P"], np.zeros((1, 3))).is_free.copy()
    free[0, 1] = True
    assert rest.control.is_free[2].tolist() == free[0].tolist()
    assert not block.control.is_free.any()  # the block that was given is as it was
    assert diagnosis(rest).status == "accepted"


def test_there_is_none_where_nothing_is_accused():
    block = _block()
    solution = block.solve()
    with pytest.raises(InputError, match="nothing is accused"):
        without_accused(solution, diagnosed(solution, block.poses))
