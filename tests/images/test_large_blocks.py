"""Errors in a block whose images have more points than are solved for one by one."""

import numpy as np
import pytest
import scenes
from accused import diagnosis


def _block(n_images=8):
    block, _, _ = scenes.block(n_images=n_images, n_points=700, n_control=7)
    block.freeze_parameters("K.|p.|b.")
    return block


def test_one_image_point_among_thousands_is_named():
    block = _block()
    block.sets[0].measures.xy[200] += [40.0, -10.0]
    found = diagnosis(block)
    assert [(one.what, one.others) for one in found.accused] == [("image i0, point P200", ())]
    assert found.status == "explained" and found.sigma0 < 1.05


@pytest.mark.slow
def test_a_whole_image_is_named_and_what_else_is_wrong():
    block = _block()
    measures = block.sets[0].measures
    own = np.flatnonzero(measures.image == 3)
    measures.xy[own] = measures.xy[np.roll(own, 1)]
    measures.xy[200] += [40.0, -10.0]
    found = diagnosis(block)
    assert [one.what for one in found.accused] == ["image i3", "image i0, point P200"]
    assert found.status == "explained" and found.sigma0 < 1.05
    assert all(one.test > one.limit for one in found.accused)


@pytest.mark.slow
def test_noise_that_is_larger_than_announced_accuses_nobody():
    block = _block(4)
    tails = np.random.default_rng(3).standard_t(2, block.sets[0].measures.xy.shape)
    block.sets[0].measures.xy[:] += 3.0 * tails
    found = diagnosis(block)
    assert (found.status, found.accused) == ("unexplained", ())
    assert "more contradicts the rest than a few errors do" in found.reason
