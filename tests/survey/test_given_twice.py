"""The same data given twice, or in the place of other data, is refused; honest repetitions are not."""

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.survey import Network, read_cor, read_obs
from obseq.survey.checks.repetitions import repetitions

POINTS = "1 A 0 0 10 0.001\n1 B 100 0 12 0.001\n0 P 40 60 11\n"
SIGHTS = (
    "7 A B 0 0.0005\n5 A P 362.5666 0.0005\n3 A P 72.1180 0.001\n6 A P 99.1173 0.0005\n3 B P 84.8587 0.001\n"
)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "a.obs").write_text(SIGHTS)
    (tmp_path / "a.cor").write_text(POINTS)
    return tmp_path


def warned(folder, *names):
    network = Network.read([folder / name for name in names], folder / "a.cor")
    return [text for text in network.book.warnings if "count twice" in text]


def test_a_file_that_is_named_twice(folder):
    with pytest.raises(InputError, match=r"a.obs: is the same file as .*a.obs"):
        read_obs([folder / "a.obs", folder / "a.obs"])
    with pytest.raises(InputError, match=r"a.cor: is the same file as .*a.cor"):
        read_cor([folder / "a.cor", folder / "." / "a.cor"])
    with pytest.raises(InputError, match="is the same file as"):
        Network.read(folder / "a.obs", [folder / "a.cor", folder / "a.cor"], point_format="ANXYZ")


def test_links_that_lead_nowhere_are_no_files(folder):
    (folder / "loop.obs").symlink_to(folder / "loop.obs")
    with pytest.raises(InputError, match=r"loop.obs: cannot be read"):
        read_obs([folder / "loop.obs", folder / "a.obs"])


@pytest.mark.parametrize("link", ["symlink_to", "hardlink_to"])
def test_a_file_and_a_link_to_it(folder, link):
    getattr(folder / "b.obs", link)(folder / "a.obs")
    with pytest.raises(InputError, match=r"b.obs: (is|holds) the same .*a.obs.*name it once"):
        read_obs([folder / "a.obs", folder / "b.obs"])


def test_a_copy_of_a_file(folder):
    (folder / "copy.obs").write_text(SIGHTS)
    with pytest.raises(InputError, match=r"copy.obs: holds the same as .*a.obs, to the last byte"):
        read_obs([folder / "a.obs", folder / "copy.obs"])


def test_a_project_that_includes_a_file_twice(folder):
    (folder / "all.csv").write_text("a")
    with pytest.raises(InputError, match="is the same file as"):
        Network.read_project([folder / "all.csv", folder / "all.csv"])


def test_rows_that_repeat_others_are_told_with_both_places(folder):
    (folder / "b.obs").write_text("* the next day\n3 A B 100.0204 0.001\n" + SIGHTS)
    (text,) = warned(folder, "a.obs", "b.obs")
    assert text.startswith("5 observations repeat")
    for place in ("b.obs:3", "b.obs:7", "a.obs:1", "a.obs:5"):
        assert str(folder / place) in text


def test_other_rows_between_them_hide_nothing(folder):
    lines = SIGHTS.splitlines()
    (folder / "b.obs").write_text("\n".join([*lines[:1], "3 A B 100.0204 0.001", *lines[1:]]))
    (text,) = warned(folder, "a.obs", "b.obs")
    assert text.startswith("4 observations repeat")


def test_a_second_round_is_another_one(folder):
    (folder / "b.obs").write_text(SIGHTS.replace("362.5666", "362.5669").replace("72.1180", "72.1182"))
    assert warned(folder, "a.obs", "b.obs") == []


def test_coarse_levelling_may_repeat_itself(folder):
    """Six lines read to the millimetre with as large a sigma: each repetition is equal one time in four."""
    heights = np.random.default_rng(2).uniform(-2, 2, 6).round(3)
    lines = [f"4 A L{k} {height} 0.001" for k, height in enumerate(heights)]
    text = "\n".join(lines)
    (folder / "l.obs").write_text(text + "\n" + "\n".join(lines[:4]) + "\n")
    assert warned(folder, "l.obs") == []
    (folder / "l.obs").write_text(text.replace("0.001", "0.0003") + "\n")
    (folder / "m.obs").write_text("* again\n" + text.replace("0.001", "0.0003") + "\n")
    assert warned(folder, "l.obs", "m.obs") == []


def test_single_lines_that_are_doubled_are_told_with_both_places(folder):
    fine = SIGHTS.replace("72.1180", "72.11801").replace("362.5666", "362.56662")
    lines = fine.splitlines()
    (folder / "a.obs").write_text("\n".join([*lines[:3], lines[2], *lines[3:]]))
    (text,) = warned_of(folder, "a.obs")
    file = folder / "a.obs"
    assert f"repeat an earlier one to the last digit: 1 ({file}:4 as {file}:3). Two measurements" in text
    (folder / "a.obs").write_text("\n".join(line for line in lines[1:] for _ in range(2)))
    (text,) = warned_of(folder, "a.obs")
    assert f"to the last digit: 4 ({file}:2 as {file}:1, " in text
    assert " and 1 more)" in text


def test_a_distance_that_is_measured_often_may_come_out_equal(folder):
    """Twenty lengths to the tenth of a millimetre, with sigmas of 1 mm: four of them are equal to others."""
    lengths = np.random.default_rng(3).normal(72.118, 0.001, 20).round(4)
    (folder / "l.obs").write_text("\n".join(f"3 A P {length} 0.001" for length in lengths))
    assert len(set(lengths)) == 16
    assert warned_of(folder, "l.obs") == []


def warned_of(folder, name):
    return list(repetitions(read_obs(folder / name)))


PLACES, LENGTHS = "1 A 0 0 0 0.001\n0 B 10 0 0\n", "3 A B 10 0.002\n3 A B 10.001 0.002\n"


@pytest.mark.parametrize(
    ("first", "second", "told"),
    [
        (PLACES, LENGTHS, r"a.txt holds points .*; .*b.txt holds observations .*: exchange them"),
        (LENGTHS, LENGTHS + "*", r"b.txt holds observations .*, and was given for points: give it as"),
        (PLACES, PLACES + "*", r"a.txt holds points .*, and was given for observations: give it as"),
    ],
)
def test_files_of_points_and_of_observations_that_are_exchanged_are_named(tmp_path, first, second, told):
    (tmp_path / "a.txt").write_text(first)
    (tmp_path / "b.txt").write_text(second)
    with pytest.raises(InputError, match=told):
        Network.read(tmp_path / "a.txt", tmp_path / "b.txt")


def test_other_mistakes_say_nothing_of_exchanged_files(tmp_path):
    (tmp_path / "a.txt").write_text(LENGTHS + "3 A B ten 0.002")
    (tmp_path / "b.txt").write_text(PLACES)
    with pytest.raises(InputError, match="'ten' is not a number") as raised:
        Network.read(tmp_path / "a.txt", tmp_path / "b.txt")
    assert "holds" not in str(raised.value)
