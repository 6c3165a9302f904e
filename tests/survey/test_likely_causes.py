"""The cause that is named is the one that was planted, or one of those that nothing tells apart from it."""

import itertools

import numpy as np
import pytest
from msgspec import structs

from obseq.errors import InputError
from obseq.survey import Network
from obseq.survey.kinds.directions import HZ
from obseq.survey.screening import ambiguous
from obseq.survey.screening.alternatives import Alternative
from obseq.survey.screening.findings import Cause
from obseq.survey.screening.robust import estimate

HEIGHTS = {"BM1": 100.0, "BM2": 112.345, "A": 103.2111, "B": 105.4822, "C": 108.7733}
HEIGHTS |= {"D": 99.1244, "E": 101.9355, "F": 110.6466, "G": 107.3577, "H": 104.8688}
NET = "BM1-A A-B B-C C-BM2 BM2-F F-G G-H H-BM1 A-H B-G C-F BM1-D D-E E-A E-B D-H".split()
LOOP = "BM1-A A-B B-C C-BM1".split()
LINE = "BM1-A A-B B-BM2".split()


def levelled(folder, lines, known, spoil=None, held=False):
    """Height differences (1 mm, seeded) between points of the table above, spoilt; known heights."""
    random = np.random.default_rng(5)
    rises = {}
    for line in lines:
        start, end = line.split("-")
        rises[line] = round(HEIGHTS[end] - HEIGHTS[start] + random.normal(0.0, 0.001), 4)
    rises = {line: spoil(line, rise) for line, rise in rises.items()} if spoil else rises
    texts = [f"4 {line.replace('-', ' ')} {rise:.4f} 0.001" for line, rise in rises.items()]
    sigma = "0 0 0" if held else "0.001"
    others = sorted({name for line in lines for name in line.split("-")} - set(known))
    points = [f"5 {name} 0 0 {height} {sigma}" for name, height in known.items()]
    points += [f"4 {name} 0 0 0" for name in others]
    (folder / "l.obs").write_text("\n".join(texts), encoding="utf-8")
    (folder / "l.cor").write_text("\n".join(points), encoding="utf-8")
    return Network.read(folder / "l.obs", folder / "l.cor").gross_errors()


def marks(*names, **wrong):
    return {name: HEIGHTS[name] for name in names} | wrong


def test_an_honest_levelling_raises_no_alarm(tmp_path):
    assert levelled(tmp_path, NET, marks("BM1", "BM2")) == ()


@pytest.mark.parametrize(("factor", "words"), [(1000.0, "millimetres"), (1.0 / 0.3048, "feet")])
@pytest.mark.parametrize("lines", [NET, LINE])
def test_a_whole_levelling_in_another_unit(tmp_path, lines, factor, words):
    (error,) = levelled(tmp_path, lines, marks("BM1", "BM2"), lambda _, rise: factor * rise)
    assert error.cause is Cause.UNITS and words in error.text
    assert error.what.startswith(f"all {len(lines)} DH observations")


def test_the_unit_of_a_loop_is_not_blamed_for_its_misclosure(tmp_path):
    """Dividing by 1000 makes any misclosure small."""
    (error,) = levelled(tmp_path, LOOP, marks("BM1"), lambda line, rise: rise + 0.6543 * (line == "B-C"))
    assert error.cause is not Cause.UNITS


@pytest.mark.parametrize("held", [False, True])
def test_a_wrong_sign_in_a_loop_is_one_of_its_lines(tmp_path, held):
    def turned(line, rise):
        return -rise if line == "A-B" else rise

    (error,) = levelled(tmp_path, LOOP, marks("BM1"), turned, held)
    assert error.what.startswith("one of ") and len(error.rows) == 4
    assert error.cause is Cause.SENSE and "DH A -> B" in error.text and "contradicts" in error.sentence()


def test_exchanged_digits_in_a_line_between_benchmarks(tmp_path):
    def exchanged(line, rise):
        return 2.7272 if line == "A-B" else rise

    (error,) = levelled(tmp_path, LINE, marks("BM1", "BM2"), exchanged)
    assert error.what.startswith("one of ") and len(error.rows) == 3
    assert set(error.points) == {"BM1", "BM2"}
    assert "nothing tells them apart" in error.text


@pytest.mark.parametrize("held", [False, True])
def test_a_wrong_known_height_is_named(tmp_path, held):
    (error,) = levelled(tmp_path, NET, marks("BM1", "F", BM2=113.345), held=held)
    assert error.what.startswith("height of known point BM2") and error.points == ("BM2",)
    assert "112.34" in error.text and error.cause is Cause.MISTYPED
    (error,) = levelled(tmp_path, NET, marks("BM1", BM2=113.345), held=held)
    assert set(error.points) == {"BM1", "BM2"} and error.what.startswith("one of ")


@pytest.mark.parametrize("off", [0.3, 100.0, -1000.0])
def test_one_wrong_bench_mark_is_one_finding_of_any_size(tmp_path, off):
    """Between A and C the others cannot say which line is wrong; with the one from BM1 it is the mark."""
    lines = "BM1-A A-B B-C C-D D-BM1".split()
    (error,) = levelled(tmp_path, lines, marks("BM1", "C", A=HEIGHTS["A"] + off), held=True)
    assert error.what.startswith("height of known point A") and error.points == ("A",)


def test_two_wrong_bench_marks_are_two_findings(tmp_path):
    known = marks("BM1", "F", "H", BM2=113.345, D=99.1544)
    found = {error.points for error in levelled(tmp_path, NET, known)}
    assert found == {("BM2",), ("D",)}


def test_what_else_could_be_wrong_is_not_asked_in_a_large_network(tmp_path, monkeypatch):
    monkeypatch.setattr(ambiguous, "_MOST_WORK", 3)
    (error,) = levelled(tmp_path, LOOP, marks("BM1"), lambda line, rise: rise + 0.3 * (line == "B-C"))
    assert not error.is_one and len(error.rows) == 1


def test_an_angle_is_off_by_half_a_turn_at_most(planted, tmp_path, monkeypatch):
    """What is linear in an error says more of a large one."""
    work = planted.made_site(np.random.default_rng(11)).read(tmp_path).fieldwork
    found = estimate(work.model(), work.points, work.book)
    rows = np.flatnonzero(work.book.observations.types == HZ.code)[:2].tolist()
    monkeypatch.setattr(
        ambiguous, "alternatives", lambda *_: [Alternative(row, -1, -1, 7.0, 1e-5) for row in rows]
    )
    (error,), _ = ambiguous.Ambiguity(work.point_system, found).errors(work.model(), rows[:1])
    assert f"it is {(7.0 - 2.0 * np.pi) * 200.0 / np.pi:.5f} gon off" in error.text


def directions(site, setup):
    """Rows of the directions of one set-up; set-ups are apart by #NEW."""
    ends = [-1, *(k for k, words in enumerate(site.obs) if words[0].startswith("#")), len(site.obs)]
    rows = [range(a + 1, b) for a, b in itertools.pairwise(ends)]
    found = [[k for k in part if site.obs[k][0] in ("5", "7")] for part in rows]
    return [part for part in found if len(part) >= 5][setup]


def change(site, rows, column, by):
    for k in rows:
        site.obs[k][column] = repr(by(float(site.obs[k][column])))


def errors_of(site, folder):
    return site.read(folder).gross_errors()


@pytest.mark.parametrize("seed", [8, 11])
def test_directions_counted_anticlockwise(planted, tmp_path, seed):
    site = planted.made_site(np.random.default_rng(seed))
    change(site, directions(site, -1), 3, lambda v: 400.0 - v)
    (error,) = errors_of(site, tmp_path)
    assert error.cause is Cause.SENSE and "anticlockwise" in error.text and " from " in error.what
    site = planted.made_site(np.random.default_rng(seed))
    every = [k for k, words in enumerate(site.obs) if words[0] in ("5", "7")]
    change(site, every, 3, lambda v: 400.0 - v)
    (error,) = errors_of(site, tmp_path)
    assert "anticlockwise" in error.text and error.what.startswith(f"all {len(every)} Hz observations (")


@pytest.mark.parametrize("turns", [(123.4567,), (123.4567, 17.55)], ids=len)
def test_two_set_ups_under_one(planted, tmp_path, turns):
    """Once, or at several stations: none of these explains much alone."""
    site = planted.made_site(np.random.default_rng(len(turns)))
    rows = [directions(site, k) for k in range(len(turns))]
    for members, turn in zip(rows, turns, strict=True):
        change(site, members[-2:], 3, lambda v, turn=turn: (v + turn) % 400.0)
    (error,) = errors_of(site, tmp_path)
    assert error.cause is Cause.NEW_SETUP and len(error.rows) == 2 * len(turns)
    for members, turn in zip(rows, turns, strict=True):
        told = (error.what + error.text).partition(f":{members[-2] + 1}) on")[2]
        assert f"turned by {int(10.0 * turn) / 10.0}" in told[:120]


def test_the_constant_of_a_prism(planted, tmp_path):
    site = planted.made_site(np.random.default_rng(11))
    change(site, [k for k, words in enumerate(site.obs) if words[0] == "3"], 3, lambda v: v + 0.0344)
    (error,) = errors_of(site, tmp_path)
    assert error.cause is Cause.DISTANCES and "(-0.03" in error.text and "prism" in error.text


def test_map_coordinates_in_a_plane_and_plane_coordinates_on_a_map(planted, tmp_path):
    site = planted.made_site(np.random.default_rng(11))
    paths = site.write(tmp_path)
    (error,) = Network.read(*paths, frame="Local").gross_errors()
    assert error.cause is Cause.DISTANCES and "coordinates of a map" in error.text
    assert "--points-crs" in error.text
    change(site, [k for k, words in enumerate(site.obs) if words[0] == "3"], 3, lambda v: v * 1.0004)
    (error,) = errors_of(site, tmp_path)
    assert "coordinates of a plane of the site, not in IGNF:LAMB93" in error.text


def test_heights_of_all_points_in_feet(planted, tmp_path):
    site = planted.made_site(np.random.default_rng(11))
    for words in site.cor:
        words[4] = repr(float(words[4]) / 0.3048)
    (error,) = errors_of(site, tmp_path)
    assert error.cause is Cause.UNITS and "heights of all points look like feet" in error.text


def test_sigmas_that_are_far_too_small_are_no_gross_errors_one_by_one(planted, tmp_path):
    site = planted.made_site(np.random.default_rng(11))
    change(site, [k for k, words in enumerate(site.obs) if words[0] == "3"], 4, lambda v: v / 1000.0)
    (error,) = errors_of(site, tmp_path)
    assert error.cause is Cause.SIGMAS and "sigmas are too small" in error.text


@pytest.mark.parametrize("seed", [5, 7])
def test_one_of_only_two_known_points_is_mistyped(planted, tmp_path, seed):
    """Without it nothing orients the network, and the others place it all the same."""
    site = planted.made_site(np.random.default_rng(seed))
    for words in site.cor[2:]:
        words[0], words[5:] = "0", []
    site.cor[1][3] = repr(float(site.cor[1][3]) + 1e5)
    (error,) = errors_of(site, tmp_path)
    assert error.points == ("K2",) and error.text.endswith("northing (y): one digit is wrong")


def test_an_ambiguous_error_is_adjusted_and_recorded(tmp_path):
    levelled(tmp_path, LOOP, marks("BM1"), lambda line, rise: rise + 0.3 * (line == "B-C"))
    record = Network.read(tmp_path / "l.obs", tmp_path / "l.cor").adjust().record()
    assert len(record.gross_errors) == 1 and record.gross_errors[0].what.startswith("one of ")
    assert not structs.replace(record, left_out=()).is_complete


def test_gross_errors_come_before_what_they_may_leave_undetermined(tmp_path):
    (tmp_path / "r.cor").write_text("1 A 0 0 0 0.001\n1 B 100 0 0 0.001\n0 P 30 40 1\n", encoding="utf-8")
    lines = "3 A P 50.0 0.002\n3 B P 500.0 0.002\n6 A P 100 0.001\n6 B P 100 0.001\n"
    (tmp_path / "r.obs").write_text(lines, encoding="utf-8")
    with pytest.raises(InputError) as refusal:
        Network.read(tmp_path / "r.obs", tmp_path / "r.cor").adjust()
    said = str(refusal.value)
    assert said.startswith("gross errors are suspected")
    assert said.index(" -> P (") < said.index("which may follow from them: the iterations lead")
