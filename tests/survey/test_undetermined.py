"""What the observations leave undetermined: in words, in the record, the listing, the page and its plan."""

import json
import re

import numpy as np
import pytest

from obseq.report.adjusted import outcome
from obseq.report.page import page
from obseq.report.result_file import read_json, to_json
from obseq.report.summary import listing
from obseq.survey import Datum, Network, network_from_tables

CORNERS = {"A": (0.0, 0.0, 0.0), "B": (60.0, 0.0, 0.0), "C": (100.0, 0.0, 0.0), "D": (40.0, 30.0, 30.0)}


def content_of(text: str) -> dict:
    found = re.search(r'<script type="application/json" id="content">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    return json.loads(found.group(1))


@pytest.fixture(scope="module")
def free(shared_data):
    """A polygon of directions, zenith angles and distances on inner constraints."""
    network = Network.read_project(shared_data / "comp3d-polygone-k06" / "project.comp")
    return network.adjust(datum=Datum("inner")).record()


def test_a_free_network_says_which_motions_its_observations_do_not_see(free) -> None:
    texts = [motion.text for motion in free.undetermined]
    assert texts == [*(f"the position along {axis}" for axis in "xyz"), "the rotation about z"]
    (note,) = [text for text in free.notes if "rank defect 4" in text]
    assert f"undetermined {', '.join(texts)} of all points. The points" in note
    assert "the rotation about z" in listing(outcome(free))


def test_its_rotation_turns_every_point_about_the_centre(free) -> None:
    turn = free.undetermined[3]
    at = {point.name: (point.x, point.y) for point in free.points}
    places = np.array([at[name] for name in turn.points])
    places -= places.mean(axis=0)
    turned = np.column_stack([-places[:, 1], places[:, 0]])
    turned /= np.linalg.norm(turned, axis=1).max()
    np.testing.assert_allclose(np.array(turn.moves)[:, :2], turned, atol=2e-4)


def test_the_page_and_the_file_have_each_motion_of_each_point(free, tmp_path) -> None:
    (tmp_path / "a.json").write_text(to_json(free), encoding="utf-8")
    again = read_json(tmp_path / "a.json")
    assert again == free
    tables = content_of(page(again))["tables"]
    (shown,) = [table for table in tables if table["id"] == "undetermined"]
    columns = {column["title"]: column["values"] for column in shown["columns"]}
    assert len(columns["point"]) == sum(len(motion.points) for motion in free.undetermined)
    expected = [move[0] for motion in free.undetermined for move in motion.moves]
    assert columns["along x"] == expected


def test_a_network_on_known_points_has_none(shared_data) -> None:
    record = Network.read_project(shared_data / "comp3d-minimal" / "project.comp").adjust().record()
    assert record.undetermined is None


def test_a_point_that_nothing_holds_along_one_direction_is_drawn_with_it(tmp_path) -> None:
    # Three distances to points of one line: P may go round it, out of the plane z = 0
    sights = [f"3 {a} P {length} 0.01" for a, length in (("A", 50), ("B", 36.0555), ("C", 67.0820))]
    others = [f"3 {a} Q {length} 0.01" for a, length in (("A", 51), ("B", 37), ("D", 30), ("C", 68))]
    (tmp_path / "n.obs").write_text("\n".join(sights + others) + "\n", encoding="utf-8")
    rows = [f"1 {name} {x} {y} {z} 0.001 0.001 0.001" for name, (x, y, z) in CORNERS.items()]
    (tmp_path / "n.cor").write_text("\n".join([*rows, "0 P 40 30 0", "0 Q 40 30 5"]) + "\n", encoding="utf-8")
    record = Network.read(tmp_path / "n.obs", tmp_path / "n.cor", frame="Local").adjust().record()
    (lost,) = record.left_out
    assert (lost.name, lost.place) == ("P", (40.0, 30.0, 0.0))
    np.testing.assert_allclose(np.abs(lost.directions), [[0.0, 0.0, 1.0]], atol=1e-3)
    assert "nothing holds it along (0.00, 0.00, 1.00)" in listing(outcome(record))
    content = content_of(page(record))
    ((row, *direction),) = content["plan"]["loose"]
    assert content["names"][row] == "P"
    assert direction == pytest.approx(lost.directions[0], abs=1e-3)


def test_a_height_that_only_the_curvature_of_the_earth_gives_is_empty():
    points = {
        "name": ["A", "B", "P"],
        "x": [652345.0, 652445.0, 652395.0],
        "y": [6861234.0] * 2 + [6861290.0],
    }
    points |= {"z": [35.2, 35.9, 36.0]} | {f"s{axis}": [0.01, 0.01, None] for axis in "xyz"}
    table = {
        "type": ["DistHz", "DistHz", "Hz", "Hz"],
        "from": ["A", "B", "P", "P"],
        "to": ["P", "P", "A", "B"],
    }
    table |= {"value": [74.66, 74.67, 0.0, 316.6], "sigma": [0.005, 0.005, 0.003, 0.01]}
    adjusted = network_from_tables(points, table, points_crs="EPSG:2154", angles="gon").adjust()
    assert np.isnan(adjusted.points.coordinates[2]).tolist() == [False, False, True]
    assert any(
        note.startswith("1 point has no height, which nothing observes: P.") for note in adjusted.notes
    )
    for column, more in {"type": "DH", "from": "A", "to": "P", "value": 0.8, "sigma": 0.005}.items():
        table[column] = [*table[column], more]
    adjusted = network_from_tables(points, table, points_crs="EPSG:2154", angles="gon").adjust()
    assert np.isfinite(adjusted.points.precisions[2]).all()
    assert not any("no height" in note for note in adjusted.notes)
