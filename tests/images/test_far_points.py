"""Points without parallax: they neither end an adjustment nor leave it, and take part as far as they can."""

import numpy as np
import pytest
import scenes

from obseq.cli.main import main
from obseq.images import BundleAdjustment, ControlPoints, ImagePoints, Poses
from obseq.images.output.clouds import camera_table, pose_table
from obseq.images.output.page import text as summary
from obseq.images.output.record import record_of

N_NEAR, N_FAR, BASE = 20, 10, 1.5


def _block(parallax, seed=0, has_poses=True, freeze="b.|p.|K."):
    """Four images from nearly one place, eight control points, and tie points of which ten are far."""
    rng = np.random.default_rng(seed)
    centres = np.column_stack([np.linspace(0.0, BASE, 4), np.zeros(4), rng.normal(0.0, 0.05, 4)])
    rotations = scenes.looking_at(centres, np.array([0.75, 15.0, 0.0]) + 0.0 * centres)
    poses = Poses.of([f"i{k}" for k in range(4)], centres, rotations, cameras="c")
    near = rng.uniform([-4.0, 9.0, -3.0], [5.0, 21.0, 3.0], (N_NEAR, 3))
    ways = rng.uniform([-0.4, 1.0, -0.3], [0.4, 1.0, 0.3], (N_FAR, 3))
    far = (BASE / parallax if parallax else 1e9) * ways
    names = [f"N{k}" for k in range(N_NEAR)] + [f"F{k}" for k in range(N_FAR)]
    block = BundleAdjustment()
    block.add_cameras(scenes.CAMERA)
    if has_poses:
        block.add_poses(scenes.moved(poses, 0.02, 0.002, seed))
    else:
        block.add_images(poses.images, "c")
    block.add_control_points(ControlPoints.of(names[:8], near[:8] + rng.normal(0.0, 0.002, (8, 3)), 0.002))
    block.add_measures(scenes.measured(poses, np.vstack([near, far]), names, 0.5, seed + 1))
    block.freeze_parameters(freeze)
    return block, poses, dict(zip(names, np.vstack([near, far]), strict=True))


@pytest.mark.parametrize("parallax", [1e-2, 2.3e-3, 3e-4, 1e-6, 0.0])
@pytest.mark.parametrize("freeze", ["b.|p.|K.", "b."])
def test_points_of_any_parallax_take_part(parallax, freeze):
    costs = []
    for has_poses in (True, False):
        block, poses, _ = _block(parallax, has_poses=has_poses, freeze=freeze)
        block.initialise()
        found = block.solve()
        assert found.converged and not found.left_out and found.weak == ""
        assert len(found.iterations) <= 25
        assert 0.85 < found.sigma0 < 1.15
        sigmas = np.sqrt(np.diagonal(found.centre_covariances, axis1=1, axis2=2))
        assert (np.abs(found.poses.centres - poses.centres) < 4.5 * sigmas).all()
        costs.append(found.result.cost)
    assert costs[0] == pytest.approx(costs[1], rel=1e-9)


def test_the_inverse_distance_and_its_precision_are_right():
    """At 2.3 mrad it is known to some per cent, and is what it should be; at none it is zero."""
    for parallax in (2.3e-3, 0.0):
        normalised = []
        for seed in range(6):
            block, _, truth = _block(parallax, seed)
            found = block.solve()
            for row, name in enumerate(found.points):
                if name.startswith("F"):
                    arm, unit = found.coordinates[row], truth[name] / np.linalg.norm(truth[name])
                    distance = arm @ unit
                    sigma = np.sqrt(unit @ found.point_covariances[row] @ unit) / distance**2
                    normalised.append((1.0 / distance - 1.0 / (truth[name] @ unit)) / sigma)
        assert 0.7 < np.sqrt(np.mean(np.square(normalised))) < 1.4
        assert np.abs(normalised).max() < 4.5


def test_far_points_are_told_and_spoil_nothing():
    block, _, _ = _block(1e-6)
    record = record_of(block.solve())
    assert set(record.far) == {f"F{k}" for k in range(N_FAR)}
    assert not record.behind and record.is_complete
    said = summary(record)
    assert "10 far points: Their direction is determined" in said and "behind the camera" not in said


def test_a_block_of_far_points_alone_is_not_determined():
    block, _, _ = _block(1e-6)
    (part,) = block.sets
    kept = [row for row, k in enumerate(part.measures.point) if k < 8 or k >= N_NEAR]
    block.sets = []
    block.add_measures(part.measures.rows(np.array(kept)))
    record = record_of(block.solve())
    assert len(record.far) == N_FAR and not record.is_complete


def test_points_that_meet_nowhere_at_poor_poses_are_taken_in_again():
    """One pose is off by 20 mrad: rays of its points miss each other by more than parallel ones may."""
    block, poses, _ = _block(5e-3)
    off = scenes.moved(poses, 0.0, 0.02, 5)
    rotations = poses.rotations.copy()
    rotations[3] = off.rotations[3]
    block.poses = Poses(poses.images, poses.centres, rotations, poses.cameras)
    found = block.solve()
    assert found.converged and not found.left_out
    assert found.sigma0 < 1.2


def test_a_point_behind_its_cameras_is_told():
    """Its rays spread by 0.1: they meet 15 m behind, wherever the point starts."""
    block, _, _ = _block(2.3e-3)
    xy = [scenes.CAMERA.project(np.array([[x, 0.0, 1.0]]))[0] for x in (-0.1, 0.1)]
    block.add_approximations(["B"], [[0.75, 15.0, 0.0]])
    block.add_measures(ImagePoints.of(["i0", "i3"], ["B", "B"], xy, 0.5))
    record = record_of(block.solve())
    assert [item.point for item in record.behind] == ["B", "B"]
    assert "2 points behind the camera: In the solution: B" in summary(record)
    assert not record.is_complete


def test_the_command_tells_far_points(tmp_path, capsys):
    block, _, truth = _block(1e-6)
    (part,) = block.sets
    rows = [
        f"{part.measures.image_names[i]},{part.measures.point_names[p]},{x},{y}"
        for i, p, (x, y) in zip(part.measures.image, part.measures.point, part.measures.xy, strict=True)
    ]
    control = [f"N{k},{','.join(map(str, truth[f'N{k}']))},0.002" for k in range(8)]
    poses = type("Found", (), {"poses": block.poses, "cameras": block.cameras})
    texts = {
        "cameras": camera_table(poses),
        "images": pose_table(poses),
        "control": "\n".join(["point,x,y,z,sigma", *control]),
        "measures": "\n".join(["image,point,x,y", *rows]),
    }
    for name, text in texts.items():
        (tmp_path / f"{name}.csv").write_text(text + "\n")
    options = [f"--{name}={tmp_path / name}.csv" for name in texts]
    assert main(["bundle", *options, "--image-sigma=0.5", "--freeze=K.|p.|b."]) == 0
    assert "10 far points" in capsys.readouterr().out
