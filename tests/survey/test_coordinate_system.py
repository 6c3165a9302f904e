"""A wrong coordinate system of the points is named as the cause, before any point or unit is suspected."""

import importlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from obseq.survey import Network, network_from_tables, write_cor, write_obs
from obseq.survey.kinds.lengths import DIST
from obseq.survey.screening import search
from obseq.survey.screening.findings import Cause

TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"


@pytest.fixture
def files(monkeypatch, tmp_path):
    """Writes a network of 100 points, twelve of them known in Lambert 93, its distances times a factor."""
    monkeypatch.syspath_prepend(TOOLS)
    simulated = importlib.import_module("make_network")

    def written(factor=1.0):
        random = np.random.default_rng(1)
        true = simulated.terrain(100, 50.0, random)
        names = [f"P{k}" for k in range(len(true))]
        book = simulated.measured(names, true, simulated.sights(len(true), 600), random)
        seen = book.observations
        values = np.where(seen.types == DIST.code, factor * seen.values, seen.values)
        write_obs(tmp_path / "site.obs", replace(book, observations=replace(seen, values=values)))
        known = simulated.known_points(names, true, 8, simulated.PLANE, random)
        write_cor(tmp_path / "site.cor", known, simulated.PLANE)
        return tmp_path / "site.obs", tmp_path / "site.cor", simulated.FRAME

    return written


def errors_of(files, points_crs, factor=1.0):
    obs, cor, frame = files(factor)
    return Network.read(obs, cor, frame=frame, points_crs=points_crs).gross_errors()


def test_a_wrong_coordinate_system_is_the_one_cause(files):
    (error,) = errors_of(files, "EPSG:3949")
    assert error.cause is Cause.COORDINATE_SYSTEM
    assert "EPSG:3949" in error.text and "--points-crs" in error.text
    assert len(error.points) == 12


@pytest.mark.parametrize("definition", ["EPSG:2056", "EPSG:27572"])
def test_one_that_is_used_elsewhere_is_said_before_anything_is_tried(files, monkeypatch, definition):
    monkeypatch.setattr(search, "_cause_of_many", lambda *_: pytest.fail("causes are tried one by one"))
    (error,) = errors_of(files, definition)
    assert error.cause is Cause.COORDINATE_SYSTEM and len(error.points) == 12
    assert f"outside the area where {definition} is used" in error.text


def test_a_map_of_another_size_is_said_with_its_size(files):
    (error,) = errors_of(files, "EPSG:3857")
    assert error.cause is Cause.COORDINATE_SYSTEM
    assert "1.625 times as large" in error.text and "EPSG:3857" in error.text


def test_the_right_one_raises_no_alarm(files):
    assert errors_of(files, "IGNF:LAMB93") == ()


def test_another_unit_of_length_is_not_taken_for_it(files):
    errors = errors_of(files, "IGNF:LAMB93", factor=1.0 / 0.3048)
    assert errors and Cause.COORDINATE_SYSTEM not in {error.cause for error in errors}
    assert errors[0].cause in (Cause.UNITS, Cause.DISTANCES)


def with_two_known(files, points_crs):
    """The network with two of its known points: few of its observations see them."""
    network = Network.read(*files[:2], frame=files[2], points_crs=points_crs)
    known = np.flatnonzero(~network.points.is_free.all(axis=1))[[0, 5]]
    coordinates, sigmas = np.full((2, len(network.points), 3), np.nan)
    coordinates[known], sigmas[known] = network.points.coordinates[known], network.points.sigmas[known]
    return replace(network, points=replace(network.points, coordinates=coordinates, sigmas=sigmas))


def test_two_known_points_of_many_are_enough_to_say_that_they_lie_elsewhere(files):
    (error,) = with_two_known(files(), "EPSG:2056").gross_errors()
    assert error.cause is Cause.COORDINATE_SYSTEM and len(error.points) == 2


def test_longitudes_and_latitudes_without_a_system_are_said_to_be_in_degrees(files):
    obs, cor, frame = files()
    true = with_two_known((obs, cor, frame), "IGNF:LAMB93")
    xyz = np.nan_to_num(true.points.coordinates)
    degrees = np.rad2deg(true.frame.system.geodetic(xyz)) * [1.0, 1.0, np.pi / 180.0]
    coordinates = np.where(true.points.is_free, np.nan, degrees)
    write_cor(cor, known_only(replace(true.points, coordinates=coordinates)))
    (error,) = Network.read(obs, cor).gross_errors()
    assert error.cause is Cause.COORDINATE_SYSTEM
    assert "longitudes and latitudes in degrees" in error.text and "--points-crs" in error.text
    assert Network.read(obs, cor, points_crs="EPSG:4326").gross_errors() == ()


def known_only(points):
    return points.subset(np.flatnonzero(~points.is_free.all(axis=1)))


@pytest.mark.parametrize("known", [True, False])
def test_placeholders_are_no_points_outside_the_area_of_a_system(known):
    """P is one; without any known point all are looked at."""
    sigmas = {axis: [0.001 if known else None, None] for axis in ("sx", "sy", "sz")}
    points = {"name": ["A", "P"], "x": [700000.0, 0.0], "y": [6600000.0, 0.0], "z": [500.0, 0.0], **sigmas}
    rows = {"type": ["Dist"], "from": ["A"], "to": ["P"], "value": [400.0], "sigma": [0.002]}
    told = network_from_tables(points, rows, points_crs="EPSG:2154").book.warnings
    assert any(text.startswith("P: outside the area") for text in told) != known
