"""Levellings without a plan: a scheme of the lines, in page and figure."""

import itertools
import json
import re

import numpy as np
import pytest

from obseq.report.drawings.plan import KNOWN, plan
from obseq.report.drawings.scheme import scheme
from obseq.report.notebook import network_figure
from obseq.report.page import page
from obseq.survey import Network, network_from_tables


def levelling(lines, names, benchmark="R"):
    """A levelling of lines (from, to, sigma): no point has a plan."""
    points = {"name": [benchmark, *names], "x": [0.0] * (len(names) + 1), "y": [0.0] * (len(names) + 1)}
    points |= {"z": [100.0, *[None] * len(names)], "sx": [0.0] * (len(names) + 1)}
    points |= {"sy": points["sx"], "sz": [0.001, *[None] * len(names)]}
    starts, ends, sigmas = map(list, zip(*lines, strict=True))
    n = len(lines)
    table = {"type": ["DH"] * n, "from": starts, "to": ends, "value": [0.0] * n, "sigma": sigmas}
    return network_from_tables(points, table)


@pytest.fixture(scope="module")
def ring():
    names = ["R", *"ABCDEFG"]
    lines = [(a, b, 0.001) for a, b in zip(names, [*names[1:], "R"], strict=True)]
    return levelling([*lines, ("D", "X", 0.002), ("D", "Y", 0.001)], [*"ABCDEFGXY"]).adjust().record()


def test_a_loop_is_drawn_as_one_and_a_less_precise_line_longer(ring):
    places = {name: np.array(place) for name, place in scheme(ring).items()}
    middle = np.mean([places[name] for name in "RABCDEFG"], axis=0)
    radii = [np.linalg.norm(places[name] - middle) for name in "RABCDEFG"]
    assert min(radii) > 0.6 * max(radii)
    assert np.linalg.norm(places["X"] - places["D"]) > 1.5 * np.linalg.norm(places["Y"] - places["D"])
    apart = [np.linalg.norm(a - b) for k, a in enumerate(places.values()) for b in list(places.values())[:k]]
    assert min(apart) > 0.3


def test_the_page_says_that_it_is_no_plan(ring):
    rows = {point.name: k for k, point in enumerate(ring.points)}
    drawn = plan(ring, rows)
    assert drawn["scheme"]
    assert [mark & KNOWN for mark in drawn["marks"]] == [1, *[0] * (len(rows) - 1)]
    assert "no plan is known" in drawn["title"]
    assert drawn["major"][1] == pytest.approx(ring.points[1].sz, rel=1e-3)
    content = re.search(r'id="content">(.*?)</script>', page(ring), re.S).group(1)
    assert len(set(json.loads(content)["plan"]["x"])) == len(ring.points)
    assert "no plan is known" in network_figure(ring)


def test_large_levellings_and_those_in_parts_are_drawn():
    names = [f"P{k}" for k in range(600)]
    chain = ["R", *names]
    lines = [(a, b, 0.001) for a, b in itertools.pairwise(chain)]
    lines += [(names[k], names[k + 20], 0.001) for k in range(0, 560, 20)]
    record = levelling(lines, names).adjust().record()
    places = np.array(list(scheme(record).values()))
    assert np.isfinite(places).all()
    assert len(np.unique(places.round(3), axis=0)) > 540


def test_networks_with_a_plan_have_no_scheme(shared_data):
    folder = shared_data / "comp3d-minimal"
    assert scheme(Network.read_project(folder / "project.comp").adjust().record()) is None


def test_a_network_of_which_all_is_known_has_residuals_and_a_plan():
    points = {"name": ["A", "B"], "x": [0.0, 3.0], "y": [0.0, 4.0], "z": [0.0, 0.0]}
    points |= {f"s{axis}": [0.0, 0.0] for axis in "xyz"}
    table = {"type": ["Dist", "DH"], "from": "A", "to": "B", "value": [5.01, 0.0], "sigma": [0.01, 0.001]}
    record = network_from_tables(points, table).adjust().record()
    assert record.n_unknowns == 0
    assert record.redundancy == 2
    assert record.observations[0].residual == pytest.approx(-0.01)
    assert [point.sx for point in record.points] == [0.0, 0.0]
    drawn = plan(record, {"A": 0, "B": 1})
    assert drawn["x"] == [0.0, 3.0]
    assert not drawn["scheme"]
