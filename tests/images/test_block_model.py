"""A block as the engine of the diagnosis sees it: columns of errors, and equations that are only borrowed."""

from dataclasses import replace

import numpy as np
import pytest
import scenes
from accused import diagnosis

from obseq.diagnosis.engine import diagnose
from obseq.images import ControlPoints
from obseq.images.causes.numbering import Numbering
from obseq.images.diagnosing.model import BlockModel


def _block(**shape):
    block, _, _ = scenes.block(n_images=5, n_points=16, n_control=7, **shape)
    block.freeze_parameters("K.|p.|b.")
    return block


def test_equations_are_given_back_as_they_were():
    block = _block()
    block.sets[0].measures.xy[20] += [40.0, 10.0]
    solution = block.solve()
    system = solution.equations.system
    before = [batch.active.copy() for batch in system.batches], system.unknowns.frozen.copy()
    state, cost = system.unknowns.state(), solution.result.cost
    model = BlockModel(Numbering(solution.equations), solution.result)
    with model.borrowed():
        assert diagnose(model).accused
    for batch, active in zip(system.batches, before[0], strict=True):
        assert np.array_equal(batch.active, active)
    assert np.array_equal(system.unknowns.frozen, before[1])
    assert np.array_equal(system.unknowns.state().values, state.values)
    assert solution.reliability() is not None and solution.result.cost == cost


def test_an_error_within_takes_nothing_away_and_equations_come_back_too():
    solution = _block().solve()
    model = BlockModel(Numbering(solution.equations), solution.result)
    active = [batch.active.copy() for batch in solution.equations.system.batches]
    with pytest.raises(ZeroDivisionError), model.borrowed():
        solution.equations.measures[0].batch.active = np.zeros(len(active[0]), dtype=bool)
        raise ZeroDivisionError
    assert np.array_equal(solution.equations.measures[0].batch.active, active[0])


@pytest.mark.parametrize("share", [0.0, 0.6])
def test_the_size_of_an_error_in_a_coordinate_is_found_where_coordinates_are_correlated(share):
    block = _block()
    covariances = block.control.covariances.copy()
    covariances[:, 0, 1] = covariances[:, 1, 0] = share * covariances[:, 0, 0]
    block.control = replace(block.control, covariances=covariances)
    block.control.coordinates[2, 1] += 0.2
    (one,) = diagnosis(block).accused
    assert one.what == "y of control point P2"
    assert one.size == pytest.approx([0.2], abs=0.02)
    assert one.test > one.limit


def test_the_size_of_an_image_point_is_given_minus_right_and_its_place_is_said():
    block = _block()
    block.sets[0].measures.xy[20] += [40.0, -10.0]
    (one,) = diagnosis(block).accused
    assert one.size == pytest.approx([40.0, -10.0], abs=2.0)
    (place,) = one.observations
    assert place.row == 20


def test_a_wrong_coordinate_that_is_held_is_named_with_its_size():
    block = _block()
    block.control = ControlPoints.of(block.control.names, block.control.coordinates)
    block.control.coordinates[2, 1] += 0.8
    (one,) = diagnosis(block).accused
    assert one.what == "y of control point P2"
    assert one.size == pytest.approx([0.8], abs=0.02)
    (known,) = one.points
    assert (known.name, known.coordinate) == ("P2", "y")


def test_a_held_point_that_is_elsewhere_is_named_as_a_whole():
    block = _block()
    block.control = ControlPoints.of(block.control.names, block.control.coordinates)
    block.control.coordinates[3] += [1.5, -2.0, 0.7]
    (one,) = diagnosis(block).accused
    assert one.what == "control point P3"
    assert one.size == pytest.approx([1.5, -2.0, 0.7], abs=0.02)


def test_nothing_is_wrong_with_what_is_held_rightly():
    block = _block()
    block.control = ControlPoints.of(block.control.names, block.control.coordinates)
    assert diagnosis(block).status == "accepted"


def _sparse(n_images, point, axis, by, seed, has_poses=True):
    """A block of free cameras, a tenth of whose measures are missing, with a control point far off."""
    block, _, _ = scenes.block(n_images=n_images, n_points=40, n_control=6, seed=seed)
    block.freeze_parameters("p.|b.")
    block.poses = scenes.moved(block.poses, 0.1, 0.01, seed=seed) if has_poses else block.poses.select([])
    kept = np.random.default_rng(seed).random(len(block.sets[0].measures)) < 0.9
    block.sets[0] = block.sets[0].of_rows(kept)
    block.control.coordinates[point, axis] += by
    return block


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axis", "by", "has_poses", "seed"),
    [(1, -8.0, True, 1), (0, 8.0, True, 6), (0, -8.0, False, 6), (1, -8.0, True, 4)],
)
def test_a_control_point_farther_off_than_the_block_is_wide_is_named_alone(axis, by, has_poses, seed):
    (one,) = diagnosis(_sparse(4, 2, axis, by, seed, has_poses)).accused
    assert one.what == f"{'xyz'[axis]} of control point P2"
    assert one.size == pytest.approx([by], abs=0.02)


@pytest.mark.slow
def test_other_starts_are_tried_where_more_is_off_than_is_told_one_by_one():
    (one,) = diagnosis(_sparse(6, 2, 2, -8.0, 2)).accused
    assert (one.what, one.size) == ("z of control point P2", pytest.approx([-8.0], abs=0.02))
