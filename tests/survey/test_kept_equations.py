"""Equations that are kept for trials are those that would be made for each of them."""

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from obseq.survey import Network, initial_values
from obseq.survey.equations import kept_equations
from obseq.survey.equations.equations import Equations
from obseq.survey.equations.kept_equations import KeptEquations
from obseq.survey.initial.left_out import Determined

DATA = files("obseq") / "survey" / "data"
FRAME = "RTL*657700*6860700*0*L93"


@pytest.fixture(scope="module", params=["Local", FRAME])
def network(request):
    """The demo, in a plane and in a frame in which verticals and known coordinates turn."""
    crs = None if request.param == "Local" else "L93"
    return Network.read(str(DATA / "demo.obs"), str(DATA / "demo.cor"), frame=request.param, points_crs=crs)


@pytest.fixture
def made(network):
    """What makes equations, and counts how often."""

    def make(start):
        make.count += 1
        return Equations(network.frame, network.point_system, start.points, start.book, start.initial)

    make.count = 0
    return make


def started(network, points=None, **columns):
    """The network with other points, or other columns of its observations, and their initial values."""
    points = network.points if points is None else points
    book = replace(network.book, observations=replace(network.book.observations, **columns))
    return Determined(points, book, initial_values(points, book, network.frame.plumb))


def changed(network):
    """Networks that differ in numbers only."""
    rows, points = network.book.observations, network.points
    known = np.flatnonzero(points.has_coordinates)
    moved, last = points.coordinates.copy(), np.arange(len(rows)) == len(rows) - 1
    moved[known] += 0.5
    return {
        "values": started(network, values=rows.values * 1.01),
        "sigmas": started(network, sigmas=rows.sigmas * np.linspace(1.0, 9.0, len(rows))),
        "rows that count": started(network, active=rows.active & ~last),
        "coordinates": started(network, replace(points, coordinates=moved)),
    }


def solved(equations):
    """Residuals of what counts, coordinates and redundancy after some iterations."""
    system = equations.system
    found = system.solve(max_iterations=3, before_iteration=equations.follow)
    residuals = [found.residuals(batch)[batch.active] for batch in system.batches]
    return *residuals, found.values(equations.points), np.array(found.redundancy)


@pytest.mark.parametrize("what", ["values", "sigmas", "rows that count", "coordinates"])
def test_other_numbers_give_what_equations_of_their_own_give(network, made, what):
    kept, start = KeptEquations(made), changed(network)[what]
    solved(kept(started(network)))
    found = solved(kept(start))
    assert made.count == 1
    for mine, own in zip(found, solved(made(start)), strict=True):
        np.testing.assert_array_equal(mine, own)


def test_the_first_network_comes_back_after_others(network, made):
    kept, first = KeptEquations(made), started(network)
    before = solved(kept(first))
    for start in changed(network).values():
        kept(start).system.batches[0].loss = "huber"
    for mine, own in zip(solved(kept(first)), before, strict=True):
        np.testing.assert_array_equal(mine, own)


def test_other_equations_are_made(network, made):
    rows, points = network.book.observations, network.points
    known = np.flatnonzero(points.has_coordinates)[:1]
    loose = points.sigmas.copy()
    loose[known] = np.nan
    kept = KeptEquations(made)
    kept(started(network, active=rows.active & (np.arange(len(rows)) > 0)))
    others = [
        started(network),  # one observation more
        started(network, from_heights=rows.from_heights + 1.5),
        started(network, replace(points, sigmas=loose)),
    ]
    for number, start in enumerate(others, 2):
        kept(start)
        assert made.count == number
    for start in others[:2]:  # those are kept too
        for mine, own in zip(solved(kept(start)), solved(made(start)), strict=True):
            np.testing.assert_array_equal(mine, own)
    assert made.count == 4 + 2


def test_of_a_large_network_only_the_first_equations_are_kept(network, made, monkeypatch):
    monkeypatch.setattr(kept_equations, "_LARGE", 0)
    kept, heights = KeptEquations(made), network.book.observations.from_heights + 1.5
    for start in (started(network), started(network, from_heights=heights), started(network)):
        kept(start)
    assert made.count == 2
