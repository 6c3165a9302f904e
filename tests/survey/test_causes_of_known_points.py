"""Mistakes that known points, vectors or a set-up share: planted, and named with their size."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from obseq import InputError
from obseq.survey.diagnosing.without_accused import without_accused

TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"
sys.path.insert(0, str(TOOLS))

import bench_diagnosis as bench  # noqa: E402 (a tool, not part of the package)
import diagnosis_networks as networks  # noqa: E402
import diagnosis_slips as slips  # noqa: E402
import diagnosis_vectors as vectors  # noqa: E402

SEED = 11


def diagnosis(folder, made, slip):
    random = np.random.default_rng(SEED)
    changed, _ = slip(made(random), random)
    return bench._survey(folder, changed)[1].diagnosis


@pytest.mark.parametrize(
    ("slip", "code", "slips"),
    [
        ("exchanged ends", "S170", {"W134"}),
        ("another point", "S170", {"W118"}),
        ("antenna height", "S171", set()),
        ("antenna beside", "S172", set()),
        ("geoid heights", "S114", set()),
        ("ground scale", "S115", set()),
        pytest.param("zone", "S213", set(), marks=pytest.mark.slow),
    ],
)
def test_what_is_wrong_with_vectors_or_with_all_known_points_is_one_accusation(slip, code, slips, tmp_path):
    (one,) = diagnosis(tmp_path, vectors.vectors, vectors.SLIPS[slip]).accused
    assert one.code == code and slips <= {found.code for found in one.slips}


def test_a_shift_of_an_instrument_is_found_in_east_and_north(tmp_path):
    (one,) = diagnosis(tmp_path, networks.site, slips.eccentric).accused
    assert one.code == "S162" and 0.05 <= np.hypot(*one.size) <= 0.5
    assert "east" in one.text and "north" in one.text


def test_a_geoid_is_told_with_its_height_which_changes_lengths_on_the_ground(tmp_path):
    (one,) = diagnosis(tmp_path, vectors.vectors, vectors.geoid).accused
    height, east, north = one.size
    assert abs(height + 45.0) < 5.0 * one.sigma[0]
    assert 1e-2 < np.hypot(east, north) < 6e-2  # metres in a kilometre


def test_what_is_wrong_with_all_known_points_cannot_be_left_out(tmp_path):
    random = np.random.default_rng(SEED)
    changed, _ = vectors.geoid(vectors.vectors(random), random)
    adjustment = bench._survey(tmp_path, changed)[1]
    with pytest.raises(InputError, match="all known points"):
        without_accused(adjustment.points.points, adjustment.book, adjustment.diagnosis)


@pytest.mark.slow
def test_a_plan_in_feet_with_heights_in_metres_is_told_as_that(tmp_path):
    site = networks.site(np.random.default_rng(SEED))
    listed = {name: (x / 0.3048, y / 0.3048, z) for name, (x, y, z) in site.coordinates.items()}
    (one,) = bench._survey(tmp_path, replace(site, coordinates=listed))[1].diagnosis.accused
    assert one.what.startswith("plan of all") and [slip.code for slip in one.slips] == ["W106"]


@pytest.mark.slow
def test_coordinates_in_feet_are_told_as_that(tmp_path):
    (one,) = diagnosis(tmp_path, networks.site, slips.feet_of_known).accused
    assert one.code == "S212" and [slip.code for slip in one.slips] == ["W106"]
