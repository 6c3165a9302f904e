"""Points that first values compete for are not left out: each place is a start, and least squares decides."""

from dataclasses import replace

import numpy as np
import pytest

from obseq.leastsquares import LeastSquaresResult
from obseq.survey import Network, network_from_tables
from obseq.survey.adjustment.computation import equations_of
from obseq.survey.initial.left_out import Determined, leave_out


def _wrong(network, seed, count):
    """The network with so many of its observations wrong by a lot."""
    rng, rows = np.random.default_rng(seed), network.book.observations
    values = rows.values.copy()
    for row in rng.choice(np.flatnonzero(rows.active), count, replace=False):
        if values[row] < 10.0:
            values[row] += rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 1.5)
        else:
            values[row] *= rng.uniform(0.3, 1.7)
    return replace(network, book=replace(network.book, observations=replace(rows, values=values)))


def _without_coordinates(network):
    coordinates = network.points.coordinates.copy()
    coordinates[network.points.is_free.all(axis=1)] = np.nan
    return replace(network, points=replace(network.points, coordinates=coordinates))


def _solved(network) -> LeastSquaresResult:
    """The plain solution from the initial values of a network."""
    work = network.fieldwork
    initial = work.initial_values()
    start = leave_out(Determined(work.points, work.book, initial), initial.unplaced)
    equations = equations_of(work.frame, work.point_system, start)
    return equations.system.solve(max_iterations=50, before_iteration=equations.follow, strategy="controlled")


def _lost(network) -> set[str]:
    return {item.what for item in network.fieldwork.initial_values().unplaced}


@pytest.mark.parametrize(("seed", "count"), [(31, 3)])
def test_a_wrong_observation_that_makes_two_places_of_points_loses_none(shared_data, seed, count):
    whole = Network.read_project(shared_data / "comp3d-polygone-k06/project.comp")
    given = _wrong(whole, seed, count)
    bare = _without_coordinates(given)
    assert len(bare.fieldwork.initial_values().rivals) >= 1
    assert _lost(bare) == _lost(whole)  # points that have too few observations
    found, expected = _solved(bare), _solved(given)
    assert found.converged
    assert found.redundancy == expected.redundancy
    assert found.cost == pytest.approx(expected.cost, rel=1e-6)


def test_a_point_whose_height_is_known_and_whose_directions_contradict_it_stays(shared_data):
    """Its approximate coordinates are set aside, and the height that the file gives it was so with them."""
    whole = Network.read_project(shared_data / "comp3d-modane/project.comp")
    moved = 0
    for seed in range(12):
        network = _wrong(whole, seed, 1)
        assert not _lost(network)
        moved += 500 in {int(network.fieldwork.points.names[row]) for row in _replaced(network)}
    assert moved > 0


def _replaced(network):
    return network.fieldwork.initial_values().replaced


@pytest.mark.parametrize("name", ["comp3d-modane", "comp3d-polygone-k06", "comp3d-figure"])
def test_no_point_of_a_real_network_is_left_out_for_a_wrong_observation(shared_data, name):
    whole = Network.read_project(shared_data / name / "project.comp")
    before = _lost(whole)
    for seed in range(6):
        assert _lost(_without_coordinates(_wrong(whole, seed, 1))) == before


def test_two_places_of_a_point_that_nothing_checks_stay_open(tmp_path):
    """Two distances and no third: neither place is more than a guess."""
    (tmp_path / "a.cor").write_text("1 A 0 0 0 0.001\n1 B 100 0 0 0.001\n1 C 0 -50 0 0.001\n")
    (tmp_path / "a.obs").write_text("4 A P 0.0 0.001\n3 A P 80 0.001\n3 B P 80 0.001\n3 A C 50 0.001\n")
    network = Network.read(tmp_path / "a.obs", tmp_path / "a.cor")
    (item,) = network.fieldwork.initial_values().unplaced
    assert "several positions" in item.reason


def test_two_places_that_fit_equally_well_stay_open_however_many_observations_there_are(tmp_path):
    """Four distances from known points in a plane: the point is as well above it as below."""
    known = {"A": (0, 0), "B": (500, 30), "C": (250, 420), "D": (-200, 380)}
    (tmp_path / "a.cor").write_text("".join(f"1 {name} {x} {y} 10 0.001\n" for name, (x, y) in known.items()))
    lengths = {
        name: np.linalg.norm(np.subtract((180, 160, 60), (*place, 10))) for name, place in known.items()
    }
    (tmp_path / "a.obs").write_text("".join(f"3 {name} P {d:.4f} 0.001\n" for name, d in lengths.items()))
    network = Network.read(tmp_path / "a.obs", tmp_path / "a.cor")
    (item,) = network.fieldwork.initial_values().unplaced
    assert "fit several positions equally well" in item.reason


def _site(seed):
    """Eight new points and two known ones with up to 16 sights each, some of the sights grossly wrong."""
    rng = np.random.default_rng(seed)
    places = {name: rng.uniform(0.0, 400.0, 2) for name in ("K0", "K1", *(f"P{k}" for k in range(8)))}
    places = {name: np.append(place, rng.uniform(0.0, 40.0)) for name, place in places.items()}
    rows = [row for name in ("K0", "K1", "P0", "P2", "P4", "P6") for row in _seen_from(rng, name, places)]
    for row in rng.choice(len(rows), rng.integers(3, 12), replace=False):
        kind, *ends, value, sigma = rows[row]
        wrong = value * rng.uniform(0.3, 1.7) if kind == "Dist" else value + rng.uniform(3.0, 100.0)
        rows[row] = (kind, *ends, wrong % 200.0 if kind == "Zen" else wrong % 400.0, sigma)
    known = {name: place if name[0] == "K" else [None] * 3 for name, place in places.items()}
    points = {"name": list(known)} | {
        axis: [xyz[k] for xyz in known.values()] for k, axis in enumerate("xyz")
    }
    points |= {f"s{axis}": [0.002 if name[0] == "K" else None for name in known] for axis in "xyz"}
    columns = ("type", "from", "to", "value", "sigma")
    return network_from_tables(
        points, dict(zip(columns, map(list, zip(*rows, strict=True)), strict=True)), angles="gon"
    )


def _seen_from(rng, name, places):
    zero, gon = rng.uniform(0.0, 400.0), 200.0 / np.pi
    for other in rng.permutation([end for end in places if end != name])[:9].tolist():
        east, north, up = places[other] - places[name]
        flat, kind = np.hypot(east, north), rng.integers(3)
        yield "Hz", name, other, (np.arctan2(east, north) * gon - zero + rng.normal(0.0, 1e-3)) % 400.0, 1e-3
        if kind < 2:
            yield "Zen", name, other, np.arctan2(flat, up) * gon + rng.normal(0.0, 1e-3), 1e-3
        if kind != 1:
            yield "Dist", name, other, np.hypot(flat, up) + rng.normal(0.0, 2e-3), 2e-3


@pytest.mark.parametrize("seed", [211, 339, 425, 520, 761])
def test_no_point_with_many_sights_is_lost_to_wrong_ones(seed):
    """Wrong sights elsewhere spoil sigma0: two places are told apart by what most residuals are."""
    network = _site(seed)
    counts = network.book.counts(network.book.observations.active, len(network.points))
    initial = network.fieldwork.initial_values()
    (rival, *_) = initial.rivals
    assert counts[rival] >= 8
    assert initial.unplaced == ()
