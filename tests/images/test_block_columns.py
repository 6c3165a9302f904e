"""What errors do to the equations of a block: each is the change of residuals that it makes."""

from dataclasses import replace

import numpy as np
import pytest
import scenes

from obseq.diagnosis.protocol import Change
from obseq.images import ControlPoints
from obseq.images.causes.numbering import Numbering
from obseq.images.diagnosing.model import BlockModel
from obseq.images.diagnosing.whole_images import images_off


def block_of(frozen="K.|p.|b.", **shape):
    block, poses, points = scenes.block(**({"n_images": 4, "n_points": 12, "n_control": 5} | shape))
    block.freeze_parameters(frozen)
    block.poses = poses
    return block, points


def model_of(block):
    solution = block.solve()
    return BlockModel(Numbering(solution.equations), solution.result), solution


def by_code(model):
    """Numbers of hypotheses by their code."""
    found = {}
    for index in range(len(model.hypotheses)):
        found.setdefault(model.hypotheses.code(index), []).append(index)
    return found


def column(columns, model, index):
    return columns.effect(model.hypotheses.of(index), np.ones(len(model.hypotheses.of(index))))


def test_an_image_point_is_off_by_its_pixels_over_its_sigma_and_changes_nothing_else():
    model, _ = model_of(block_of()[0])
    with model.borrowed():
        linear, columns = model.linearised(model.solution(), ())
    points = by_code(model)["I100"]
    assert len(points) == 48 and linear.n == model.numbering.n == 96 + 15
    for index in points[::5]:
        x, y = model.hypotheses.of(index)
        found = columns.effect(np.array([x]), np.ones(1))
        assert np.flatnonzero(found).tolist() == [2 * index] and found[2 * index] == pytest.approx(-2.0)
        assert np.flatnonzero(columns.effect(np.array([y]), np.ones(1))).tolist() == [2 * index + 1]
        named = model.catalogue.named(index)
        assert named.label == (index,) and named.cause.words(model.numbering, named.label) == (
            f"image i{index // 12}, point P{index % 12}"
        )


@pytest.mark.parametrize("share", [0.0, 0.6])
def test_a_control_coordinate_weighs_as_the_inverse_of_its_covariances(share):
    block, _ = block_of()
    covariances = block.control.covariances * np.arange(1.0, 6.0)[:, None, None]
    covariances[:, 0, 1] = covariances[:, 1, 0] = share * covariances[:, 0, 0]
    block.control = replace(block.control, covariances=covariances)
    model, _ = model_of(block)
    with model.borrowed():
        _, columns = model.linearised(model.solution(), ())
    found = by_code(model)
    assert len(found["I110"]) == 15 and len(found["I111"]) == 5
    for point, index in enumerate(found["I111"]):
        each = np.column_stack(
            [columns.effect(np.array([k]), np.ones(1)) for k in model.hypotheses.of(index)]
        )
        np.testing.assert_allclose(each.T @ each, np.linalg.inv(covariances[point]), rtol=1e-6)
    for k, index in enumerate(found["I110"]):
        own = column(columns, model, index)
        assert own @ own == pytest.approx(np.linalg.inv(covariances[k // 3])[k % 3, k % 3])
        assert model.catalogue.named(index).label == (k // 3, k % 3)


def residuals(model):
    """Whitened residuals of image points, where the unknowns are."""
    system = model.numbering.equations.system
    return 2.0 * np.concatenate(
        [system.residuals(one.batch).ravel() for one in model.numbering.equations.measures]
    )


def test_a_held_parameter_changes_image_points_as_a_step_of_it_does():
    model, _ = model_of(block_of(".*")[0])
    numbering, system = model.numbering, model.numbering.equations.system
    with model.borrowed():
        _, columns = model.linearised(model.solution(), ())
        found = by_code(model)["I130"]
        assert len(found) == len(numbering.parameters) > 4
        for parameter, index in zip(numbering.parameters, found, strict=True):
            at = system.unknowns.components(parameter.block).index(parameter.name)
            step, value = (
                (1e-2 if parameter.name in ("F", "PPx", "PPy") else 1e-7),
                system.values([parameter.block]),
            )
            changed = []
            for sign in (1.0, -1.0):
                moved = value.copy()
                moved[0, at] += sign * step
                system.set_values([parameter.block], moved)
                changed.append(residuals(model))
            system.set_values([parameter.block], value)
            wanted = (changed[0] - changed[1]) / (2.0 * step)
            own = column(columns, model, index)[: numbering.first_control]
            np.testing.assert_allclose(
                own, wanted, rtol=1e-4, atol=1e-4 * np.abs(wanted).max(), err_msg=parameter.name
            )
            assert wanted.any() and model.catalogue.named(index).label == (
                numbering.parameters.index(parameter),
            )


def held_block():
    block, points = block_of()
    block.control = ControlPoints.of(
        block.control.names, np.array([points[name] for name in block.control.names])
    )
    return block


def test_a_held_coordinate_changes_its_own_image_points_as_a_step_of_it_does():
    model, _ = model_of(held_block())
    numbering, system = model.numbering, model.numbering.equations.system
    with model.borrowed():
        _, columns = model.linearised(model.solution(), ())
        found = by_code(model)["I110"]
        assert numbering.held.tolist() == [[point, axis] for point in range(5) for axis in range(3)]
        for (point, axis), index in zip(numbering.held.tolist(), found, strict=True):
            block = [int(numbering.equations.points[point])]
            value, changed = system.values(block), []
            for sign in (1.0, -1.0):
                moved = value.copy()
                moved[0, axis] += sign * 1e-3
                system.set_values(block, moved)
                changed.append(residuals(model))
            system.set_values(block, value)
            wanted = (changed[0] - changed[1]) / 2e-3
            own = column(columns, model, index)[: numbering.first_control]
            np.testing.assert_allclose(own, wanted, rtol=1e-4, atol=1e-4 * np.abs(wanted).max())
            assert set(numbering.point[np.flatnonzero(own) // 2].tolist()) == {point}


def without(index, size, block, changed):
    """Centres of a block that is adjusted without an error, and of one that never had it."""
    model, _ = model_of(block)
    of = [i for i in range(len(model.hypotheses)) if model.catalogue.named(i).label == index[1]]
    (own,) = [i for i in of if model.hypotheses.code(i) == index[0]]
    with model.borrowed():
        place, converged, iterations = model.adjusted(
            model.solution(), [Change(own, np.atleast_1d(size), np.ones(np.size(size)))]
        )
        system, equations = model.numbering.equations.system, model.numbering.equations
        system.unknowns.restore(place.state)
        found = system.values(equations.centres), system.values(equations.calibrations)[:, 0]
    assert converged and iterations > 0
    other = changed.solve()
    cameras = np.array([camera.focal for camera in other.cameras.values()])
    return found, (other.poses.centres, cameras)


def test_without_an_image_point_a_block_is_adjusted_as_if_it_was_never_measured():
    wrong, other = block_of()[0], block_of()[0]
    wrong.sets[0].measures.xy[7] += [9.0, -4.0]
    other.sets[0] = other.sets[0].of_rows(np.arange(48) != 7)
    for found, wanted in zip(*without(("I100", (7,)), [9.0, -4.0], wrong, other), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-5)


def test_without_a_control_point_a_block_is_adjusted_as_if_it_was_not_known():
    wrong, other = block_of()[0], block_of()[0]
    wrong.control.coordinates[1] += [0.1, 0.3, -0.2]
    other.control = other.control.select([f"P{k}" for k in (0, 2, 3, 4)])
    for found, wanted in zip(*without(("I111", (1,)), [0.1, 0.3, -0.2], wrong, other), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-5)


def test_without_a_held_coordinate_it_is_an_unknown():
    wrong, other = held_block(), held_block()
    wrong.control.coordinates[1, 2] += 0.4
    sigmas = np.zeros((5, 3))
    sigmas[1, 2] = np.inf
    other.control = ControlPoints.of(other.control.names, other.control.coordinates, sigmas)
    for found, wanted in zip(*without(("I110", (1, 2)), [0.4], wrong, other), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-5)


def test_a_held_parameter_that_is_wrong_becomes_an_unknown():
    wrong, other = block_of(".*")[0], block_of("PP.|K.|p.|b.")[0]
    model = model_of(wrong)[0]
    focal = [one.name for one in model.numbering.parameters].index("F")
    for found, wanted in zip(*without(("I130", (focal,)), [3.0], wrong, other), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-5)


def test_how_far_image_points_are_off_is_told_in_sigmas():
    block, _ = block_of()
    block.sets[0].measures.xy[7] += [300.0, -400.0]
    model, _ = model_of(block)
    with model.borrowed():
        off = model.off(model.solution())
    wanted = np.linalg.norm(residuals(model).reshape(-1, 2), axis=1)
    np.testing.assert_allclose(off, wanted)
    assert np.argmax(off) == 7


@pytest.mark.parametrize(("count", "wanted"), [(5, []), (8, [1]), (12, [1])])
def test_images_most_of_whose_points_are_far_off_are_named(count, wanted):
    block, _ = block_of(n_images=6)
    own = 12 + np.arange(count)
    model, _ = model_of(block)
    off = np.zeros(72)
    off[own] = 7.0
    model.off = lambda _: off
    assert images_off(model, None).tolist() == wanted
    off[:36] = 7.0
    assert images_off(model, None).tolist() == []  # half of the block


def test_a_held_parameter_that_is_taken_off_changes_equations_by_its_column():
    model, _ = model_of(block_of(".*")[0])
    with model.borrowed():
        place = model.solution()
        linear, columns = model.linearised(place, ())
        before = linear.residuals.copy()
        for index, size in zip(by_code(model)["I130"][:4], (0.05, 0.05, 0.05, 1e-5), strict=True):
            own = columns.effect(model.hypotheses.of(index), np.array([size]))
            without, _ = model.linearised(place, [Change(index, np.array([size]), np.ones(1))])
            change = before - without.residuals
            np.testing.assert_allclose(change, own, atol=2e-3 * np.abs(own).max())
        again, _ = model.linearised(place, ())
        np.testing.assert_allclose(again.residuals, before, atol=1e-9)


def test_without_an_image_the_block_is_adjusted_as_if_it_had_never_been():
    block, _ = block_of(n_images=5)
    model, _ = model_of(block)
    with model.borrowed():
        model.leave_out(np.array([3]), model.solution())
        place = model.solution()
        model.numbering.equations.system.unknowns.restore(place.state)
        found = model.numbering.equations.system.values(model.numbering.equations.centres)
    other, _ = block_of(n_images=5)
    other.sets[0] = other.sets[0].of_rows(other.sets[0].measures.image != 3)
    wanted = other.solve().poses
    rows = [int(name[1:]) for name in wanted.images]
    assert 3 not in rows
    np.testing.assert_allclose(found[rows], wanted.centres, atol=1e-5)
