"""Mistakes that many values of a large network share: tried on a part of it, told of all of it."""

import runpy
import sys
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from obseq.diagnosis.policy import POLICY
from obseq.survey import Network
from obseq.survey.causes.notes import Notes
from obseq.survey.diagnosing.network_model import NetworkModel
from obseq.survey.diagnosing.rewritings import part_that_shows
from obseq.survey.kinds.directions import ZEN
from obseq.survey.kinds.lengths import DIST

TOOL = Path(__file__).resolve().parents[2] / "tools" / "benchmarks" / "make_network.py"
FRAME = "RTL*657700*6860700*0*IGNF:LAMB93"


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """600 points of which one in sixty is known, 3,400 observations: the part has a third of them."""
    folder = tmp_path_factory.mktemp("large")

    options = ["--points", "600", "--observations", "3600", "--known", "60", "--out", str(folder)]
    with patch.object(sys, "argv", [str(TOOL), *options]):
        runpy.run_path(str(TOOL), run_name="__main__")
    return folder / "network.obs", folder / "network.cor"


def test_a_part_is_about_the_worst_point_and_reaches_known_points(files):
    network = Network.read(*files, frame=FRAME)
    notes = Notes(network.points, network.book)
    off, rows = np.zeros(len(network.points), np.int64), network.book.observations
    off[network.points.index["P300"]] = 9
    kept = part_that_shows(notes, off, 200)
    inside = kept[rows.from_points] & kept[rows.to_points]
    assert kept[network.points.index["P300"]] and 200 < np.count_nonzero(inside) < 1000
    assert np.count_nonzero(kept & ~network.points.is_free.any(axis=1)) >= 4
    assert part_that_shows(notes, off, len(rows)) is None


def test_a_part_is_about_all_known_points_that_nothing_agrees_with(files):
    network = Network.read(*files, frame=FRAME)
    notes, rows = Notes(network.points, network.book), network.book.observations
    named = network.book.counts(rows.active, len(network.points))
    far = np.flatnonzero(~network.points.is_free.any(axis=1))[[0, -1]]
    off = np.zeros(len(network.points), np.int64)
    off[far] = named[far]
    kept = part_that_shows(notes, off, 400)
    for point in far:
        sights = (rows.from_points == point) | (rows.to_points == point)
        assert (kept[rows.from_points[sights]] & kept[rows.to_points[sights]]).all()


@pytest.mark.slow(reason="a dozen rewritings are tried on a part, one on the whole")
def test_zenith_angles_in_degrees_are_one_error(files):
    network = Network.read(*files, frame=FRAME)
    rows = network.book.observations
    values = np.where(rows.types == ZEN.code, 0.9 * rows.values, rows.values)
    spoilt = replace(network, book=replace(network.book, observations=replace(rows, values=values)))
    (error,) = spoilt.adjust().diagnosis.accused
    assert error.code == "S200" and [slip.code for slip in error.slips] == ["W100"]
    assert len(error.observations) == np.count_nonzero(rows.types == ZEN.code)


@pytest.mark.slow(reason="rewritings are tried on a part, one on the whole")
def test_exchanged_names_of_known_points_far_from_each_other_are_one_error(files):
    network = Network.read(*files, frame=FRAME)
    points, rows = network.points, network.book.observations
    (known,) = np.nonzero(~points.is_free.any(axis=1))
    far = known[np.argsort(-network.book.counts(rows.active, len(points))[known])[:2]]  # seen most often
    coordinates = points.coordinates.copy()
    coordinates[far] = coordinates[far[::-1]]
    spoilt = replace(network, points=replace(points, coordinates=coordinates))
    (error,) = spoilt.adjust().diagnosis.accused
    assert error.code == "S113" and [slip.code for slip in error.slips] == ["W133"]
    assert {point.name for point in error.points} == {points.names[row] for row in far}


@pytest.mark.slow(reason="a dozen rewritings are tried on a part, one on the whole")
def test_feet_are_found_on_a_part_and_told_of_all(files):
    network = Network.read(*files, frame=FRAME)
    rows = network.book.observations
    feet = np.where(rows.types == DIST.code, rows.values / 0.3048, rows.values)
    spoilt = replace(network, book=replace(network.book, observations=replace(rows, values=feet)))
    begun, like = [], NetworkModel.like

    def counted(model, given):
        begun.append(np.count_nonzero(given.book.observations.active))
        return like(model, given)

    with patch.object(NetworkModel, "like", counted):
        (error,) = spoilt.adjust().diagnosis.accused
    assert [slip.code for slip in error.slips] == ["W106"]
    assert len(error.observations) == np.count_nonzero(rows.types == DIST.code)
    whole = [count for count in begun if count > 2 * POLICY.part]
    assert len(begun) > 5 and len(whole) == 1, "all but the best are tried on the part alone"


@pytest.mark.slow(reason="a network of 3,400 observations, with its search")
def test_a_tangent_frame_that_is_not_named_is_one_error_of_all_known_heights(files):
    diagnosis = Network.read(*files).adjust().diagnosis
    (error,) = diagnosis.accused
    assert (diagnosis.status, error.code, len(error.points)) == ("explained", "S117", 10)
    assert error.size[0] == pytest.approx(-0.5e6 / 6.37e6, abs=3.0 * error.sigma[0])
