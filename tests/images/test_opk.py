"""Poses as text: columns and units as told, conventions that are tested."""

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.formats.opk.reader import check_convention, opk_text, read_opk
from obseq.images import ControlPoints, Poses

NAMES = [f"P{k}" for k in range(30)]


def test_poses_as_text_come_back(tmp_path):
    poses, _ = scenes.ring(origin=(6e5, 6.8e6, 100.0))
    (tmp_path / "p.txt").write_text(opk_text(poses))
    again = read_opk(tmp_path / "p.txt", camera="c")
    assert (again.images, again.cameras) == (poses.images, poses.cameras)
    np.testing.assert_array_equal(again.centres, poses.centres)
    np.testing.assert_allclose(again.rotations, poses.rotations, atol=1e-14)


def renamed(poses, name):
    return Poses.of([name, *poses.images[1:]], poses.centres, poses.rotations)


@pytest.mark.parametrize("name", ["image 0", "a,b", "a b, c"])
def test_names_with_blanks_or_commas_come_back(tmp_path, name):
    poses, _ = scenes.ring()
    (tmp_path / "p.txt").write_text(opk_text(renamed(poses, name)))
    again = read_opk(tmp_path / "p.txt")
    assert again.images == (name, *poses.images[1:])
    np.testing.assert_array_equal(again.centres, poses.centres)


@pytest.mark.parametrize("name", ["#1", "a;b", "a\tb", " a", "a\nb"])
def test_names_that_have_no_place_are_refused(name):
    with pytest.raises(InputError, match="has no place in a text of omega, phi, kappa"):
        opk_text(renamed(scenes.ring()[0], name))


def test_columns_and_units_are_as_told(tmp_path):
    (tmp_path / "p.txt").write_text("x;a;1;2;3;30;20;10;more\n")
    (tmp_path / "q.txt").write_text("1 2 3 9 11.111111111111111 22.222222222222222 33.333333333333333 a\n")
    first = read_opk(tmp_path / "p.txt", "? N X Y Z K P O")
    second = read_opk(tmp_path / "q.txt", "XYZ?OPKN", "gon")
    np.testing.assert_allclose(first.attitudes("opk"), np.radians([[10, 20, 30]]), atol=1e-14)
    np.testing.assert_allclose(second.rotations, first.rotations, atol=1e-14)


@pytest.mark.parametrize("transposed", [False, True])
def test_a_convention_that_does_not_fit_is_refused_and_the_right_one_named(tmp_path, transposed):
    poses, points = scenes.ring()
    matrices = poses.rotations * [1, -1, -1]
    matrices = np.swapaxes(matrices, 1, 2) if transposed else matrices
    lines = [
        f"{name} {' '.join(map(str, [*c, *m.ravel()]))}"
        for name, c, m in zip(poses.images, poses.centres, matrices, strict=True)
    ]
    (tmp_path / "p.txt").write_text("\n".join(lines))
    measures = scenes.measured(poses, points, NAMES, 0.5)
    control = ControlPoints.of(NAMES, points)
    cameras = dict.fromkeys(poses.images, scenes.CAMERA)
    right = read_opk(tmp_path / "p.txt", "NXYZM", world_to_camera=transposed)
    np.testing.assert_allclose(right.rotations, poses.rotations, atol=1e-12)
    check_convention(right, measures, control, cameras)
    wrong = read_opk(tmp_path / "p.txt", "NXYZM", world_to_camera=not transposed)
    with pytest.raises(InputError, match="fit when read with the transposed matrix"):
        check_convention(wrong, measures, control, cameras)


@pytest.mark.parametrize(
    ("text", "columns", "message"),
    [
        ("a 1 2 3\n", "NXYZOPK", r"p\.txt:1: 4 fields where NXYZOPK are 7"),
        ("a 1 2 3 x 0 0\n", "NXYZOPK", r"p\.txt:1: a field is 'x', which is no finite number"),
        ("# only\n", "NXYZOPK", "holds no pose"),
        ("a 1 2 3 0 0 0\n", "NXYZOP", "needed once each"),
        ("a 1 2 3 0 0 0\n", "NXYZQ", "Q is none of"),
        ("a 1 2 3 0 0 0\na 1 2 3 0 0 0\n", "NXYZOPK", r"p\.txt: .*'a' is given twice"),
        ("a 0 0 0 2 0 0 0 1 0 0 0 1\n", "NXYZM", r"p\.txt: .*rotation"),
    ],
)
def test_texts_that_hold_no_poses_are_refused(tmp_path, text, columns, message):
    (tmp_path / "p.txt").write_text(text)
    with pytest.raises(InputError, match=message):
        read_opk(tmp_path / "p.txt", columns)


def test_fields_of_one_separator_may_hold_blanks(tmp_path):
    (tmp_path / "p.txt").write_text("IMG 1.jpg;1;2;3;10;20;30\nb\t1\t2\t3\t10\t20\t30\nc, 1 2 3 10 20 30\n")
    poses = read_opk(tmp_path / "p.txt")
    assert poses.images == ("IMG 1.jpg", "b", "c")
    np.testing.assert_array_equal(poses.centres, [[1, 2, 3]] * 3)


def test_decimal_commas_are_refused_and_never_shift_columns(tmp_path):
    (tmp_path / "p.txt").write_text("a;1,5;2,5;3,5;10;20;30;40\n")
    with pytest.raises(
        InputError, match=r"p\.txt:1: a field is '1,5', .*; decimals are written with a point"
    ):
        read_opk(tmp_path / "p.txt")
    (tmp_path / "p.txt").write_text("a 1,5;2 3,5;4;5;6;7;8\n")
    with pytest.raises(InputError, match=r"p\.txt:1: "):
        read_opk(tmp_path / "p.txt")
