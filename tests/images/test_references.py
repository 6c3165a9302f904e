"""Antennas with a lever arm, shutters that roll, check points."""

import flights
import numpy as np
import pytest

from obseq.errors import InputError
from obseq.images import BundleAdjustment, ControlPoints
from obseq.images.output.overview import overview
from obseq.images.output.page import text as summary
from obseq.images.output.record import record_of
from obseq.images.references import velocities_of


@pytest.fixture(scope="module")
def flown():
    made = flights.flight()
    return made, made.block.solve()


def test_lever_arm_and_readout_come_back_within_their_sigmas(flown):
    _, solution = flown
    assert solution.converged
    assert 0.9 < solution.sigma0 < 1.1
    lever, sigmas = solution.lever_arm()
    assert (np.abs(lever - flights.LEVER) < 3.0 * sigmas).all()
    assert (sigmas[:2] < 0.05).all()  # they are determined: the antenna is 25 cm off
    readout, sigma = solution.readout("c")
    assert abs(readout - flights.READOUT) < 3.0 * sigma
    assert sigma < flights.READOUT / 3.0


def test_a_readout_that_is_left_out_is_missed(flown):
    still = flights.flight().block
    still.shutters.clear()
    assert still.solve().result.cost > flown[1].result.cost + 15.0  # a chi of 4


def test_check_points_take_no_part_and_are_compared(flown):
    made, solution = flown
    found = solution.check_residuals()
    assert set(found.names) == set(made.block.check_points.names)
    assert not found.unmeasured
    place = dict(zip(made.names, made.points, strict=True))
    truth = np.array([place[name] for name in found.names])
    given = made.block.check_points.select(found.names).coordinates
    np.testing.assert_allclose(
        found.differences + given, solution.coordinates[[solution.points.index(n) for n in found.names]]
    )
    assert (np.abs(found.differences) < 4.0 * found.sigmas).all()
    assert np.abs(given - truth).max() < 0.05
    wrong = flights.flight().block
    moved, name = wrong.check_points.coordinates.copy(), wrong.check_points.names[0]
    moved[0, 2] += 0.3
    wrong.check_points = ControlPoints.of(wrong.check_points.names, moved, flights.GROUND)
    record = record_of(wrong.solve())
    assert [point.name for point in record.check_points if point.is_off] == [name]
    assert not record.is_complete
    assert any(name in line.split() and "off" in line.split() for line in summary(record).splitlines())


def test_what_is_said_of_references(flown):
    shown = summary(record_of(flown[1]))
    assert any(line.split()[:1] == ["GNSS"] for line in shown.splitlines())
    assert "Lever arms from the projection centre" in shown
    assert "Rolling shutters" in shown
    assert "of 36 coordinates within 1.96 sigmas" in shown


def test_a_central_antenna_is_an_observed_centre():
    one, other = flights.flight().block, flights.flight().block
    antenna = one.antennas[0]
    for block in (one, other):
        block.shutters.clear()
        block.antennas.clear()
    one.observe_antenna(antenna.images, antenna.positions, antenna.sigmas)
    other.observe_poses(
        flights.Poses.of(antenna.images, antenna.positions, np.tile(np.eye(3), (20, 1, 1))), antenna.sigmas
    )
    np.testing.assert_allclose(one.solve().coordinates, other.solve().coordinates, atol=1e-7)


def test_what_is_wrong_is_named():
    block = BundleAdjustment()
    with pytest.raises(InputError, match="antenna GNSS: image b: positions are finite"):
        block.observe_antenna(["a", "b"], [[0, 0, 0], [1, 1, 1]], [0.1, 0.0])
    with pytest.raises(InputError, match="all three components"):
        block.observe_antenna(["a"], [[0, 0, 0]], [[0.1, 0.1, np.inf]], (0, 0, 1))
    with pytest.raises(InputError, match="lever arm"):
        block.observe_antenna(["a"], [[0, 0, 0]], 0.1, (0, 0, 1), -1.0)
    with pytest.raises(InputError, match="different times"):
        velocities_of(["a", "b"], np.zeros((2, 3)), np.array([1.0, 1.0]))
    block.add_check_points(ControlPoints.of(["P"], [[0, 0, 0]]))
    with pytest.raises(InputError, match="'P' is given twice"):
        block.add_check_points(ControlPoints.of(["P"], [[0, 0, 0]]))


def test_a_shutter_takes_images_of_its_camera():
    made = flights.flight().block
    made.shutters.clear()
    made.roll_shutter("d", ["i000"], [[1.0, 0.0, 0.0]])
    with pytest.raises(InputError, match="shutter of d: image i000 is not of this camera"):
        made.solve()


def test_velocities_are_central_differences_in_the_order_of_time():
    found = velocities_of(
        ["a", "b", "c"], np.array([[4.0, 0, 0], [0, 0, 0], [1, 0, 0]]), np.array([2.0, 0, 1])
    )
    np.testing.assert_allclose(found[:, 0], [3.0, 1.0, 2.0])


@pytest.mark.parametrize(("sigma", "state"), [(0.0, "held"), (np.inf, "unknown"), (1.0, "observed")])
def test_what_is_said_of_a_readout(sigma, state):
    block = flights.flight().block
    block.shutters.clear()
    velocities = np.ones((len(block.poses), 3))
    block.roll_shutter("c", block.poses.images, velocities, readout=0.03, sigma=sigma)
    assert f"readout of c {state}, from 30 ms" in overview(block)


def test_a_pose_without_any_camera_is_refused():
    with pytest.raises(InputError, match=r"image i: its calibration \(not named\) is missing; known: none"):
        BundleAdjustment().add_poses(["i"], [[0.0, 0.0, 0.0]], [np.eye(3)])
