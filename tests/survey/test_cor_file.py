import numpy as np
import pytest

from obseq.errors import InputError
from obseq.survey import make_points, merge_points, read_cor, write_cor

NAN = float("nan")


def points_of(tmp_path, text, **options):
    path = tmp_path / "points.cor"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_cor(path, **options)


@pytest.mark.parametrize(
    ("line", "sigmas"),
    [
        ("1 P 1 2 3 0.1 0.2 0.3", [0.1, 0.2, 0.3]),
        ("1 P 1 2 3 0.1", [0.1, 0.1, 0.1]),
        ("1 P 1 2 3 0 0.2 -0.3 pillar", [0.0, 0.2, NAN]),
        ("1 P 1 2 3", [0.5, 0.5, 0.5]),
        ("1 P 1 2 3 pillar 7", [0.5, 0.5, 0.5]),
        ("0 P 1 2 3 0.1 0.2 0.3", [NAN, NAN, NAN]),
        ("0 P 1 2 3", [NAN, NAN, NAN]),
        ("2 P 1 2 3 0.1", [0.1, 0.1, NAN]),
        ("3 P 1 2 3 0.1 0.2 0.3", [NAN, NAN, 0.3]),
        ("4 P 1 2 3", [0.0, 0.0, NAN]),
        ("5 P 1 2 3 0.1 0.2 0.3", [0.0, 0.0, 0.3]),
        ("6 P 1 2 3", [NAN, NAN, 0.0]),
        ("7 P 1 2 3 0.1 0.2 0.3", [0.1, 0.2, 0.0]),
    ],
)
def test_flags_and_sigmas(tmp_path, line, sigmas):
    points = points_of(tmp_path, line, default_sigma=0.5)
    np.testing.assert_array_equal(points.sigmas, [sigmas])
    np.testing.assert_array_equal(points.coordinates, [[1, 2, 3]])


def test_comments_names_and_remarks(tmp_path):
    points = points_of(
        tmp_path, "\ufeff* title\r\n\r\n 0\tA 1 2 3 old stone * 9\r\n1 B 1 2 3 0.1 0.1 0.1 new\r\n"
    )
    assert points.names == ("A", "B")
    assert points.infos == ("old stone", "new")
    assert points.place(1).endswith("points.cor:4")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("18 P 1 2 3", "unknown flag '18'; a line begins with a flag: 0 free, 1 known"),
        ("-1 P 1 2 3", "unknown flag"),
        ("P 1 2 3", "unknown flag 'P'"),
        ("1 P 1 2", "4 fields where at least 5 are needed"),
        ("1 P 1 2 z 0.1", "'z' is not a number (fields are: flag name x y z"),
        ("1 P 1 2 3,5 0.1", "the decimal separator is a point"),
        ("1 P 1 2 nan 0.1", "not a finite number"),
        ("1 P 1 2 3 0.1 0.1", "two sigmas"),
        ("1 P 1 2 3 inf", "not a finite number"),
        ("1 P 1 2 3 1e-30", "give 0 to hold the coordinate"),
        ("1 P 1 2 3", "a known point without sigma"),
        ("0 A 1 2 3", "point A is given twice (first at"),
    ],
)
def test_errors_name_file_and_line(tmp_path, line, message):
    with pytest.raises(InputError) as caught:
        points_of(tmp_path, f"0 A 1 2 3\n\n{line}\n")
    assert message in str(caught.value)
    assert f"{tmp_path / 'points.cor'}:3: " in str(caught.value)


def test_default_sigma_must_make_sense(tmp_path):
    with pytest.raises(InputError, match="not a sigma in metres"):
        points_of(tmp_path, "1 A 1 2 3", default_sigma=-1.0)


def test_comments_only(tmp_path):
    with pytest.raises(InputError, match="holds no point"):
        points_of(tmp_path, "* nothing")


def test_point_in_two_files(tmp_path):
    first = points_of(tmp_path, "0 A 1 2 3")
    with pytest.raises(InputError, match=r"points.cor:1: point A is given twice"):
        merge_points([first, first])


def test_write_and_read_again(tmp_path):
    coordinates = [[657700.1234567891, 6860700.3, -1e-7], [1.0, 2.0, 3.0], [0.1, 0.2, 0.3]]
    sigmas = [[0.001, 0.0, NAN], [NAN, NAN, NAN], [1.0, 2.0, 3.0]]
    points = make_points(["A", "B", "C"], coordinates, sigmas)
    write_cor(tmp_path / "copy.cor", points, "a title\nof two lines")
    copy = read_cor(tmp_path / "copy.cor")
    assert copy.names == points.names
    np.testing.assert_array_equal(copy.coordinates, points.coordinates)
    np.testing.assert_array_equal(copy.sigmas, points.sigmas)


def test_points_without_coordinates_are_not_written(tmp_path):
    with pytest.raises(InputError, match="point A has no coordinates"):
        write_cor(tmp_path / "copy.cor", make_points(["A"], [[NAN, NAN, NAN]]))
    with pytest.raises(InputError, match="point A has y and z only, which a COR file cannot say"):
        write_cor(tmp_path / "copy.cor", make_points(["A"], [[NAN, 1, 2]]))


def test_real_files(shared_data):
    modane = read_cor(shared_data / "comp3d-modane" / "MODPLA.cor")
    assert len(modane) == 33
    np.testing.assert_array_equal(modane.is_free[:2], [[True] * 3, [True, True, False]])
    mixed = read_cor(shared_data / "comp3d-fixed-points2" / "coord.cor")
    assert mixed.is_held[mixed.index["X1"]].tolist() == [True, False, False]
    assert mixed.is_free[mixed.index["X3"]].tolist() == [True, False, False]
    assert len(read_cor(shared_data / "mmvii-topomini" / "coords.txt", default_sigma=0.001)) == 4


def test_points_made_in_memory_twice_are_named():
    with pytest.raises(InputError, match="make_points: point A is given twice, as names 1 and 3; keep one"):
        make_points(["A", "B", "A"], np.zeros((3, 3)))
