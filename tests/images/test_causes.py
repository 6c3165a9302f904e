"""Causes that all measures share: lines counted upwards, another unit of the focal length; or none."""

from dataclasses import replace

import numpy as np
import pytest
import scenes

from obseq.images.adjustment import causes
from obseq.images.adjustment.causes import common_cause


def _cause(block):
    return common_cause(block, block.solve(), block.poses)


def _upwards(block):
    (part,) = block.sets
    xy = np.column_stack([part.measures.xy[:, 0], scenes.CAMERA.height - part.measures.xy[:, 1]])
    block.sets = [replace(part, measures=replace(part.measures, xy=xy))]


def _block():
    block, _, _ = scenes.block()
    block.freeze_parameters()
    return block


def test_lines_that_were_counted_upwards_are_named():
    block = _block()
    _upwards(block)
    before = block.sets, block.poses
    cause = _cause(block)
    assert cause.startswith("the lines of all images were counted upwards")
    assert (block.sets, block.poses) == before


def test_a_focal_length_of_another_unit_is_named_with_the_one_that_fits():
    block = _block()
    block.cameras["c"] = replace(scenes.CAMERA, focal=3 * scenes.CAMERA.focal)
    cause = _cause(block)
    assert cause.startswith("a focal length is wrong, or its unit (camera c: 5400 px given, ")
    assert float(cause.partition("given, ")[2].split()[0]) == pytest.approx(1800.0, abs=10.0)


def test_a_good_block_and_a_single_gross_error_have_no_common_cause():
    block = _block()
    assert _cause(block) == ""
    (part,) = block.sets
    part.measures.xy[7] += 300.0
    assert block.solve().sigma0 > 5.0
    assert _cause(block) == ""


def _steps(block):
    """How often it is told what is being tried: lines counted upwards, another focal length."""
    said = []
    assert common_cause(block, block.solve(), block.poses, said.append) == ""
    tried = [f"the block does not fit: trying {what}" for what in ("lines counted upwards", "another focal")]
    steps = [sum(line.startswith(what) for line in said) for what in tried]
    assert len(said) == sum(steps)
    return steps


def test_what_is_tried_is_told_and_a_hopeless_trial_is_given_up(monkeypatch):
    block = _block()
    (part,) = block.sets
    part.measures.xy[7] += 300.0
    long = _steps(block)
    monkeypatch.setattr(causes, "FEW", 1)
    monkeypatch.setattr(causes, "TIMES", 0)
    short = _steps(block)
    assert all(1 < few < many for few, many in zip(short, long, strict=True))
