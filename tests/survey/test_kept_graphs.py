"""Graphs that trials share give the initial values that graphs of their own would give."""

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from obseq.survey import Network, initial_values
from obseq.survey.initial.initial_values import values_by
from obseq.survey.sights import graph_building
from obseq.survey.sights.graph_building import Graphs

DATA = files("obseq") / "survey" / "data"


@pytest.fixture(scope="module")
def network():
    return Network.read(str(DATA / "demo.obs"), str(DATA / "demo.cor"))


@pytest.fixture
def built(monkeypatch):
    """Counts the graphs that are built from nothing."""
    counted = []

    def build(*arguments, **options):
        counted.append(arguments)
        return kept(*arguments, **options)

    kept = graph_building.build_graph
    monkeypatch.setattr(graph_building, "build_graph", build)
    return counted


def books(network):
    """The book with other values, other sigmas, fewer observations, other heights, and as it is."""
    rows = network.book.observations
    last = np.arange(len(rows)) == len(rows) - 1
    changes = {"values": rows.values * 1.001}, {"sigmas": rows.sigmas * np.linspace(1.0, 9.0, len(rows))}
    changes += {"active": rows.active & ~last}, {"to_heights": rows.to_heights + 0.1}
    changed = [replace(network.book, observations=replace(rows, **columns)) for columns in changes]
    return [*changed, network.book]


def assert_same(found, expected):
    for name in ("coordinates", "rotations", "g0", "orientations", "expected_sigmas"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    assert list(found.point_steps) == list(expected.point_steps)
    assert list(found.station_steps) == list(expected.station_steps)
    assert found.unplaced == expected.unplaced


def test_books_one_after_the_other_start_as_each_would_alone(network, built):
    graphs, plumb = Graphs(), network.frame.plumb
    values_by(graphs, network.points, network.book, plumb)
    for book in books(network):
        expected = initial_values(network.points, book, plumb)
        assert_same(values_by(graphs, network.points, book, plumb), expected)


def test_numbers_do_not_build_a_graph_and_other_observations_do(network, built):
    graphs, plumb = Graphs(), network.frame.plumb
    counts = []
    for book in (network.book, network.book, *books(network)):
        values_by(graphs, network.points, book, plumb)
        counts.append(len(built))
    # the same, values, sigmas; then a row less, other heights, and all as it was
    assert counts == [1, 1, 1, 1, 2, 3, 4]


def test_points_that_move_share_the_graph(network, built):
    graphs, points = Graphs(), network.points
    moved = replace(points, coordinates=points.coordinates + 0.5)
    for given in (points, moved):
        found = values_by(graphs, given, network.book, network.frame.plumb)
    assert len(built) == 1
    assert_same(found, initial_values(moved, network.book, network.frame.plumb))
