import math
from pathlib import Path

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.survey import Orientation, automatic_fix, join, make_points, read_obs, write_obs


def book_of(tmp_path: Path, text: str | bytes, **options):
    path = tmp_path / "survey.obs"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_obs(path, **options)


def lines(*shorthand: str) -> str:
    """`5 S1` stands for a whole line of code 5 from S1."""
    return "\n".join(s if s.startswith("#") else f"{s} T 10 0.001" for s in shorthand)


@pytest.mark.parametrize(
    ("text", "sizes"),
    [
        (lines("7 S1", "5 S1", "7 S1", "5 S1"), [2, 2]),
        (lines("7 S1", "5 S1", "5 S1", "5 S1"), [4]),
        (lines("5 S1", "5 S1", "#NEW", "5 S1", "5 S1"), [2, 2]),
        (lines("5 S1", "5 S1", "5 S2", "5 S2", "7 S1", "5 S1", "5 S2"), [2, 3, 2]),
        (lines("5 S1", "5 S1", "5 S2", "5 S2", "#NEW", "5 S1", "5 S1", "5 S2"), [2, 2, 2, 1]),
    ],
)
def test_stations_of_the_reference(tmp_path, text, sizes):
    stations = book_of(tmp_path, text).stations
    assert [len(stations.observations(k)) for k in range(len(stations))] == sizes


def test_station_types_join_and_simple_types_do_not(tmp_path):
    book = book_of(tmp_path, lines("5 S", "6 S", "3 S", "14 S", "4 S", "15 S", "16 S"))
    assert list(book.observations.stations) == [0, 0, -1, 0, -1, 0, 0]
    assert list(book.observations.types) == [5, 6, 3, 14, 4, 15, 16]


def test_status_lines(tmp_path):
    book = book_of(tmp_path, lines("5 A", "#FIX", "5 A", "#NEW", "5 A", "#BASC", "5 A", "#VERT", "5 A"))
    assert [Orientation(o).name for o in book.stations.orientations] == ["VERT", "FIX", "FIX", "BASC", "VERT"]


def test_each_file_starts_afresh(tmp_path):
    first, second = tmp_path / "1.obs", tmp_path / "2.obs"
    first.write_text(lines("#FIX", "5 S"))
    second.write_text(lines("5 S"))
    book = read_obs([first, second])
    assert [Orientation(o).name for o in book.stations.orientations] == ["FIX", "VERT"]
    assert book.place(1) == f"{second}:1"


def test_values_and_units(tmp_path):
    book = book_of(tmp_path, "7 A B -50 0.1\n6 A B 400 0.2 anything else\n3 A B 12.5 0.003\n4 A B -1e-1 0.01")
    np.testing.assert_allclose(book.observations.values, [-math.pi / 4, 2 * math.pi, 12.5, -0.1], rtol=1e-15)
    np.testing.assert_allclose(book.observations.sigmas, [math.pi / 2000, math.pi / 1000, 0.003, 0.01])
    assert book.label(2) == f"Dist A -> B ({book.files[0]}:3)"


def test_cleaning(tmp_path):
    text = "\ufeff* title\r\n\t 3 A B* 10 0.1\r\n\f 3  A\tB 10 0.1 * rest\r\n\r\n#VERT * plumb\r\n"
    with pytest.raises(InputError, match=r"survey.obs:2: 3 fields"):
        book_of(tmp_path, text)
    book = book_of(tmp_path, text.replace("B* 10", "B 10"))
    assert (len(book.observations), book.point_names) == (2, ("A", "B"))
    assert list(book.observations.lines) == [2, 3]


def test_old_macintosh_line_ends(tmp_path):
    assert len(book_of(tmp_path, "3 A B 10 0.1\r3 A B 10 0.1\r").observations) == 2


def test_negative_sigma_switches_a_line_off(tmp_path):
    book = book_of(tmp_path, "5 S A 10 0.001\n5 S B 20 -0.001\n3 S S -7 -1")
    assert book.observations.n_inactive == 2
    assert list(book.observations.active) == [True, False, False]
    assert book.observations.sigmas[2] == 1.0
    assert list(book.observations.stations) == [0, 0, -1]


def test_switched_off_code_7_still_opens_a_station(tmp_path):
    book = book_of(tmp_path, "7 S A 0 1\n5 S B 9 1\n7 S A 30 -1\n5 S B 39 1")
    assert list(book.observations.stations) == [0, 0, 1, 1]


def test_station_without_active_observation_is_dropped(tmp_path):
    book = book_of(tmp_path, "7 S A 0 -1\n7 S A 30 1")
    assert (len(book.stations), list(book.observations.stations)) == (1, [-1, 0])


def test_numbers_after_the_sigma_are_relative_sigma_and_heights(tmp_path):
    book = book_of(tmp_path, "3 A B 10 0.1 0 0 0\n3 A B 10 0.1 1e-6 1.2 -0.3\n5 A B 10 0.1 0.002")
    observations = book.observations
    assert observations.relative_sigmas.tolist() == [0.0, 1e-6, 0.002]
    assert observations.from_heights.tolist() == [0.0, 1.2, 0.0]
    assert observations.to_heights.tolist() == [0.0, -0.3, 0.0]
    assert book.warnings == ()
    assert book_of(tmp_path, "3 A B 10 0.1 seen at noon 3").observations.relative_sigmas.tolist() == [0.0]
    assert book_of(tmp_path, "3 A B 10 0.1 0 1.5 1.6 wet 3").observations.to_heights.tolist() == [1.6]


@pytest.mark.parametrize(
    ("rest", "message"),
    [
        ("1e-6 1.5", "2 numbers after the sigma, where one"),
        ("1e-6 1.5 1.5 7", "4 numbers after the sigma"),
        ("0.001 seen at noon", "1 number and a remark after the sigma"),
        ("0.2", "a relative sigma of 0.2 of the distance is not between 0 and 0.1"),
        ("-1e-6", "is not between 0 and 0.1"),
        ("0 1500 0", "a height of instrument or target of 1500 m is beyond 100 m"),
        ("nan", "not a finite number (after the sigma)"),
    ],
)
def test_what_follows_the_sigma_is_used_or_refused(tmp_path, rest, message):
    with pytest.raises(InputError) as caught:
        book_of(tmp_path, f"* head\n3 A B 10 0.1 {rest}\n")
    assert message in str(caught.value)
    assert "net.obs:2" in str(caught.value) or ".obs:2" in str(caught.value)


def test_what_follows_the_sigma_is_ignored_on_demand_and_counted(tmp_path):
    path = tmp_path / "net.obs"
    path.write_text("3 A B 10 0.1 1e-6 1.2 0\n3 A B 10 0.1 0 1.2 0\n3 A B 10 0.1\n")
    book = read_obs(path, ignore=["heights"])
    assert book.observations.relative_sigmas.tolist() == [1e-6, 0.0, 0.0]
    assert not book.observations.from_heights.any()
    assert len(book.warnings) == 1
    assert "heights of instrument and target in OBS lines: ignored in 2 lines" in book.warnings[0]
    path.write_text("3 A B 10 0.1 17 4 note 3\n")
    assert len(read_obs(path, ignore=["after-sigma"]).warnings) == 1
    with pytest.raises(InputError, match="--ignore height: unknown"):
        read_obs(path, ignore=["height"])


def test_an_azimuth_is_no_part_of_a_round(tmp_path):
    book = book_of(
        tmp_path, "7 A B 0 0.001\n8 A B 100 0.001\n5 A C 50 0.001\n9 A D 0 0.002 0.003\n5 A D 60 0.001"
    )
    assert [book.stations.observations(k).tolist() for k in range(3)] == [[0, 2, 5], [1], [3, 4]]
    assert book.stations.orientations.tolist() == [Orientation.VERT, Orientation.FIX, Orientation.FIX]
    assert book.observations.types.tolist() == [5, 8, 5, 14, 15, 5]
    assert book.observations.sigmas[3:5].tolist() == [0.002, 0.003]


def test_a_minus_before_the_code_switches_the_line_off(tmp_path):
    book = book_of(tmp_path, "-3 A B 10 0.1\n1 A B 10 0.1")
    assert book.observations.active.tolist() == [False, True]
    assert book.observations.types.tolist() == [3, 3]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("#FXI", "unknown keyword '#FXI'; alone on a line: #FIX, #VERT, #BASC, #GRID, #CAM, #NEW"),
        ("#FIX 5 A B", "unknown keyword"),
        ("#fix", "unknown keyword"),
        ("23 A B 1 1", "unknown code 23"),
        ("18 A @b.axe 1 1", "an axis of rotation (code 18 of Comp3D) is read in Comp3D projects only"),
        ("Hz A B 1 1", "'Hz' is neither a code"),
        ("5.5 A B 1 1", "neither a code"),
        ("9" * 5000 + " A B 1 1", "neither a code"),
        ("5 A B 1", "4 fields where at least 5 are needed: code from to value sigma"),
        ("5 A B one 1", "'one' is not a number"),
        ("5 A B 1,5 1", "the decimal separator is a point"),
        ("5 A B 1_0 1", "is not a number"),
        ("5 A B nan 1", "not a finite number"),
        ("3 A B 1 inf", "not a finite number"),
        ("3 A B 1e300 1", "beyond 1e+09"),
        ("5 A B 400.001 1", "the value 400.001 (horizontal direction, clockwise) is beyond one turn"),
        ("6 A B -401 1", "beyond one turn"),
        ("5 A B 1 0", "makes the weight infinite"),
        ("5 A B 1 1e-300", "makes the weight infinite"),
        ("3 A B 0 1", "the value 0 (slope distance) is not positive"),
        ("3 A B -3 1", "not positive"),
        ("3 A A 3 1", "observed from itself"),
    ],
)
def test_errors_name_file_line_and_text(tmp_path, line, message):
    with pytest.raises(InputError) as caught:
        book_of(tmp_path, f"* title\n3 A B 10 0.1\n{line}\n")
    text = str(caught.value)
    assert message in text
    assert f"{tmp_path / 'survey.obs'}:3: " in text
    assert text.endswith(f"\n    {line[:160]}" + ("..." if len(line) > 160 else ""))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "the file is empty"),
        (b" \n\n", "the file is empty"),
        (b"* only a title\n#VERT\n", "holds no observation"),
        (b"3 A B 1 1\n\x00\x01", "survey.obs:2: holds a zero byte: this is a binary file"),
        ("3 A B 1 1".encode("utf-16-le"), "looks like UTF-16 that does not begin with its mark; save it as"),
        ("\n".encode("utf-16"), "the file is empty"),
        (
            "3 A B 1 1\n3 A b\u00e9ton 1 1".encode("latin-1"),
            r"survey.obs:2: the name b\xe9ton is not written in UTF-8",
        ),
    ],
)
def test_unreadable_files(tmp_path, data, message):
    with pytest.raises(InputError) as caught:
        book_of(tmp_path, data)
    assert message in str(caught.value)
    str(caught.value).encode("utf-8")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_encodings_that_say_what_they_are_need_no_option(tmp_path, encoding):
    book = book_of(tmp_path, "3 Rép B 1 1\r\n".encode(encoding))
    assert book.point_names == ("Rép", "B")


def test_latin_1_comments_do_not_matter(tmp_path):
    data = "* mesur\u00e9 \u00e0 midi\n3 A B 1 1 * \u00e9t\u00e9\n3 A B 1 1 \u00e9t\u00e9".encode("latin-1")
    assert len(book_of(tmp_path, data).observations) == 2


def test_latin_1_names_need_the_encoding(tmp_path):
    data = "3 A b\u00e9ton 1 1".encode("latin-1")
    assert book_of(tmp_path, data, encoding="latin-1").point_names == ("A", "b\u00e9ton")
    with pytest.raises(InputError, match="cannot be read in encoding 'nonsense'"):
        book_of(tmp_path, data, encoding="nonsense")


def test_missing_file_and_directory(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        read_obs(tmp_path / "absent.obs")
    with pytest.raises(InputError, match="is a directory"):
        read_obs(tmp_path)


def test_write_and_read_again(tmp_path):
    text = lines("#FIX", "5 A", "7 A", "#BASC", "14 A", "16 B", "#VERT", "6 A", "3 A", "4 B", "#NEW", "5 B")
    book = book_of(tmp_path, text + "\n5 C T 3.14159265358979 -0.5\n3 A T 1234.56789012345 0.002")
    write_obs(tmp_path / "copy.obs", book)
    copy = read_obs(tmp_path / "copy.obs")
    assert list(copy.stations.orientations) == list(book.stations.orientations)

    def contents(b):
        o = b.observations
        names = np.array(b.point_names)
        rows = zip(o.types, names[o.from_points], names[o.to_points], o.stations, o.active, strict=True)
        return sorted(
            (*map(str, row), f"{v:.12g}", f"{s:.5g}")
            for row, v, s in zip(rows, o.values, o.sigmas, strict=True)
        )

    assert contents(copy) == contents(book)


def test_names_that_cannot_be_written(tmp_path):
    book = book_of(tmp_path, "3 A B 1 1")
    _, bad = join(make_points(["A"], np.zeros((1, 3))), book)
    object.__setattr__(bad, "point_names", ("A", "B C"))
    with pytest.raises(InputError, match="'B C' cannot be written"):
        write_obs(tmp_path / "copy.obs", bad)


def test_automatic_fix(tmp_path):
    text = lines("#BASC", "6 A", "16 A", "#VERT", "5 B", "#VERT", "14 C", "#VERT", "6 D") + "\n5 D T 1 -1"
    book = book_of(tmp_path, text)
    assert [Orientation(o).name for o in automatic_fix(book)] == ["FIX", "VERT", "VERT", "FIX"]


def test_join_gives_one_numbering(tmp_path):
    book = book_of(tmp_path, "3 T S 1 1\n3 off T 1 -1\n5 new S 1 1")
    points, joined = join(make_points(["S", "alone"], np.zeros((2, 3)), np.zeros((2, 3))), book)
    assert points.names == ("S", "alone", "T", "new")
    assert joined.point_names == ("S", "alone", "T", "new", "off")
    assert [joined.point_names[p] for p in joined.observations.from_points] == ["T", "off", "new"]
    assert [joined.point_names[p] for p in joined.stations.origins] == ["new"]
    assert np.isnan(points.coordinates[2:]).all()
    assert points.is_free[2:].all()


def test_real_files(shared_data, tmp_path):
    book = read_obs(shared_data / "mmvii-topomini" / "meas.obs")
    assert (len(book.observations), len(book.stations)) == (12, 2)
    book = read_obs(shared_data / "comp3d-init-cap" / "obs.obs")
    assert (len(book.observations), len(book.stations)) == (40, 4)
    book = read_obs(shared_data / "comp3d-figure" / "figure.obs")
    assert (len(book.observations), len(book.stations)) == (535, 8)


@pytest.mark.slow
def test_sixty_thousand_lines(tmp_path):
    path = tmp_path / "big.obs"
    path.write_text("\n".join(f"5 S{k // 6} T{k % 9999} {k % 400}.1234 0.0008 0 0 0" for k in range(60_000)))
    book = read_obs(path)
    assert (len(book.observations), len(book.stations)) == (60_000, 10_000)


@pytest.mark.parametrize("hidden", ["\u200b", "\u2060", "\ufeff"])
def test_names_with_a_character_that_nobody_sees_are_refused(tmp_path, hidden):
    (tmp_path / "survey.obs").write_text(f"4 BM P{hidden} 1.234 0.001\n", encoding="utf-8")
    with pytest.raises(
        InputError, match=r"survey\.obs:1: the name P\\u[0-9a-f]{4} holds a character that nobody"
    ):
        read_obs(tmp_path / "survey.obs")


def test_a_blank_that_is_none_is_told_with_the_line_that_holds_it(tmp_path):
    (tmp_path / "survey.obs").write_text("4 BM P\u00a01 1.234 0.001\n", encoding="utf-8")
    with pytest.raises(
        InputError, match=r"name P\\xa01 holds .* \(the line holds '\\xa0', which nobody sees\)"
    ):
        read_obs(tmp_path / "survey.obs")
