"""Poses, image points and control points: what they hold and what they refuse."""

import numpy as np
import panel
import pytest

from obseq.errors import InputError
from obseq.images import BundleAdjustment, Camera, ControlPoints, ImagePoints, Poses
from obseq.images.parts import Approximations


@pytest.mark.parametrize(("form", "tag"), [("quaternion", "EQ"), ("wpk", "WPK"), ("ypr", "YPR")])
def test_the_angles_are_those_that_mmvii_writes(shared_data, form, tag):
    poses, written = panel.poses(shared_data, "Resec"), panel.angles(shared_data, "Resec", tag)
    found = poses.attitudes(form)
    if form == "quaternion":
        written = written * np.sign(written[:, :1])
    else:
        found = np.degrees(found)
    np.testing.assert_allclose(found, written, atol=1e-12 if form == "quaternion" else 1e-11)
    back = Poses.of(poses.images, poses.centres, poses.attitudes(form), form)
    np.testing.assert_allclose(back.rotations, poses.rotations, atol=1e-14)


def test_poses_by_name():
    poses = Poses.of(["a", "b"], [[0.0, 0, 1], [0, 0, 2]], np.zeros((2, 3)), "wpk", "cam")
    assert poses["b"].centre.tolist() == [0.0, 0.0, 2.0]
    assert poses.select(["b"]).cameras == ("cam",)
    with pytest.raises(InputError, match=r"image 'c' is not known"):
        poses["c"]
    with pytest.raises(InputError, match="image 'a' is given twice"):
        Poses.of(["a", "a"], np.zeros((2, 3)), np.zeros((2, 3)), "wpk")


def test_image_points_by_image_and_by_point():
    measures = ImagePoints.of(["a", "a", "b"], ["1", "2", "1"], [[1.0, 2], [3, 4], [5, 6]], [1.0, 2.0, 3.0])
    assert measures.of_image("a").xy.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert measures.of_points(["2"]).sigmas.tolist() == [[2.0, 2.0]]
    assert measures.of_points(["2"]).image_names == ("a",)
    joined = measures.joined(ImagePoints.of(["b", "c"], ["3", "1"], [[7.0, 8], [9, 10]]))
    assert joined.label(4) == "image c, point 1"
    assert joined.image_names == ("a", "b", "c")


def test_measures_are_checked_when_they_are_made():
    with pytest.raises(InputError, match="image a, point 1: measured twice"):
        ImagePoints.of(["a", "a"], ["1", "1"], [[1.0, 2], [3, 4]])
    with pytest.raises(InputError, match=r"image a, point 1: the pixel \[nan"):
        ImagePoints.of(["a"], ["1"], [[np.nan, 2.0]])
    with pytest.raises(InputError, match="image b, point 2: the sigma must be positive"):
        ImagePoints.of(["a", "b"], ["1", "2"], np.zeros((2, 2)), [1.0, 0.0])


def test_control_points_are_held_given_or_free_by_component():
    control = ControlPoints.of(["A", "B"], np.zeros((2, 3)), [[0.0, 0.01, np.inf], [1.0, 1.0, 1.0]])
    assert control.is_held[0].tolist() == [True, False, False]
    assert control.is_free[0].tolist() == [False, False, True]
    assert control.scaled(2.0).sigmas[1].tolist() == [2.0, 2.0, 2.0]
    assert control.held().is_held.all()


def test_wrong_control_points_are_refused():
    with pytest.raises(InputError, match="control point 'A' is given twice"):
        ControlPoints.of(["A", "A"], np.zeros((2, 3)))
    with pytest.raises(InputError, match="control point A: a sigma is above zero"):
        ControlPoints.of(["A"], np.zeros((1, 3)), -1.0)
    with pytest.raises(InputError, match=r"control point A: coordinates .* not finite"):
        ControlPoints.of(["A"], [[np.inf, 0.0, 0.0]])
    with pytest.raises(InputError, match="control point A: the covariance"):
        ControlPoints.correlated(["A"], np.zeros((1, 3)), -np.eye(3)[None])


def of_three(**given):
    return ImagePoints.of(**{"images": "aaa", "points": ["1", "2", "3"], "xy": np.ones((3, 2))} | given)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: of_three(images=["a"] * 3, xy=np.ones((2, 3))), r"pixels have shape \(2, 3\).*: transpose"),
        (lambda: of_three(images=["a"] * 3, xy=np.ones((3, 3))), r"pixels have shape \(3, 3\), not \(3, 2\)"),
        (lambda: of_three(images=["a"] * 3, sigmas=[0.1, 0.2]), r"sigmas have shape \(2,\)"),
        (lambda: of_three(images=["a"] * 3, xy="no pixels"), "real numbers are wanted"),
        (of_three, "image: a list of names is wanted, not 'aaa'"),
        (lambda: of_three(images=["a", "", "a"]), r"image: '' \(row 2\) is no name"),
        (lambda: of_three(images=["a"] * 3, points=[1, 2, 3.5]), r"point: 3.5 \(row 3\) is no name"),
        (lambda: ControlPoints.of(["A", "B"], np.ones((3, 2))), r"coordinates have .*: transpose them"),
        (lambda: ControlPoints.of(["A"], np.ones((1, 3)), [1.0, 2.0]), r"sigmas have shape \(2,\)"),
        (lambda: Poses.of(["A", "B"], np.ones((3, 2)), np.ones((2, 3)), "opk"), "centres have .*: transpose"),
        (lambda: Poses.of(["A"], np.zeros((1, 3)), [np.diag([1.0, 1.0, -1.0])]), "A matrix mirrors"),
        (
            lambda: Camera("c", "4000", 3000, focal=3000.0),
            "camera c: width must be a finite number, not '4000'",
        ),
        (lambda: Camera("c", 9, 9, focal=9.0, distortion={"K1": "a"}), "distortion: real numbers are wanted"),
        (lambda: BundleAdjustment().add_measures(3), "measures must be ImagePoints, not 3"),
        (lambda: BundleAdjustment().add_control_points([1]), "control must be ControlPoints, not"),
        (lambda: BundleAdjustment().set_vertical([1, 2]), r"vertical: values have shape \(2,\)"),
        (lambda: BundleAdjustment().freeze_parameters(3), "3 is not a regular expression"),
    ],
)
def test_what_has_another_shape_or_kind_is_refused_and_never_reshaped(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_numbers_are_names_as_in_tables_of_a_survey():
    measures = ImagePoints.of([7, 7], [np.int64(1), "2"], [[1.0, 2], [3, 4]])
    assert (measures.image_names, measures.point_names) == (("7",), ("1", "2"))
    assert ControlPoints.of([1, 2], np.zeros((2, 3))).select([2]).names == ("2",)
    block = BundleAdjustment()
    block.add_cameras(Camera(1, 10, 10, focal=10.0))
    block.add_images([7], 1)
    block.add_measures(measures)
    block.add_approximations([1], [[0.0, 0, 0]])
    assert block.approximations["1"].tolist() == [0.0, 0.0, 0.0]
    assert Poses.of([7], [[0.0, 0, 0]], [[0.0, 0, 0]], "opk", [1])[7].centre.tolist() == [0.0, 0.0, 0.0]


def test_the_last_approximation_of_a_point_counts():
    given = Approximations()
    given.add(["a", "b"], np.array([[1.0, 2, 3], [4, 5, 6]]))
    same = given.of(["a", "b"])
    same[:] = 0.0
    assert given["b"].tolist() == [4, 5, 6]
    given.add(["b", "c"], np.array([[7.0, 8, 9], [10, 11, 12]]))
    assert given.of(["c", "b", "d", "a"]).tolist()[:2] == [[10, 11, 12], [7, 8, 9]]
    assert np.isnan(given.of(["c", "b", "d", "a"])[2]).all()
    assert list(given) == ["a", "b", "c"] and len(given) == 3


def two_sizes():
    block = BundleAdjustment()
    block.add_cameras(Camera("small", 100, 80, focal=90.0), Camera("large", 1000, 800, focal=900.0))
    block.add_images(["s"], "small")
    block.add_images(["l"], "large")
    return block


def test_a_measure_is_outside_its_own_image():
    block = two_sizes()
    block.add_measures(ImagePoints.of(["s", "l"], ["1", "1"], [[99.0, 79.0], [999.0, 799.0]]))
    with pytest.raises(InputError, match=r"image s, point 2: \(120, 40\) is outside the image of 100 by 80"):
        block.add_measures(ImagePoints.of(["l", "s"], ["2", "2"], [[120.0, 40.0], [120.0, 40.0]]))
    with pytest.raises(InputError, match=r"image l, point 3: .* is outside the image of 1000 by 800"):
        block.add_measures(ImagePoints.of(["l"], ["3"], [[20.0, -11.0]]))


def test_millimetres_about_the_middle_are_told():
    plate = np.array([[-4.4, -3.3], [4.4, 3.3], [0.5, -3.0], [-4.0, 3.1]])
    pixels = plate / 0.01 + [500.0, 400.0]
    names = ["1", "2", "3", "4"]
    block = two_sizes()
    with pytest.raises(
        InputError, match=r"within 4\.4 by 3\.3 of the corner .* divide millimetres by the size"
    ):
        block.add_measures(ImagePoints.of(["l"] * 4, names, plate))
    block.add_measures(ImagePoints.of(["l"] * 4, names, pixels))
