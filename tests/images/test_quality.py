"""Reliability of image points, and the search for blunders among them."""

import numpy as np
import pytest
import scenes

from obseq.errors import InputError, SingularSystemError
from obseq.images import BlunderSearch, ImagePoints, Weighting
from obseq.images.diagnosing.diagnosis import diagnosed
from obseq.images.output.page import page
from obseq.images.output.page import text as summary
from obseq.images.output.record import record_of
from obseq.leastsquares import SnoopingEnd
from obseq.leastsquares.statistics.final_state import final_state


def _with_blunders(rows, size=15.0):
    block, _, _ = scenes.block()
    measures = block.sets.pop().measures
    xy = measures.xy.copy()
    xy[rows, 1] += size
    names = [measures.label(row) for row in rows]
    block.add_measures(
        ImagePoints.packed(
            measures.image_names,
            measures.point_names,
            measures.image,
            measures.point,
            xy,
            measures.sigmas,
        )
    )
    return block, names


@pytest.fixture(scope="module")
def clean():
    return scenes.block()[0].solve()


def test_redundancy_numbers_sum_up_to_the_redundancy(clean):
    quality = clean.reliability()
    assert quality.whole.sum_of_redundancy_numbers == pytest.approx(clean.result.redundancy, abs=1e-6)
    assert ((quality.redundancy > 0.0) & (quality.redundancy < 1.0)).all()
    assert 0.6 < np.mean(np.abs(quality.w) < 1.0) < 0.76  # 68 %


def test_the_numbers_are_those_of_the_dense_hat_matrix(clean):
    """r = 1 - diagonal of A Q A', with the inverse of the whole normal matrix."""
    equations = clean.equations
    normal = equations.system.equations()
    inverse = np.linalg.inv(normal.pattern.matrix(normal.assemble(viscous=False).values).toarray())
    quality = clean.reliability()
    rows = final_state(equations.system, clean.result).rows(equations.measures[0].batch, [3, 40])
    for k, row in enumerate((3, 40)):
        hat = np.einsum("mi,ij,mj->m", rows[k], inverse, rows[k])
        np.testing.assert_allclose(quality.redundancy[row], 1.0 - hat, atol=1e-9)


def test_leaving_a_measure_out_gives_the_residual_that_was_foretold(clean):
    quality = clean.reliability()
    row = int(quality.worst(1)[0])
    effect = quality.whole.left_out(clean.equations.measures[0].batch, row)
    block, _, _ = scenes.block()
    measures = block.sets.pop().measures
    found = clean.residuals
    name = quality.label(row)
    kept = np.array([measures.label(k) != name for k in range(len(measures))])
    block.add_measures(measures.rows(kept))
    without = block.solve()
    k, image = without.points.index(clean.points[found.point[row]]), clean.poses.images[found.image[row]]
    local = without.poses[image].to_local(without.coordinates[k][None])
    pixel = without.cameras["c"].project(local)[0]
    np.testing.assert_allclose(pixel - found.xy[row], effect.residuals, atol=0.02)


def test_blunders_are_left_out_and_named(clean):
    block, names = _with_blunders([5, 60, 130])
    solution = block.solve(blunders=BlunderSearch())
    assert {f"image {item.image}, point {item.point}" for item in solution.blunders.rejected} == set(names)
    assert all(item.axis == "y" for item in solution.blunders.rejected)
    assert all(item.blunder == pytest.approx(15.0, abs=3.0) for item in solution.blunders.rejected)
    assert solution.blunders.end is SnoopingEnd.CLEAN
    assert len(solution.residuals.row) == len(clean.residuals.row) - 3
    assert [item.name for item in solution.left_out] == [
        f"image {item.image}, point {item.point}" for item in solution.blunders.rejected
    ]
    assert "a blunder: its y is off by" in solution.left_out[0].reason
    assert solution.by_image().counts.sum() == len(solution.residuals.row)


def test_blunders_are_found_in_a_free_block_too():
    block, names = _with_blunders([60])
    free, _, _ = scenes.block(n_control=0)
    free.sets[:] = block.sets
    solution = free.solve(datum="centres", blunders=BlunderSearch(statistic="tau"))
    assert [f"image {item.image}, point {item.point}" for item in solution.blunders.rejected] == names
    assert solution.reliability().whole.redundancy == solution.result.redundancy


def test_nothing_is_left_out_where_nothing_is_wrong():
    solution = scenes.block()[0].solve(blunders=BlunderSearch(0.001))
    assert solution.blunders.rejected == ()


def test_the_record_and_the_page_have_the_tests(clean):
    solution, reliability = clean, clean.reliability()
    record = record_of(solution)
    found = record.reliability
    assert found.redundancy == pytest.approx(reliability.redundancy.sum(), rel=1e-12)
    assert found.tested + found.uncontrolled == reliability.w.size
    assert found.beyond == np.count_nonzero(np.abs(reliability.w) > reliability.whole.w_critical)
    row = reliability.worst(1)[0]
    worst = record.measures[row]
    assert f"image {worst.image}, point {worst.point}" == reliability.label(row)
    np.testing.assert_allclose((worst.w_x, worst.w_y), reliability.w[row])
    assert f"{max(map(abs, (worst.w_x, worst.w_y))):.2f}" in page(record)
    assert f"{found.beyond} beyond" in summary(record)
    assert record_of(solution, precisions=False).reliability is None


def test_reliability_takes_covariances(clean):
    without = scenes.block()[0].solve(covariance=False)
    with pytest.raises(InputError, match="covariance"):
        without.reliability()


def _with_wrong_control(shift):
    block, _, _ = scenes.block()
    block.control.coordinates[2, 1] += shift
    return block


def test_a_wrong_control_coordinate_is_left_out_and_no_good_measure_is():
    solution = _with_wrong_control(0.05).solve(blunders=BlunderSearch())
    assert solution.blunders.end is SnoopingEnd.CLEAN
    (found,) = solution.blunders.rejected
    assert found.name == "control point P2 y"
    assert found.blunder == pytest.approx(0.05, abs=0.01)
    (item,) = solution.left_out
    assert (item.kind, item.name) == ("observation", "control point P2 y")
    assert "off by 0.05" in item.reason
    assert 0.9 < solution.sigma0 < 1.1
    names, residuals = solution.control_residuals()
    assert residuals[names.index("P2"), 1] == pytest.approx(-found.blunder, abs=0.005)


def test_a_wrong_length_and_a_wrong_measure_are_told_apart():
    block, (name,) = _with_blunders([60])
    _, _, truth = scenes.block()
    block.add_length("P10", "P12", float(np.linalg.norm(truth["P10"] - truth["P12"])) + 0.2, 0.005)
    solution = block.solve(blunders=BlunderSearch())
    assert {item.as_left_out().name for item in solution.blunders.rejected} == {name, "length P10 to P12"}
    assert "length P10 to P12" in summary(record_of(solution))


def test_an_observed_pose_that_is_wrong_ends_the_search():
    block, truth, _ = scenes.block()
    known = truth.select(truth.images[:2])
    shifted = type(known)(
        known.images, np.add(known.centres, [[0.3, 0, 0], [0, 0, 0]]), known.rotations, known.cameras
    )
    block.observe_poses(shifted, 0.01)
    solution = block.solve(blunders=BlunderSearch())
    assert solution.blunders.end is SnoopingEnd.GIVEN
    assert not solution.blunders.rejected
    assert "i0" in solution.blunders.suspects[0]


@pytest.mark.parametrize("weighting", [(0.5, 0.5, None, 1.0), (0.5, 1.5, None, 2.0), (0.5, 1.0, 5.0, 2.0)])
def test_robust_weights_show_all_blunders_and_hardly_any_good_measure(weighting):
    missed = wrong = 0
    for seed in range(4):
        block, _, _ = scenes.block(seed=seed, n_points=20, n_images=6)
        measures = block.sets.pop().measures
        rng = np.random.default_rng(seed)
        rows = np.array([rng.choice(np.flatnonzero(measures.point == k)) for k in range(0, 16, 2)])
        rows = rows[: 8 if seed else 0]  # one for a point: of two the wrong ones may win
        measures.xy[rows, 0] += rng.choice([-1, 1], len(rows)) * rng.uniform(8.0, 40.0, len(rows))
        block.add_measures(measures, Weighting(*weighting))
        block.freeze_parameters("K2|K3|p.|b.")
        solution = block.solve()
        accused = diagnosed(solution, block.poses).accused
        found = {int(solution.residuals.row[place.row]) for one in accused for place in one.observations}
        missed += len(set(rows.tolist()) - found)
        wrong += len(found - set(rows.tolist()))
    assert (missed, wrong) == (0, 0)


def test_a_threshold_that_rejects_all_image_points_is_an_error_though_poses_are_observed():
    block, _, _ = scenes.block(n_images=3, n_points=8, n_control=8)
    block.poses = scenes.moved(block.poses, 0.3, 0.03)
    block.observe_poses(block.poses, 1e-4, 1e-6)
    block.freeze_parameters()
    block.add_measures(block.sets.pop().measures, Weighting(0.5, threshold=0.5))
    with pytest.raises(
        SingularSystemError, match=r"all 24 image points lie beyond the threshold[^\n]*\n.*attenuation"
    ):
        block.solve()
