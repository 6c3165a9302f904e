"""Bundle adjustment against independent programs, and against itself by other ways."""

import json
from dataclasses import replace

import numpy as np
import panel
import pytest
import scenes

from obseq.errors import InputError, SingularSystemError
from obseq.images import (
    BundleAdjustment,
    Camera,
    ControlPoints,
    Exposures,
    ImagePoints,
    Poses,
    Weighting,
    initial_block,
)
from obseq.images.output.record import record_of


def _panel(shared_data, folder="Resec", calibrations="Calib", sigma=1.0, weighting=None):
    block = BundleAdjustment()
    block.add_cameras(*panel.cameras(shared_data, calibrations).values())
    block.add_poses(panel.poses(shared_data, folder))
    block.add_control_points(panel.control_points(shared_data, sigma))
    block.add_measures(panel.measures(shared_data), weighting, only_known_points=True)
    return block


def _agrees(solution, expected, sigma_tolerance=1e-5):
    """The tolerances that the data set states."""
    result = solution.result
    assert result.n_observations + result.n_constraints == expected["n_equations"]
    assert result.n_unknowns == expected["n_unknowns"]
    assert result.cost == pytest.approx(expected["cost"], rel=1e-7)
    assert solution.sigma0 == pytest.approx(expected["sigma0"], rel=1e-7)
    for name, parameters in expected["calibrations"].items():
        values = solution.cameras[name].parameters
        sigmas = solution.camera_precisions(name)
        for number, (parameter, given) in enumerate(parameters.items()):
            assert sigmas[parameter] == pytest.approx(given["sigma"], rel=sigma_tolerance)
            tolerance = 1e-5 if number < 3 else 1e-4 * given["sigma"]
            assert values[number] == pytest.approx(given["value"], abs=tolerance)
    for image, centre in expected["centres"].items():
        np.testing.assert_allclose(solution.poses[image].centre, centre, atol=1e-6, rtol=0.0)
    for name, place in expected.get("points", {}).items():
        found = solution.coordinates[solution.points.index(name)]
        np.testing.assert_allclose(found, place, atol=1e-6, rtol=0.0)
    assert [step.cost for step in solution.iterations[:2]] == pytest.approx(
        [step["cost"] for step in expected["iterations"][:2]], rel=1e-6
    )


@pytest.mark.parametrize(
    ("key", "sigma", "weighting"),
    [
        ("gcp_fixed", 0.0, None),
        ("gcp_sigma1_image1", 1.0, None),
        ("gcp_sigma1_image05", 1.0, Weighting(0.5)),
    ],
)
def test_the_panel_is_adjusted_as_an_independent_program_does(shared_data, key, sigma, weighting):
    expected = json.loads((shared_data / "mmvii-bundle-panel/expected.json").read_text())
    solution = _panel(shared_data, sigma=sigma, weighting=weighting).solve()
    assert solution.converged
    _agrees(solution, expected["independent_adjustments"][key])
    assert solution.by_image().counts.sum() == 2032
    rms = np.sqrt(np.mean(solution.residuals.norms**2))
    assert rms == pytest.approx(expected["independent_adjustments"][key]["image_rms_2d"], rel=1e-7)


def test_a_rigid_block_joins_the_panel(shared_data):
    expected = json.loads((shared_data / "mmvii-bundle-panel/expected.json").read_text())
    block = _panel(shared_data, "BA", "BA")
    exposures = Exposures.of(block.poses.images, r"(.*)_(.*)_Scaled.tif")
    # MMVII states the sigma of the entries of a matrix: sqrt(2) times that of the angle
    rigid, _ = initial_block(
        block.poses, exposures, "043", sigma_translation=1e-2, sigma_rotation=1e-5 / np.sqrt(2.0)
    )
    block.add_rigid_block(replace(rigid, as_matrices=True))
    given = expected["independent_adjustments"]["rigid_block_from_BA"]
    solution = block.solve()
    _agrees(solution, given)
    place = solution.rigid_places("TheBloc")["671"]
    np.testing.assert_allclose(place.centre, given["block_pose_671"]["C"], atol=1e-6)
    np.testing.assert_allclose(place.rotation, given["block_pose_671"]["R"], atol=1e-9)
    found = solution.rigid_residuals("TheBloc")
    rms = np.sqrt(np.mean(found.translations**2))
    assert rms == pytest.approx(given["block_residual"]["block_tr"], rel=1e-5)
    rms = np.sqrt(np.mean(found.rotations**2) * 6 / 9)  # nine entries, their squares twice those of the angle
    assert rms == pytest.approx(given["block_residual"]["block_rot"], rel=1e-5)


@pytest.mark.parametrize("folder", ["Resec", "BA"])
def test_the_stored_solutions_have_the_residuals_that_mmvii_reports(shared_data, folder):
    expected = json.loads((shared_data / "mmvii-bundle-panel/expected.json").read_text())
    given = expected["stored_solutions_residuals_px"][folder]
    calibrations = "Calib" if folder == "Resec" else "BA"
    cameras, poses = panel.cameras(shared_data, calibrations), panel.poses(shared_data, folder)
    measures, control = panel.measures(shared_data), panel.control_points(shared_data)
    residuals = []
    for image, name in zip(poses.images, poses.cameras, strict=True):
        part = measures.of_image(image)
        ground = control.select(part.point_names).coordinates[part.point]
        residuals.append(part.xy - cameras[name].project(poses[image].to_local(ground)))
    vectors = np.concatenate(residuals)
    norms = np.sort(np.linalg.norm(vectors, axis=1))
    assert len(norms) == given["n_measures"]
    assert norms.mean() == pytest.approx(given["Avg"], abs=1e-9)
    assert np.sqrt(np.mean(norms**2)) == pytest.approx(given["Avg2"], abs=1e-9)
    assert [norms[0], norms[-1]] == pytest.approx([given["Min"], given["Max"]], abs=1e-9)
    assert norms[len(norms) // 2] == pytest.approx(given["P50"], abs=1e-9)
    assert norms[len(norms) * 75 // 100] == pytest.approx(given["P75"], abs=1e-9)
    assert vectors.mean(axis=0) == pytest.approx([given["mean_dx"], given["mean_dy"]], abs=1e-9)


def test_the_initial_block_is_that_of_mmvii(shared_data):
    expected = json.loads((shared_data / "mmvii-bundle-panel/expected.json").read_text())["block_init"]
    for folder, numbers in expected.items():
        poses = panel.poses(shared_data, folder)
        block, (pair,) = initial_block(poses, Exposures.of(poses.images, r"(.*)_(.*)_Scaled.tif"), "043")
        assert len(pair.exposures) == numbers["n"]
        np.testing.assert_allclose(pair.mean.centre, numbers["translation"], atol=1e-9)
        np.testing.assert_allclose(pair.mean.rotation, numbers["rotation"], atol=1e-12)
        assert pair.sigma_translation == pytest.approx(numbers["SigmaTr"], rel=1e-9)
        assert pair.sigma_rotation == pytest.approx(numbers["SigmaRot"], rel=1e-9)
        assert block.places["043"].rotation.tolist() == np.eye(3).tolist()


def test_points_eliminated_or_not_give_one_solution():
    block, _, _ = scenes.block()
    first, second = block.solve(), block.solve(eliminate=False)
    np.testing.assert_allclose(first.coordinates, second.coordinates, atol=1e-9)
    np.testing.assert_allclose(first.point_covariances, second.point_covariances, rtol=1e-6, atol=1e-14)
    np.testing.assert_allclose(first.camera_covariance("c"), second.camera_covariance("c"), rtol=1e-6)
    assert first.sigma0 == pytest.approx(second.sigma0, rel=1e-10)


@pytest.mark.parametrize("eliminate", [True, False])
def test_tiny_sigmas_are_held_points(eliminate):
    held, _, truth = scenes.block(sigma=0.0)
    names = list(truth)[:6]
    tiny, _, _ = scenes.block(n_control=0)
    tiny.add_control_points(ControlPoints.of(names, [truth[name] for name in names], 1e-7))
    first, second = held.solve(), tiny.solve(eliminate=eliminate)
    np.testing.assert_allclose(first.poses.centres, second.poses.centres, atol=1e-7)
    np.testing.assert_allclose(first.centre_covariances, second.centre_covariances, rtol=1e-4, atol=1e-12)
    np.testing.assert_allclose(
        first.point_covariances[6:], second.point_covariances[6:], rtol=1e-4, atol=1e-12
    )
    np.testing.assert_allclose(first.camera_covariance("c"), second.camera_covariance("c"), rtol=1e-4)
    assert first.result.redundancy == second.result.redundancy


def test_full_covariances_of_control_points_turn_with_the_frame():
    block, _, truth = scenes.block(n_control=0)
    names = list(truth)[:6]
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    covariance = turn @ np.diag([1e-6, 4e-6, 9e-6]) @ turn.T
    covariance = 0.5 * (covariance + covariance.T)
    noise = np.random.default_rng(6).normal(size=(6, 3)) * [1e-3, 2e-3, 3e-3] @ turn.T
    given = np.array([truth[name] for name in names]) + noise
    block.add_control_points(ControlPoints.correlated(names, given, np.array([covariance] * 6)))
    solution = block.solve()
    found, residuals = solution.control_residuals()
    assert set(found) == set(names)
    inverse = np.linalg.inv(covariance)
    expected = sum(row @ inverse @ row for row in residuals)
    assert solution.result.squares["control points"] == pytest.approx(expected, rel=1e-6)


def test_national_coordinates_change_nothing_but_the_origin():
    near, far = scenes.block()[0].solve(), scenes.block(origin=(6.5e5, 6.86e6, 400.0))[0].solve()
    np.testing.assert_allclose(far.coordinates - [6.5e5, 6.86e6, 400.0], near.coordinates, atol=1e-6)
    np.testing.assert_allclose(far.point_covariances, near.point_covariances, rtol=1e-4, atol=1e-13)


def test_a_free_block_keeps_its_shape_and_its_middle():
    block, poses, _truth = scenes.block(n_control=0)
    solution = block.solve(datum="centres")
    assert solution.result.redundancy == solution.result.n_observations - solution.result.n_unknowns + 7
    shift = solution.poses.centres - solution.start.poses.centres
    np.testing.assert_allclose(shift.mean(axis=0), 0.0, atol=1e-6)
    distance = np.linalg.norm(solution.poses.centres[0] - solution.poses.centres[4])
    assert distance == pytest.approx(np.linalg.norm(poses.centres[0] - poses.centres[4]), rel=0.05)
    by_points = block.solve(datum="points")
    assert by_points.sigma0 == pytest.approx(solution.sigma0, rel=1e-9)
    np.testing.assert_allclose(
        (by_points.coordinates - by_points.start.coordinates).mean(axis=0), 0, atol=1e-6
    )


def test_a_scale_bar_gives_the_scale_of_a_free_block():
    block, _, truth = scenes.block(n_control=0)
    length = np.linalg.norm(truth["P0"] - truth["P1"])
    block.add_length("P0", "P1", length, 1e-4)
    solution = block.solve(datum="centres")
    a, b = (solution.coordinates[solution.points.index(name)] for name in ("P0", "P1"))
    assert np.linalg.norm(a - b) == pytest.approx(length, abs=1e-6)
    assert solution.result.redundancy == solution.result.n_observations - solution.result.n_unknowns + 6


def test_robust_weights_bring_back_a_block_with_gross_errors():
    block, _, _ = scenes.block()
    clean = block.solve()
    dirty, _, _ = scenes.block()
    measures = dirty.sets.pop().measures
    xy = measures.xy.copy()
    bad = np.arange(3, len(measures), 29)
    xy[bad] += 40.0
    made = ImagePoints.packed(
        measures.image_names, measures.point_names, measures.image, measures.point, xy, measures.sigmas
    )
    dirty.add_measures(made, Weighting(0.5, attenuation=1.0, exponent=2.0))
    solution = dirty.solve(max_iterations=200)
    sigmas = np.sqrt(np.diagonal(clean.centre_covariances, axis1=1, axis2=2))
    assert (np.abs(solution.poses.centres - clean.poses.centres) < 4.0 * sigmas).all()
    found = solution.residuals
    assert set(found.row[found.weights < 0.01]) == set(bad)


def test_parameters_are_frozen_freed_shared_and_observed():
    block, _poses, _ = scenes.block(sigma=0.001)
    block.freeze_parameters("K3|p.|b.")
    block.free_parameters("p1")
    block.observe_parameters("F", 1e-3)
    solution = block.solve()
    precisions = solution.camera_precisions("c")
    assert precisions["K3"] == precisions["p2"] == precisions["b1"] == 0.0
    assert precisions["p1"] > 0.0
    assert solution.cameras["c"].focal == pytest.approx(1800.0, abs=0.01)
    assert precisions["F"] < 1.2e-3
    with pytest.raises(InputError, match=r"matches 'Q' .*; there are camera c: F, PPx, PPy, "):
        block.freeze_parameters("Q")


def test_two_cameras_share_a_focal_length():
    _, poses, truth = scenes.block()
    names = list(truth)
    half = Poses(poses.images, poses.centres, poses.rotations, ("c", "d") * 4)
    block = BundleAdjustment()
    block.add_cameras(scenes.CAMERA, scenes.CAMERA.with_parameters(scenes.CAMERA.parameters, "d"))
    block.add_poses(scenes.moved(half, 0.02, 0.002))
    block.add_control_points(ControlPoints.of(names[:6], [truth[name] for name in names[:6]], 0.001))
    block.add_measures(scenes.measured(poses, np.array(list(truth.values())), names, 0.5))
    block.share_parameters("F|PPx")
    solution = block.solve()
    first, second = solution.cameras["c"].parameters, solution.cameras["d"].parameters
    np.testing.assert_allclose(first[:2], second[:2], rtol=1e-12)
    assert abs(first[2] - second[2]) > 1e-3


def test_observed_and_frozen_poses_are_a_datum():
    block, poses, _ = scenes.block(n_control=0)
    block.observe_poses(poses.select(["i0", "i3", "i5"]), 0.001, 1e-4)
    solution = block.solve()
    np.testing.assert_allclose(solution.poses["i3"].centre, poses["i3"].centre, atol=0.004)
    np.testing.assert_allclose(solution.poses["i3"].rotation, poses["i3"].rotation, atol=4e-4)
    frozen, _, _ = scenes.block(n_control=0)
    frozen.freeze_centres("i[0-3]")
    frozen.freeze_rotations("i0")
    kept = frozen.solve()
    assert kept.poses["i2"].centre.tolist() == kept.start.poses["i2"].centre.tolist()
    np.testing.assert_allclose(kept.poses["i0"].rotation, kept.start.poses["i0"].rotation, atol=1e-15)


def test_slow_poses_find_the_same_solution():
    first = scenes.block()[0].solve()
    block, _, _ = scenes.block()
    block.slow_poses(0.5, 0.05)
    second = block.solve(max_iterations=200)
    np.testing.assert_allclose(second.poses.centres, first.poses.centres, atol=1e-6)
    assert second.result.n_observations == first.result.n_observations


def test_precisions_of_angles_and_correlations():
    solution = scenes.block()[0].solve()
    rotation = np.sqrt(np.trace(solution.rotation_covariances, axis1=1, axis2=2))
    assert (solution.attitude_precisions("opk") < 10.0 * rotation[:, None]).all()
    correlations = solution.camera_correlations("c")
    np.testing.assert_allclose(np.diagonal(correlations), 1.0)
    names = solution.cameras["c"].parameter_names
    assert correlations[names.index("K1"), names.index("K2")] < -0.8
    cross = solution.camera_pose_correlations("c", "i0")
    assert cross.shape == (10, 6)
    assert np.abs(cross).max() < 1.0
    np.testing.assert_allclose(
        solution.pose_covariance("i0")[:3, :3], solution.centre_covariances[0], rtol=1e-9
    )


def test_what_takes_no_part_is_named():
    block, _poses, _truth = scenes.block()
    block.add_images(["late"], "c")
    block.add_measures(ImagePoints.of(["i0"], ["alone"], [[1000.0, 700.0]]))
    solution = block.solve()
    assert [(item.kind, item.name) for item in solution.left_out] == [("image", "late"), ("point", "alone")]
    assert "1 ray; a free point takes 2" in solution.left_out[1].reason
    assert "alone" not in solution.points


def test_a_block_without_datum_is_refused():
    block, _, _ = scenes.block(n_control=0)
    with pytest.raises(InputError, match="the block has no datum: 0 coordinates"):
        block.solve()
    block, _, _truth = scenes.block(n_control=0)
    line = np.linspace([0.0, 0, 0], [1.0, 1, 1], 3)
    names = ["L0", "L1", "L2"]
    _, poses, _ = scenes.block()
    block.add_control_points(ControlPoints.of(names, line, 0.001))
    block.add_measures(scenes.measured(poses, line, names, 0.5))
    with pytest.raises(InputError, match=r"^the block: its 3 control points \(L0, L1, L2\) are on a line"):
        block.solve()
    block.add_length("L0", "L1", 0.866, 0.001)
    with pytest.raises(InputError, match=r"^the block: its 3 control points \(L0, L1, L2\) are on a line"):
        block.solve()


def test_an_image_with_too_few_points_is_named():
    block, _, _ = scenes.block()
    place = np.array([[10.0, 0.0, 3.0]])
    block.add_poses(["few"], place, scenes.looking_at(place, np.zeros(3)), cameras="c")
    block.add_measures(ImagePoints.of(["few"] * 2, ["P7", "P8"], [[1000.0, 700.0], [1100.0, 800.0]]))
    found = block.solve()
    assert "Image few: 2 of its points take part, and a pose takes 3" in found.weak
    assert not record_of(found).is_complete
    with pytest.raises(SingularSystemError, match="undetermined"):
        found.point_covariances  # noqa: B018


def test_a_control_point_that_is_free_takes_two_rays_as_any_other():
    block, _, truth = scenes.block()
    place = truth["P9"]
    block.add_control_points(ControlPoints.of(["lone", "held"], [place, place], [np.inf, 0.001]))
    block.add_measures(ImagePoints.of(["i0", "i0"], ["lone", "held"], [[900.0, 700.0], [901.0, 700.0]]))
    solution = block.solve()
    assert [(item.name, item.reason) for item in solution.left_out] == [
        ("lone", "it has 1 ray; a free point takes 2")
    ]
    assert "held" in solution.points


def test_input_that_cannot_be_adjusted_is_named():
    block, poses, _truth = scenes.block()
    with pytest.raises(InputError, match="camera 'c' is given twice"):
        block.add_cameras(scenes.CAMERA)
    with pytest.raises(InputError, match=r"image i9: its calibration .* is missing; known: c"):
        block.add_images(["i9"], "d")
    with pytest.raises(InputError, match="image points: image 'nowhere' is not known"):
        block.add_measures(ImagePoints.of(["nowhere"], ["P0"], [[1.0, 1.0]]))
    with pytest.raises(InputError, match=r"point X: \(3000, 10\) is outside the image of 2000 by 1500"):
        block.add_measures(ImagePoints.of(["i0"], ["X"], [[3000.0, 10.0]]))
    with pytest.raises(InputError, match="image i0, point P0: measured twice"):
        block.add_measures(ImagePoints.of(["i0"], ["P0"], [[30.0, 10.0]]))
    with pytest.raises(InputError, match="point 'Q' is not known"):
        block.add_measures(ImagePoints.of(["i0"], ["Q"], [[30.0, 10.0]]), only_known_points=True)
    with pytest.raises(InputError, match="control point 'P0' is given twice"):
        block.add_control_points(ControlPoints.of(["P0"], [[0.0, 0.0, 0.0]]))
    with pytest.raises(InputError, match="image 'i0' has two poses"):
        block.add_poses(poses.select(["i0"]))
    with pytest.raises(InputError, match="length P0 - P0"):
        block.add_length("P0", "P0", 1.0, 0.1)
    with pytest.raises(InputError, match="no image measures"):
        BundleAdjustment().solve()


def test_a_control_point_behind_the_camera_is_refused():
    block, poses, _ = scenes.block()
    turned = Poses(poses.images, poses.centres, poses.rotations * [1.0, -1.0, -1.0], poses.cameras)
    wrong = BundleAdjustment()
    wrong.add_cameras(scenes.CAMERA)
    wrong.add_poses(turned)
    wrong.add_control_points(block.control)
    wrong.add_measures(block.sets[0].measures)
    with pytest.raises(InputError, match=r"image i0, point P0: the point is behind the camera .*convention"):
        wrong.solve()


def test_a_focal_length_in_millimetres_is_refused_when_it_is_added():
    with pytest.raises(InputError, match="camera w: a focal length of 24 pixels"):
        BundleAdjustment().add_cameras(Camera("w", 6000, 4000, 24.0))


def test_weights_are_those_that_mmvii_documents():
    assert Weighting(0.5, 1.0, exponent=2.0).weights([[2.0, 0.0]]) == pytest.approx([0.8])
    assert Weighting(1.0, threshold=1.5).weights([[1.1, 1.1]]) == pytest.approx([0.0])
    assert Weighting(0.2).weights([[9.0, 9.0]]) == pytest.approx([25.0])
