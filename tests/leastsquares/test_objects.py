"""Objects that keep their values while the system moves them."""

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.geometry import exponential
from obseq.leastsquares import LeastSquares
from obseq.leastsquares.problem.unknown_objects import Direction, Point, Scalar, UnknownPose, Vector


def station_network(**classes):
    """A station pose that reads the local coordinates of four known points exactly."""
    pose_class = classes.get("pose", UnknownPose)
    rotation, centre = exponential([0.1, -0.2, 0.3]), np.array([1.0, 2.0, 3.0])
    targets = [Point(f"T{k}", xyz) for k, xyz in enumerate([[10, 0, 0], [0, 20, 0], [0, 0, 30], [5, 5, 1]])]
    pose = pose_class("S", centre + 0.5, rotation @ exponential([0.02, 0.01, -0.03]))
    system = LeastSquares()
    system.attach(pose, *targets)
    ids = np.concatenate([target.ids["coordinates"] for target in targets])
    system.freeze(ids)
    local = (system.values(ids) - centre) @ rotation
    for formula, component in (("TopoDX", 0), ("TopoDY", 1), ("TopoDZ", 2)):
        blocks = {
            "station.centre": pose.ids["centre"],
            "station.rotation": pose.ids["rotation"],
            "target": ids,
        }
        system.add(formula, blocks, local[:, component], 0.001)
    return system, pose, centre, rotation


def test_objects_have_the_solution_when_the_system_is_solved():
    system, pose, centre, rotation = station_network()
    assert system.solve().converged
    np.testing.assert_allclose(pose.centre, centre, atol=1e-9)
    np.testing.assert_allclose(pose.rotation, rotation, atol=1e-10)


def test_what_on_update_changes_is_read_back():
    class Level(UnknownPose):
        """Its height is kept a whole number of metres."""

        def on_update(self):
            self.centre = [self.centre[0], self.centre[1], round(self.centre[2])]

    system, pose, *_ = station_network(pose=Level)
    system.solve(max_iterations=10)
    assert pose.centre[2] == 3.0
    np.testing.assert_allclose(system.values(pose.ids["centre"])[0], pose.centre)


def test_scalars_vectors_and_directions_are_written_back_as_they_are_given():
    system = LeastSquares()
    scalar, vector = Scalar("s", 0.0), Vector("v", [0.0, 0.0], ["a", "b"])
    direction = Direction("d", [0.0, 0.0, 2.0])
    system.attach(scalar, vector, direction)
    system.add_prior(scalar.ids["value"], [[4.0]], 1.0)
    system.add_prior(vector.ids["values"], [[1.0, 2.0]], 1.0)
    system.freeze(direction.ids["vector"])
    system.solve()
    assert scalar.value == pytest.approx(4.0)
    assert isinstance(scalar.value, float)
    np.testing.assert_allclose(vector.values, [1.0, 2.0])
    np.testing.assert_allclose(direction.vector, [0.0, 0.0, 1.0])


def test_freezing_by_name_pattern():
    system = LeastSquares()
    vector = Vector("camera", [1.0, 2.0, 3.0], ["F", "PPx", "PPy"])
    system.attach(vector)
    system.add_prior(vector.ids["values"], [[0.0, 0.0, 0.0]], 1.0)
    system.freeze_matching(r"camera\.PP.")
    system.solve()
    np.testing.assert_allclose(vector.values, [0.0, 2.0, 3.0], atol=1e-12)
    system.freeze_matching(r"camera\.PPx", frozen=False)
    system.solve()
    np.testing.assert_allclose(vector.values, [0.0, 0.0, 3.0], atol=1e-12)


def test_names_that_nothing_has_are_refused():
    system = LeastSquares()
    system.attach(Scalar("s", 0.0))
    with pytest.raises(InputError, match="no unknown has a name that matches 'x'"):
        system.freeze_matching("x")
    with pytest.raises(InputError, match="not a regular expression"):
        system.freeze_matching("(")


def test_an_object_belongs_to_one_system():
    scalar = Scalar("s", 0.0)
    LeastSquares().attach(scalar)
    with pytest.raises(InputError, match="already attached"):
        LeastSquares().attach(scalar)


def test_sharing_by_name_pattern():
    system = LeastSquares()
    cameras = [Vector(f"camera {k}", [k, 10.0 * k], ["F", "PPx"]) for k in (1.0, 2.0, 3.0)]
    system.attach(*cameras)
    for camera in cameras:
        system.add_prior(camera.ids["values"], [camera.values], 1.0)
    system.share_matching(r"camera .*\.F")
    system.solve()
    # One focal length for all, the mean of 1, 2, 3; the principal points stay apart.
    assert [camera.values[0] for camera in cameras] == pytest.approx([2.0, 2.0, 2.0])
    assert [camera.values[1] for camera in cameras] == pytest.approx([10.0, 20.0, 30.0])


def test_sharing_components_that_are_not_alike_is_refused():
    system = LeastSquares()
    system.attach(Vector("a", [1.0, 2.0], ["F", "G"]), Vector("b", [1.0, 2.0], ["G", "F"]))
    with pytest.raises(InputError, match="other components of 'b' than of 'a'"):
        system.share_matching(r"[ab]\.F")
