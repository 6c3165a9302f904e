"""Rigid blocks: places of cameras from what they see, in six or twelve equations, and their gauges."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.geometry import RigidMotion, exponential
from obseq.images import BundleAdjustment, ControlPoints, Exposures, Poses, initial_block
from obseq.images.output.page import page
from obseq.images.output.record import record_of

PLACES = RigidMotion(
    np.array([[0.0, 0, 0], [0.4, 0.02, 0.0], [-0.3, 0.1, 0.05]]),
    exponential(np.array([[0.0, 0, 0], [0.02, -0.1, 0.03], [0.01, 0.15, -0.02]])),
)
SIGMAS = (2e-4, 2e-5)


def _rig(n_exposures: int = 6, jitter=SIGMAS, seed: int = 0, control: bool = True):
    """Three cameras on a frame that goes round the scene and is not quite stiff."""
    rng = np.random.default_rng(seed)
    ring, points = scenes.ring(n_exposures, 40)
    names, centres, rotations = [], [], []
    for k in range(n_exposures):
        body = RigidMotion(ring.centres[k], ring.rotations[k])
        for camera in range(3):
            place = RigidMotion(
                PLACES.centre[camera] + (camera > 0) * rng.normal(0, jitter[0], 3),
                PLACES.rotation[camera] @ exponential((camera > 0) * rng.normal(0, jitter[1], 3)),
            )
            pose = body @ place
            names.append(f"{'ABC'[camera]}_{k}.tif")
            centres.append(pose.centre)
            rotations.append(pose.rotation)
    poses = Poses.of(names, np.array(centres), np.array(rotations), cameras="c")
    labels = [f"P{k}" for k in range(len(points))]
    block = BundleAdjustment()
    block.add_cameras(scenes.CAMERA)
    block.add_poses(scenes.moved(poses, 0.03, 0.003))
    if control:
        block.add_control_points(ControlPoints.of(labels[:6], points[:6], 0.001))
    block.add_measures(scenes.measured(poses, points, labels, 0.5, seed + 1))
    return block, poses


def _block(poses: Poses, **given):
    exposures = Exposures.of(poses.images, r"([ABC])_(\d+).tif")
    rigid, _ = initial_block(poses, exposures, "A", sigma_translation=SIGMAS[0], sigma_rotation=SIGMAS[1])
    return replace(rigid, **given)


def _places_are_true(solution, name="TheBloc"):
    places, sigmas = solution.rigid_places(name), solution.rigid_place_precisions(name)
    at = [places.images.index(camera) for camera in "ABC"]
    shifts = np.abs(places.centres[at] - PLACES.centre)
    assert (shifts <= 4.0 * sigmas[at, :3] + 1e-12).all()
    assert (sigmas[at[0]] == 0.0).all()
    assert (sigmas[at[1:]] > 0.0).all()


def test_the_places_are_found_and_the_scatter_is_the_one_given():
    block, _ = _rig()
    free = block.solve()
    block.add_rigid_block(_block(block.poses))
    solution = block.solve()
    _places_are_true(solution)
    # 12 pairs of 6 equations, 12 unknowns of two places
    assert solution.result.redundancy == free.result.redundancy + 12 * 6 - 12
    assert 0.9 < solution.sigma0 < 1.1
    found = solution.rigid_residuals("TheBloc")
    assert found.translations.shape == (12, 3)
    assert found.exposures[:6] == ("0", "1", "2", "3", "4", "5")
    for translation, rotation in found.scatter().values():
        assert translation < 2.0 * SIGMAS[0]
        assert rotation < 2.0 * SIGMAS[1]
    traces = [np.trace(part.camera_covariance("c")) / part.sigma0**2 for part in (solution, free)]
    assert traces[0] < traces[1]


def test_six_and_twelve_equations_weigh_the_same():
    first, second = (_rig()[0] for _ in range(2))
    first.add_rigid_block(_block(first.poses))
    second.add_rigid_block(_block(second.poses, as_matrices=True))
    six, twelve = first.solve(), second.solve()
    np.testing.assert_allclose(six.poses.centres, twelve.poses.centres, atol=1e-6)
    assert six.result.cost == pytest.approx(twelve.result.cost, rel=1e-6)
    assert twelve.result.redundancy == six.result.redundancy + 12 * 6
    assert six.sigma0 > twelve.sigma0


def test_a_soft_gauge_changes_the_place_of_the_master_only():
    block, _ = _rig()
    block.add_rigid_block(_block(block.poses))
    held = block.solve()
    other, _ = _rig()
    other.add_rigid_block(_block(other.poses, master_sigmas=(0.1, 0.01)))
    soft = other.solve()
    np.testing.assert_allclose(soft.poses.centres, held.poses.centres, atol=1e-7)
    assert soft.result.redundancy == held.result.redundancy  # six unknowns, six observations of them
    assert (soft.rigid_place_precisions("TheBloc")[0, :3] > 0.05).all()


def test_a_soft_gauge_leaves_the_place_of_the_master_its_own_observation():
    sigmas, found = (2e-3, 2e-4), []
    for own in (sigmas, {"A": sigmas, "B": sigmas, "C": sigmas}):
        block, _ = _rig()
        block.add_rigid_block(_block(block.poses, place_sigmas=own, master_sigmas=(1e3, 1e3)))
        found.append(block.solve())
    every, named = found
    np.testing.assert_allclose(every.poses.centres, named.poses.centres, atol=1e-9)
    precisions = every.rigid_place_precisions("TheBloc")[0] / every.sigma0
    assert (precisions[:3] < 1.001 * sigmas[0]).all()  # the gauge alone would leave it a thousand
    assert (precisions[3:] < 1.001 * sigmas[1]).all()
    block, _ = _rig()
    block.add_rigid_block(_block(block.poses, place_sigmas=sigmas, master_sigmas=(sigmas[0], None)))
    half = block.solve()
    # its rotation is held: three unknowns less, and six observations, of the gauge and of itself
    assert half.result.redundancy == every.result.redundancy - 3
    held = half.rigid_place_precisions("TheBloc")[0] / half.sigma0
    assert (held[3:] == 0.0).all()
    assert (held[:3] < 1.001 * sigmas[0] / 2**0.5).all()  # two observations of the same place


def test_observed_places_and_known_ones():
    block, _ = _rig()
    given = _block(block.poses)
    true = Poses.of(given.places.images, PLACES.centre, PLACES.rotation)
    block.add_rigid_block(replace(given, places=true, place_sigmas={"B": (1e-6, 1e-7)}))
    solution = block.solve()
    np.testing.assert_allclose(solution.rigid_places("TheBloc")["B"].centre, PLACES.centre[1], atol=1e-5)
    assert not np.allclose(
        solution.rigid_places("TheBloc")["C"].centre, PLACES.centre[2], atol=1e-6, rtol=0.0
    )
    other, _ = _rig()
    other.add_rigid_block(replace(given, places=true, is_fixed=True))
    fixed = other.solve()
    assert fixed.rigid_places("TheBloc").centres.tolist() == PLACES.centre.tolist()
    assert fixed.result.redundancy == solution.result.redundancy + 12 - 6


def test_all_pairs_are_observed_each_with_its_scatter():
    block, _ = _rig()
    free = block.solve()
    exposures = Exposures.of(block.poses.images, r"([ABC])_(\d+).tif")
    rigid, statistics = initial_block(free.poses, exposures, "A", all_pairs=True)
    assert [(pair.first, pair.second) for pair in statistics] == [("A", "B"), ("A", "C"), ("B", "C")]
    assert set(rigid.pairs) == {("A", "B"), ("A", "C"), ("B", "C")}
    block.add_rigid_block(rigid)
    solution = block.solve()
    assert len(solution.rigid_residuals("TheBloc").exposures) == 18
    assert solution.result.redundancy == free.result.redundancy + 18 * 6 - 12
    _places_are_true(solution)


def test_a_free_block_takes_its_scale_from_a_rig_that_is_known():
    block, _ = _rig(control=False)
    given = _block(block.poses)
    block.add_rigid_block(given)
    with pytest.raises(InputError, match=r"rigid block TheBloc: .* nothing gives the block a scale"):
        block.solve(datum="centres")
    true = Poses.of(given.places.images, PLACES.centre, PLACES.rotation)
    block.rigid_blocks[:] = [replace(given, places=true, is_fixed=True)]
    solution = block.solve(datum="centres")
    assert solution.result.redundancy == solution.result.n_observations - solution.result.n_unknowns + 6
    ends = [solution.poses.images.index(f"A_{k}.tif") for k in (0, 3)]
    assert np.linalg.norm(np.diff(solution.poses.centres[ends], axis=0)) == pytest.approx(20.0, rel=0.02)


def test_exposures_that_do_not_fit_are_named():
    block, _ = _rig(8)
    poses = block.solve().poses
    moved = poses.centres.copy()
    moved[poses.images.index("B_3.tif")] += [0.0, 0.02, 0.0]
    wrong = Poses(poses.images, moved, poses.rotations, poses.cameras)
    _, statistics = initial_block(wrong, Exposures.of(poses.images, r"([ABC])_(\d+).tif"), "A")
    assert [pair.misfits for pair in statistics] == [("3",), ()]
    rest = [row for row, image in enumerate(poses.images) if image not in ("A_1.tif", "C_2.tif")]
    _, statistics = initial_block(
        poses.select([poses.images[row] for row in rest]),
        Exposures.of(poses.images, r"([ABC])_(\d+).tif"),
        "A",
    )
    assert [pair.missing for pair in statistics] == [(("1", "A"),), (("1", "A"), ("2", "C"))]


def test_missing_images_are_counted_and_a_mixed_project_is_no_error():
    block, poses = _rig()
    block.add_rigid_block(_block(block.poses))
    lone = "drone.jpg"
    block.add_images([lone, "B_9.tif"], "c")
    assert Exposures.of([*poses.images, lone], r"([ABC])_(\d+).tif").others == (lone,)
    without, _ = _rig()
    measures = without.sets.pop().measures
    without.add_measures(measures.rows(measures.image != measures.image_names.index("B_2.tif")))
    without.add_rigid_block(_block(without.poses))
    solution = without.solve()
    assert ("pair", "block TheBloc, exposure 2, cameras A and B") in [
        (item.kind, item.name) for item in solution.unpaired
    ]
    assert [(item.kind, item.name) for item in solution.left_out] == [("image", "B_2.tif")]
    residuals = solution.rigid_residuals("TheBloc")
    assert len(residuals.exposures) == 11
    record = record_of(solution)
    (found,) = record.rigid_blocks
    np.testing.assert_array_equal([item.translation for item in found.exposures], residuals.translations)
    assert {(pair.first, pair.second): (pair.rms_translation, pair.rms_rotation) for pair in found.pairs} == (
        residuals.scatter()
    )
    sigmas = [place.sigmas for place in found.places]
    np.testing.assert_array_equal(sigmas, solution.rigid_place_precisions("TheBloc"))
    shown = page(record)
    content = json.loads(re.search(r'id="content">(.*?)</script>', shown)[1])
    (readings,) = (table["columns"] for table in content["tables"] if table["id"] == "exposures")
    (column,) = (column["values"] for column in readings if column["title"] == "rot z")
    assert column[0] == pytest.approx(residuals.rotations[0, 2], rel=1e-4)
    assert "camera B has no image that is adjusted" in shown


def test_a_camera_without_images_keeps_its_place():
    block, _ = _rig()
    given = _block(block.poses)
    images = [image for image in block.poses.images if not image.startswith("C")]
    block.add_rigid_block(replace(given, exposures=Exposures.of(images, r"([ABC])_(\d+).tif")))
    solution = block.solve()
    np.testing.assert_array_equal(solution.rigid_places("TheBloc")["C"].centre, given.places["C"].centre)
    assert (solution.rigid_place_precisions("TheBloc")[list(given.places.images).index("C")] == 0.0).all()
    (lone,) = solution.unpaired
    assert (lone.kind, lone.name) == ("camera", "block TheBloc, camera C")


def test_what_cannot_be_a_rigid_block_is_refused():
    block, _ = _rig()
    with pytest.raises(InputError, match="a sigma must be positive, not -1"):
        _block(block.poses, place_sigmas=(-1.0, 1.0))
    with pytest.raises(InputError, match="pair of camera 'D' is not known"):
        _block(block.poses, pair_sigmas={("A", "D"): (1.0, 1.0)})
    block.add_rigid_block(_block(block.poses))
    with pytest.raises(InputError, match="is in two rigid blocks"):
        block.add_rigid_block(_block(block.poses))
