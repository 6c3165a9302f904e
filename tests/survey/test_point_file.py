import numpy as np
import pytest

from obseq.errors import InputError
from obseq.survey import PointFileOptions, read_points

NAN = float("nan")


def points_of(tmp_path, text, field_format="NXYZ", **options):
    path = tmp_path / "points.txt"
    path.write_text(text)
    return read_points(path, field_format, PointFileOptions(**options))


def test_topomini_import(shared_data):
    options = PointFileOptions(comment="*", free_pattern="0", sigma=0.001)
    points = read_points(shared_data / "mmvii-topomini" / "coords.txt", "ANXYZ", options)
    assert points.names == ("PtA", "PtB", "PtC", "PtD")
    assert points.infos == ("1", "0", "0", "1")
    assert points.is_free.all(axis=1).tolist() == [False, True, True, False]
    np.testing.assert_array_equal(points.sigmas[0], [0.001] * 3)
    np.testing.assert_array_equal(points.coordinates[2], [657710, 6860710, 10])


@pytest.mark.parametrize(
    ("field_format", "line"),
    [
        ("NXYZ", "P,1,2 , 3"),
        ("N X,Y/Z", "P\t1 2 3"),
        ("?XYNZ", "skipped 1 2 P 3"),
        ("NXYZBla", "P 1 2 3 and the rest"),
        ("NXYZ Bla", "P 1 2 3"),
    ],
)
def test_formats(tmp_path, field_format, line):
    points = points_of(tmp_path, line, field_format)
    assert points.names == ("P",)
    np.testing.assert_array_equal(points.coordinates, [[1, 2, 3]])
    np.testing.assert_array_equal(points.sigmas, [[1, 1, 1]])


@pytest.mark.parametrize(
    ("field_format", "line", "options", "sigmas"),
    [
        ("NXYZSxyz", "P 1 2 3 0.5", {}, [0.5, 0.5, 0.5]),
        ("NXYZSxSySz", "P 1 2 3 0.1 0 -1", {}, [0.1, 0.0, NAN]),
        ("NXYZ", "P 1 2 3", {"sigma": -1.0}, [NAN, NAN, NAN]),
        ("ANXYZSxyz", "tie P 1 2 3 0.5", {"free_pattern": "t.e"}, [NAN, NAN, NAN]),
        ("ANXYZSxyz", "ties P 1 2 3 0.5", {"free_pattern": "t.e"}, [0.5, 0.5, 0.5]),
    ],
)
def test_sigmas(tmp_path, field_format, line, options, sigmas):
    np.testing.assert_array_equal(points_of(tmp_path, line, field_format, **options).sigmas, [sigmas])


def test_names_are_padded_only_when_they_are_integers(tmp_path):
    text = "7 1 2 3\n0012 1 2 3\n12A 1 2 3\n12345 1 2 3"
    assert points_of(tmp_path, text, name_digits=4).names == ("0007", "0012", "12A", "12345")


@pytest.mark.parametrize("substitution", [r"P$1", r"P\1"])
def test_names_are_rewritten_and_dropped(tmp_path, substitution):
    text = "old_12_x 1 2 3\nnothing 1 2 3\n5-6 1 2 3"
    assert points_of(tmp_path, text, name_pattern=("([0-9]+)", substitution)).names == ("P12", "P5P6")


def test_lines_comments_and_repetitions(tmp_path):
    text = "header\nA 1 2 3 # one\n# none\nB 4 5 6\nA 1 2 3 # one\nC 7 8 9\n"
    points = points_of(tmp_path, text, first_line=1, last_line=5, skip_repeated=True)
    assert points.names == ("A", "B")
    assert list(points.lines) == [2, 4]
    assert len(points_of(tmp_path, text, first_line=1, last_line=-1, skip_repeated=True)) == 3


def test_coordinates_are_multiplied(tmp_path):
    np.testing.assert_array_equal(
        points_of(tmp_path, "A 1000 2 3", multiplier=1e-3).coordinates[0], [1, 0.002, 0.003]
    )


@pytest.mark.parametrize(
    ("field_format", "message"),
    [
        ("NXY", "Z missing"),
        ("NXYZZ", "field Z occurs twice"),
        ("NXYZSx", "Sx, Sy and Sz go together"),
        ("NXYZW", "unknown field W"),
        ("BlaNXYZ", "unknown field Bla"),
        ("nxyz", "cannot be read"),
        ("", "cannot be read"),
    ],
)
def test_wrong_formats(tmp_path, field_format, message):
    with pytest.raises(InputError, match="format") as caught:
        points_of(tmp_path, "A 1 2 3", field_format)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("field_format", "options", "message"),
    [
        ("NXYZSxyz", {"sigma": 1.0}, "sigmas are given twice"),
        ("NXYZSxyzSxSySz", {}, "sigmas are given twice"),
        ("NXYZ", {"free_pattern": "a"}, "needs the field A"),
        ("NXYZ", {"comment": "//"}, "must be one character"),
        ("NXYZ", {"name_pattern": ("(", "")}, "not a regular expression"),
        ("NXYZ", {"name_pattern": ("A", "$4")}, "substitution"),
    ],
)
def test_wrong_options(tmp_path, field_format, options, message):
    with pytest.raises(InputError, match=message):
        points_of(tmp_path, "A 1 2 3", field_format, **options)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("A 1 2 3\nB 1 2\n", "points.txt:2: 3 fields where the format has 4 (N X Y Z)"),
        ("A 1 2 3\nB 1 2 3 4\n", "points.txt:2: 5 fields"),
        ("A 1 2 3\nB 1 2 z\n", "points.txt:2: field Z: 'z' is not a number"),
        ("A 1 2 3\nA 4 5 6\n", "points.txt:2: point A is given twice"),
        ("# A 1 2 3\n", "no point found"),
    ],
)
def test_wrong_lines(tmp_path, text, message):
    with pytest.raises(InputError) as caught:
        points_of(tmp_path, text)
    assert message in str(caught.value)
