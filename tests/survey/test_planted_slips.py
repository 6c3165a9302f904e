"""Slips of set-ups, targets, known points and files: each is planted in a good network, and named."""

from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from plane_site import PlaneSite
from set_ups import free_stations, resection, traverse
from verdicts import MISTYPED, alternatives, codes, lines, names, places

from obseq.survey import Network

SITES = {"free stations": free_stations, "traverse": traverse, "resection": resection}


@pytest.mark.parametrize("site", SITES.values(), ids=SITES)
def test_honest_networks_raise_no_alarm(site, tmp_path):
    adjustment = site().network(tmp_path).adjust()
    assert adjustment.diagnosis.status == "accepted" and adjustment.gross_errors == ()


def errors_of(site, folder):
    return site.network(folder).gross_errors()


TARGETS = (
    ("free stations", "F3", "C2", "F2"),
    ("free stations", "F1", "E1", "C3"),
    ("traverse", "T2", "T3", "T5"),
)


@pytest.mark.parametrize(("site", "origin", "right", "written"), TARGETS)
def test_a_target_under_another_name(site, origin, right, written, tmp_path):
    made = SITES[site]()
    wrong = made.change(lambda line: {"target": written}, origin=(origin,), target=(right,))
    (error,) = errors_of(made, tmp_path)
    assert any(lines(one) == wrong for one in alternatives(error))
    assert any(right in slip.text for slip in error.slips)


@pytest.mark.parametrize(
    ("site", "origin", "one", "other"),
    [("free stations", "F2", "C3", "E0"), ("free stations", "F1", "E1", "E2")],
)
def test_two_targets_under_each_others_names(site, origin, one, other, tmp_path):
    made = SITES[site]()
    wrong = made.exchange(one, other, origin=(origin,))
    found = errors_of(made, tmp_path)
    assert set().union(*map(lines, found)) == wrong
    assert all(codes(error) & {"W118", "W113"} for error in found)


def test_a_height_of_instrument_that_was_left_out_on_a_known_point(tmp_path):
    made = free_stations()
    made.known = (*made.known, "F2")
    made.approximate = ("F1", "F3")
    wrong = made.change(lambda line: {"instrument": 0.0}, "36", origin=("F2",))
    (error,) = errors_of(made, tmp_path)
    assert any(lines(one) == wrong and one.code == "S130" for one in alternatives(error))
    assert error.code != "S130" or "W114" in codes(error)


def test_a_height_of_a_target_that_is_wrong(tmp_path):
    made = free_stations()
    wrong = made.change(lambda line: {"prism": line.prism + 0.2}, "36", origin=("F2",), target=("C1",))
    (error,) = errors_of(made, tmp_path)
    assert any(lines(one) == wrong and one.code == "S131" for one in alternatives(error))


@pytest.mark.parametrize("turn", [37.1234, 200.0, 0.05])
def test_a_circle_that_was_turned_within_a_set_up(turn, tmp_path):
    made = free_stations()
    wrong = made.change(
        lambda line: {"value": (line.value + turn) % 400.0},
        "57",
        origin=("F2",),
        target=("C3", "E0", "E1", "E2"),
    )
    (error,) = errors_of(made, tmp_path)
    assert any(lines(one) == wrong and one.code == "S120" for one in alternatives(error))
    assert abs(error.size[0]) == pytest.approx(turn * np.pi / 200.0, abs=1e-4)
    assert ("W117" in codes(error)) == (turn == 200.0)


def test_a_circle_and_a_distance_are_two_errors(tmp_path):
    made = free_stations(("F1", "F2"))
    turned = made.change(
        lambda line: {"value": (line.value + 37.1234) % 400.0},
        "57",
        origin=("F2",),
        target=("C3", "E0", "E1", "E2"),
    )
    (other,) = made.change(lambda line: {"value": line.value + 9.0}, "3", origin=("F1",), target=("C2",))
    found = errors_of(made, tmp_path)
    assert sorted(map(sorted, map(lines, found))) == sorted([sorted(turned), [other]])


@pytest.mark.parametrize("codes_of", ["5", "6", "3"])
def test_two_readings_that_are_exchanged(codes_of, tmp_path):
    made = free_stations()
    values = {
        line.target: line.value
        for line in made.lines
        if line.origin == "F3" and line.target in ("E1", "E2") and line.code == codes_of
    }
    other = {"E1": "E2", "E2": "E1"}
    wrong = made.change(
        lambda line: {"value": values[other[line.target]]}, codes_of, origin=("F3",), target=("E1", "E2")
    )
    found = errors_of(made, tmp_path)
    assert set().union(*map(lines, found)) == wrong
    assert all("W113" in codes(error) for error in found)


def demo(text: list[str], folder: Path) -> Network:
    path = folder / "demo.obs"
    path.write_text("\n".join(text))
    known = files("obseq.survey") / "data" / "demo.cor"
    return Network.read(str(path), str(known), points_crs="IGNF:LAMB93")


def slipped(text: list[str], number: int) -> list[str]:
    """Lines of a file of observations, the direction of one of them (from 1) half a turn off."""
    words = text[number - 1].split()
    words[3] = f"{(float(words[3]) + 200.0) % 400.0:.5f}"
    return [*text[: number - 1], " ".join(words), *text[number:]]


@pytest.mark.parametrize("number", [3, 13])
def test_one_direction_of_the_other_face_in_a_network_of_four_points(tmp_path, number):
    text = (files("obseq.survey") / "data" / "demo.obs").read_text().splitlines()
    (error,) = demo(slipped(text, number), tmp_path).gross_errors()
    assert {number} in map(lines, alternatives(error)) and "W102" in codes(error)


@pytest.mark.parametrize("number", [33, 306])
def test_one_direction_of_the_other_face_among_many(shared_data, tmp_path, number):
    """Initial values follow it, and eight right observations of its target contradict it there."""
    folder = shared_data / "comp3d-figure"
    text = (folder / "figure.obs").read_text(encoding="latin-1").splitlines()
    (tmp_path / "figure.obs").write_text("\n".join(slipped(text, number)))
    adjustment = Network.read(str(tmp_path / "figure.obs"), str(folder / "figure.cor")).adjust()
    error, *others = adjustment.gross_errors
    assert lines(error) == {number} and "W102" in codes(error)
    assert not {33, 306} & set().union(*map(lines, others)) or {other.code for other in others} <= {
        "S120",
        "S150",
    }
    assert adjustment.diagnosis.status == "explained"


BOTH = pytest.mark.parametrize("with_angles", [False, True])


@BOTH
@pytest.mark.parametrize(
    ("change", "code", "size"),
    [(lambda v: v - 0.1344, "S150", -0.1344), (lambda v: 1.0005 * v, "S151", 5e-4)],
)
def test_what_all_horizontal_distances_share(with_angles, change, code, size):
    site = PlaneSite(with_angles=with_angles)
    rows = site.change_values(change, ("DistHz",))
    (error,) = site.network().gross_errors()
    assert error.code == code and {row.row for row in error.observations} == set(rows)
    assert error.size[0] == pytest.approx(size, rel=0.02)


@BOTH
@pytest.mark.parametrize(("change", "code"), [(lambda v: v - 0.0644, "S150"), (lambda v: 1.0012 * v, "S151")])
def test_what_the_distances_from_one_point_share(with_angles, change, code):
    site = PlaneSite(with_angles=with_angles)
    rows = site.change_values(change, ("DistHz",), "M11")
    (error,) = site.network().gross_errors()
    same = [one for one in alternatives(error) if {row.row for row in one.observations} == set(rows)]
    assert code in {one.code for one in same}


@BOTH
def test_an_honest_network_of_the_plane_raises_no_alarm(with_angles):
    adjustment = PlaneSite(with_angles=with_angles).network().adjust()
    assert adjustment.gross_errors == () and adjustment.is_complete


def test_constant_and_scale_of_horizontal_distances_can_be_estimated():
    from obseq.survey import estimating

    site = PlaneSite()
    site.change_values(lambda v: (v - 0.025) / 1.0003, ("DistHz",))
    network = site.network()
    adjustment = replace(network, book=estimating(network.book, ["constant", "scale"])).adjust()
    found = dict(
        note.split(" of observations: ") for note in adjustment.notes if " of observations: " in note
    )
    constant, scale = (float(found[part].split()[0]) for part in ("constant", "scale"))
    assert constant == pytest.approx(0.025, abs=0.003) and scale == pytest.approx(3e-4, abs=2e-5)
    assert 0.8 < adjustment.sigma0 < 1.2 and adjustment.gross_errors == ()


HEIGHTS = {"BM1": 100.0, "BM2": 112.345, "A": 103.2111, "B": 105.4822, "C": 108.7733}
HEIGHTS |= {"D": 99.1244, "E": 101.9355, "F": 110.6466, "G": 107.3577, "H": 104.8688}
NET = "BM1-A A-B B-C C-BM2 BM2-F F-G G-H H-BM1 A-H B-G C-F BM1-D D-E E-A E-B D-H".split()
LOOP = "BM1-A A-B B-C C-BM1".split()
LINE = "BM1-A A-B B-BM2".split()


def levelled(folder, way, known, spoil=None, held=False):
    """Height differences (1 mm, seeded) between points of the table above, spoilt; known heights."""
    random = np.random.default_rng(5)
    rises = {}
    for line in way:
        start, end = line.split("-")
        rises[line] = round(HEIGHTS[end] - HEIGHTS[start] + random.normal(0.0, 0.001), 4)
    rises = {line: spoil(line, rise) for line, rise in rises.items()} if spoil else rises
    texts = [f"4 {line.replace('-', ' ')} {rise:.4f} 0.001" for line, rise in rises.items()]
    sigma = "0 0 0" if held else "0.001"
    others = sorted({name for line in way for name in line.split("-")} - set(known))
    points = [f"5 {name} 0 0 {height} {sigma}" for name, height in known.items()]
    points += [f"4 {name} 0 0 0" for name in others]
    (folder / "l.obs").write_text("\n".join(texts), encoding="utf-8")
    (folder / "l.cor").write_text("\n".join(points), encoding="utf-8")
    return Network.read(folder / "l.obs", folder / "l.cor").gross_errors()


def marks(*wanted, **wrong):
    return {name: HEIGHTS[name] for name in wanted} | wrong


def test_an_honest_levelling_raises_no_alarm(tmp_path):
    assert levelled(tmp_path, NET, marks("BM1", "BM2")) == ()


@pytest.mark.parametrize("held", [False, True])
def test_a_wrong_sign_in_a_loop_is_one_of_its_lines(tmp_path, held):
    (error,) = levelled(
        tmp_path, LOOP, marks("BM1"), lambda line, rise: -rise if line == "A-B" else rise, held
    )
    assert set().union(*map(lines, alternatives(error))) == {1, 2, 3, 4}
    assert {2} in map(lines, alternatives(error)) and error.slips


def test_an_error_between_bench_marks_is_one_of_the_lines_or_marks(tmp_path):
    (error,) = levelled(tmp_path, LINE, marks("BM1", "BM2"), lambda line, rise: rise + 0.5 * (line == "A-B"))
    told = alternatives(error)
    assert set().union(*map(lines, told)) == {1, 2, 3}
    assert set().union(*map(names, told)) == {"BM1", "BM2"}


@pytest.mark.parametrize("held", [False, True])
def test_a_wrong_known_height_is_named(tmp_path, held):
    (error,) = levelled(tmp_path, NET, marks("BM1", "F", BM2=113.345), held=held)
    assert error.code == "S110" and names(error) == {"BM2"} and codes(error) & MISTYPED
    assert error.size == pytest.approx([1.0], abs=0.01)
    (error,) = levelled(tmp_path, NET, marks("BM1", BM2=113.345), held=held)
    assert set().union(*map(names, alternatives(error))) == {"BM1", "BM2"}


def test_two_wrong_bench_marks_are_two_errors(tmp_path):
    found = levelled(tmp_path, NET, marks("BM1", "F", "H", BM2=113.345, D=99.1544))
    assert sorted(map(sorted, places(found))) == [["BM2"], ["D"]]


@pytest.mark.parametrize(("factor", "slip"), [(1000.0, "W126"), (1.0 / 0.3048, "W106")])
def test_a_whole_levelling_in_another_unit(tmp_path, factor, slip):
    (error,) = levelled(tmp_path, NET, marks("BM1", "BM2", "G"), lambda _, rise: factor * rise)
    assert lines(error) == set(range(1, len(NET) + 1))
    assert error.code in ("S182", "S204") and slip in codes(error)
