"""Ways from station to station: where an oriented one sees another, and how surely."""

import math

import numpy as np
import pytest
from sketch import A, B, C, P, Sketch

from obseq.survey import join, make_points, read_obs
from obseq.survey.model import automatic_fix
from obseq.survey.sights.graph_building import build_graph
from obseq.survey.sights.ways import PlumbWays, Views, find_ways

SIGMA = 0.001
ANGLE = SIGMA * math.pi / 200.0
"""Sigmas of `Sketch`: 1 mm, 1 mgon."""


@pytest.fixture
def graph_of():
    """Makes the graph of a sketch; A, B, C, P are its points 0 to 3."""

    def made(sketch):
        sketch.file.write_text("\n".join(sketch.lines))
        points = make_points(["A", "B", "C", "P"], [A, B, C, P], np.full((4, 3), SIGMA))
        points, book = join(points, read_obs(sketch.file))
        return build_graph(book, len(points), automatic_fix(book))

    return made


def _vector(graph, ways, way):
    """The way turned by the zero of the first station, which is 0.7 rad in all sketches."""
    x, y, z = ways.positions[way]
    return x * math.cos(0.7) + y * math.sin(0.7), y * math.cos(0.7) - x * math.sin(0.7), z


def test_a_station_that_is_sighted_is_seen_at_the_end_of_the_sight(tmp_path, graph_of):
    sketch = Sketch(tmp_path, A=A, B=B, C=C, P=P).full("A", "P", g0=0.7).hz("P", "A", g0=2.0)
    graph = graph_of(sketch)
    ways = PlumbWays(graph).of(0)
    assert (ways.others.tolist(), ways.of(0), ways.of(1)) == ([1], slice(0, 1), slice(1, 1))
    np.testing.assert_allclose(_vector(graph, ways, 0), np.subtract(P, A), atol=1e-9)
    # over the horizontal distance hypot(55, 35): what the vector may be off by, and one reading back
    distance, length = math.hypot(55.0, 35.0), math.dist(A, P)
    spread = math.hypot(ANGLE * length, ANGLE * length, SIGMA)
    assert ways.relative_sigmas[0] == pytest.approx(spread)
    assert ways.azimuth_sigmas[0] == pytest.approx(math.hypot(spread / distance, ANGLE))
    assert ways.sights[0].tolist() == [graph.sights_from[1][0], -1]


def test_a_station_that_is_not_sighted_is_free_on_the_two_targets_that_are_farthest_apart(tmp_path, graph_of):
    sketch = Sketch(tmp_path, A=A, B=B, C=C, P=P).full("A", "B", "C", g0=0.7).full("P", "B", "C", g0=2.0)
    graph = graph_of(sketch)
    ways = PlumbWays(graph).of(0)
    assert ways.others[ways.of(0)].tolist() == [1]
    np.testing.assert_allclose(_vector(graph, ways, 0), np.subtract(P, A), atol=1e-9)
    assert {graph.target_of[number] for number in ways.sights[0]} == {1, 2}
    assert {ways.views.points[view] for view in ways.seen[0]} == {1, 2}


def test_no_way_by_one_common_target_or_by_two_that_are_not_as_far_apart(tmp_path, graph_of):
    one = Sketch(tmp_path, A=A, B=B, C=C, P=P).full("A", "B", g0=0.7).full("P", "B", g0=2.0)
    assert len(PlumbWays(graph_of(one)).of(0).others) == 0
    wrong = Sketch(tmp_path, A=A, B=B, C=C, P=P).full("A", "B", "C", g0=0.7).full("P", "B", g0=2.0)
    wrong.truth["C"] = np.add(C, (0.0, 20.0, 0.0))
    assert len(PlumbWays(graph_of(wrong.full("P", "C", g0=2.0))).of(0).others) == 0


def test_ways_of_a_tilted_instrument_are_those_of_its_turned_views(tmp_path, graph_of):
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, 0.8, -0.6], [0.0, 0.6, 0.8]])
    sketch = Sketch(tmp_path, A=A, B=B, C=C, P=P).dxyz("A", "P", rotation=tilt).hz("P", "A")
    graph = graph_of(sketch)
    ways = find_ways(graph, Views.of(graph, [0]).turned(tilt))
    np.testing.assert_allclose(ways.positions, [np.subtract(P, A)], atol=1e-9)


def test_two_targets_on_the_vertical_of_both_stations_are_no_way(tmp_path, graph_of):
    plumb = {"A": (0.0, 0.0, 10.0), "B": (0.0, 0.0, 0.0), "C": (0.0, 0.0, 5.0), "P": (0.0, 0.0, 20.0)}
    sketch = Sketch(tmp_path, **plumb, X=(9.0, 0.0, 0.0))
    for station in "AP":
        sketch.hz(station, "X").dxyz(station, "B", "C")
    assert len(PlumbWays(graph_of(sketch)).of(0).others) == 0
