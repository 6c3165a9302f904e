"""The plan is that of the map: its places, and what is turned with it."""

import math
from importlib.resources import files

import pytest

from obseq.report.drawings.map import Similarity, similarity
from obseq.report.drawings.plan import plan
from obseq.report.tables.content import numbers_of
from obseq.survey import Network


@pytest.fixture(scope="module")
def record():
    data = files("obseq.survey") / "data"
    network = Network.read(str(data / "demo.obs"), str(data / "demo.cor"), points_crs="IGNF:LAMB93")
    return network.adjust().record()


def bearing(start: tuple[float, float], end: tuple[float, float]) -> float:
    return math.atan2(end[0] - start[0], end[1] - start[1])


def test_places_are_those_of_the_map_and_directions_are_turned_to_it(record) -> None:
    drawn, to_map = plan(record, numbers_of(record)), similarity(record)
    assert drawn["x"] == [pytest.approx(point.crs_x, abs=1e-4) for point in record.points]
    first, second, third = ((point.plan, (point.crs_x, point.crs_y)) for point in record.points[:3])
    for frame, given in (second, third):
        assert to_map.bearing(bearing(first[0], frame)) == pytest.approx(bearing(first[1], given), abs=1e-5)
        assert to_map.place(*frame) == pytest.approx(given, abs=1e-3)
    turn = bearing(first[0], second[0]) - bearing(first[1], second[1])
    assert abs(turn) > 1e-3  # grid and frame differ by their convergence
    for point, found in zip(record.points, drawn["bearing"], strict=True):
        assert found == pytest.approx(point.ellipse.bearing - turn, abs=2e-4)
    x, y = to_map.turned(0.0, 1.0)
    assert math.atan2(x, y) == pytest.approx(to_map.bearing(0.0))


def test_what_is_no_map_in_metres_keeps_the_frame(make, plain) -> None:
    assert similarity(make()).is_map
    assert similarity(make(points_crs_is_angular=True)) == Similarity()
    assert similarity(make(points_crs_unit="us-ft")) == Similarity()
    assert similarity(make(points_crs=plain["frame"])) == Similarity()
    for point in plain["points"]:
        point["crs_x"] = -point["crs_x"]  # axes to the west
    assert similarity(make()) == Similarity()
