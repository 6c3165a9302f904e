"""A drone with five cameras, one down and four aslant, fixed to one another, and a receiver."""

import flights
import numpy as np
import pytest

from obseq.formats.blocks.rigs import Rig, add_rig
from obseq.geometry import RigidMotion, absorb, exponential
from obseq.images import BundleAdjustment, Camera, ControlPoints, ImagePoints, Poses
from obseq.images.output.page import text as summary
from obseq.images.output.record import record_of

TILT = np.radians(40.0)
PLACES = {
    "down": RigidMotion(np.zeros(3), np.eye(3)),
    "right": RigidMotion(np.array([0.06, 0.0, 0.01]), exponential([0.0, TILT, 0.0])),
    "left": RigidMotion(np.array([-0.06, 0.0, 0.01]), exponential([0.0, -TILT, 0.0])),
    "fore": RigidMotion(np.array([0.0, -0.06, 0.01]), exponential([TILT, 0.0, 0.0])),
    "aft": RigidMotion(np.array([0.0, 0.06, 0.01]), exponential([-TILT, 0.0, 0.0])),
}


def _block(seed=3):
    """Exposures of a flight, five images each; first values of places are off by a degree."""
    rng = np.random.default_rng(seed)
    masters, _ = flights._flown(2, 5, rng)
    low, high = masters.centres[:, :2].min(axis=0) - 60.0, masters.centres[:, :2].max(axis=0) + 60.0
    points = np.column_stack([rng.uniform(low, high, (120, 2)), rng.normal(0.0, 4.0, 120)])
    block, names = BundleAdjustment(), [f"t{k}" for k in range(len(points))]
    images, centres, rotations, owners, exposures, parts = [], [], [], [], [], []
    for camera, place in PLACES.items():
        block.add_cameras(Camera(camera, 4000, 3000, 3005.0, degree=(3, 1, 1)))
        for k, exposure in enumerate(masters.images):
            pose = RigidMotion(masters.centres[k], masters.rotations[k]) @ place
            local = pose.to_local(points)
            seen = np.flatnonzero(flights.CAMERA.sees(local))
            xy = flights.CAMERA.project(local[seen]) + rng.normal(0.0, 0.4, (len(seen), 2))
            parts += [(len(images), point, *pixel) for point, pixel in zip(seen, xy, strict=True)]
            exposures.append((camera, exposure, f"{camera}-{exposure}"))
            images.append(f"{camera}-{exposure}")
            centres.append(pose.centre + rng.normal(0.0, 0.2, 3))
            rotations.append(absorb(pose.rotation[None], rng.normal(0.0, 0.005, (1, 3)))[0])
            owners.append(camera)
    block.add_poses(Poses.of(images, centres, rotations, cameras=owners))
    rows = np.array(parts)
    image, point = rows[:, :2].T.astype(int)
    block.add_measures(ImagePoints.packed(images, names, image, point, rows[:, 2:], 0.4))
    first = {
        name: RigidMotion(place.centre, place.rotation @ exponential(np.full(3, 0.01) * (name != "down")))
        for name, place in PLACES.items()
    }
    add_rig(block, Rig("five", "down", first, exposures))
    antennas = (
        masters.centres
        + masters.rotations @ flights.LEVER
        + rng.normal(size=masters.centres.shape) * flights.GPS
    )
    block.observe_antenna(
        [f"down-{name}" for name in masters.images],
        antennas,
        np.tile(flights.GPS, (len(masters), 1)),
        lever_sigmas=np.inf,
    )
    often = rng.permutation(np.flatnonzero(np.bincount(point, minlength=len(names)) >= 5))
    for chosen, add in ((often[:3], block.add_control_points), (often[3:18], block.add_check_points)):
        given = points[chosen] + rng.normal(0.0, 0.01, (len(chosen), 3))
        add(ControlPoints.of([names[k] for k in chosen], given, 0.01))
    return block


@pytest.fixture(scope="module")
def solved():
    return _block().solve()


def test_places_lever_arm_and_cameras_come_back_within_their_sigmas(solved):
    assert solved.converged
    assert 0.93 < solved.sigma0 < 1.07
    places, sigmas = solved.rigid_places("five"), solved.rigid_place_precisions("five")
    for k, name in enumerate(places.images):
        assert (np.abs(places.centres[k] - PLACES[name].centre) <= 4.0 * sigmas[k, :3] + 1e-12).all()
    lever, own = solved.lever_arm()
    assert (np.abs(lever - flights.LEVER) < 3.5 * own).all()
    for camera in solved.cameras.values():
        spread = solved.camera_precisions(camera.name)
        assert abs(camera.focal - 3000.0) < 4.0 * spread["F"]
    found = solved.check_residuals()
    assert len(found.names) == 15
    assert (np.abs(found.differences) <= 1.96 * found.sigmas).mean() > 0.85


def test_the_rig_holds(solved):
    found = solved.rigid_residuals("five")
    assert len(found.exposures) == 4 * 10
    assert np.abs(found.translations).max() < 1e-3
    assert np.abs(found.rotations).max() < 1e-5
    assert "five   down, right" in summary(record_of(solved))
