"""Redundancies and standardised residuals of a measured polygon, beside a dense reference and Comp3D.

The reference is written plainly here: angles and distances of the geometry, their derivatives by differences,
an orthogonal factor of the dense weighted matrix. When a point is moved, the plumb line of its instrument
turns: the derivatives know it, by the length of a sight over the radius of the Earth, 1e-6 here, which makes
1.1e-7 of the redundancies. So does the correction for refraction, which Comp3D holds: it makes 3e-8.
"""

import json
import math

import numpy as np
import pytest

from obseq import crs
from obseq.crs.refraction import refraction_correction
from obseq.survey import KINDS, Datum, Network

CODES = {kind.name: kind.code for kind in KINDS}
STEP = 5e-3  # m: differences of the sixth order are good to 1e-12 of the derivatives
ORDERS = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
THEIRS = {1: "Dist", 3: "Dist", 5: "Hz", 6: "Zen", 7: "Hz"}
GON = 200.0 / math.pi


class Polygon:
    """The network adjusted, what is active of its observations and of its record, and Comp3D's numbers."""

    def __init__(self, folder):
        network = Network.read_project(folder / "project.comp")
        self.adjusted = network.adjust()
        record, given = self.adjusted.record(), self.adjusted.book.observations
        self.records = [row for row in record.observations if row.active]
        self.constraints = record.constraints
        active = given.active
        self.types, self.stations = given.types[active], given.stations[active]
        self.ends = given.from_points[active], given.to_points[active]
        self.places, self.frame = self.adjusted.points.coordinates, crs.parse(self.adjusted.frame)
        self.refraction = network.frame.refraction_coefficient
        rows = json.loads((folder / "expected.json").read_text(encoding="utf-8"))["observations"]
        self.theirs = self.paired([row for row in rows if row["code"] in THEIRS and row["active"]])

    def paired(self, rows):
        """Comp3D's row of each of ours; None for the azimuth."""
        found = {(THEIRS[r["code"]], r["from"], r["to"], round(r["value"], 6)): r for r in rows}
        factors = [1.0 if row.unit == "m" else GON for row in self.records]
        keys = [
            (r.type, r.origin, r.target, round(r.value * f, 6))
            for r, f in zip(self.records, factors, strict=True)
        ]
        return [found.get(key) for key in keys]

    def computed(self, sights, upright):
        """(n,) azimuths, zenith angles and distances of sights (2, n, 3), plumb lines at `upright`."""
        axes = self.frame.vertical_rotation(upright)
        east, north, up = np.einsum("nij,nj->in", axes, sights[1] - sights[0])
        flat = np.hypot(east, north)
        is_zenith, is_distance = self.types == CODES["Zen"], self.types == CODES["Dist"]
        bent = refraction_correction(self.frame, *sights, self.refraction)
        azimuths = np.where(is_zenith, np.arctan2(flat, up) - bent, np.arctan2(east, north))
        return np.where(is_distance, np.hypot(flat, up), azimuths)

    def design(self, turning):
        """(n + 3, 178) derivatives over sigmas, by coordinates and orientations; the known point last."""
        slopes = np.zeros((len(self.records), self.places.size))
        for end, points in enumerate(self.ends):
            for axis in range(3):
                slopes[np.arange(len(slopes)), 3 * points + axis] = self.slope(end, axis, turning)
        columns, is_read = [slopes], self.types == CODES["Hz"]
        for station in np.unique(self.stations[is_read]):
            columns.append(np.where(is_read & (self.stations == station), -1.0, 0.0))
        design = np.column_stack(columns) / np.array([[row.sigma] for row in self.records])
        held = np.zeros((len(self.constraints), design.shape[1]))
        names = self.adjusted.points.names
        for row, known in zip(held, self.constraints, strict=True):
            row[3 * names.index(known.point) + "xyz".index(known.coordinate)] = 1.0 / known.sigma
        return np.vstack([design, held])

    def slope(self, end, axis, turning):
        """(n,) derivatives by a coordinate of the origins (end 0) or of the targets (end 1)."""
        return sum(
            share * self.difference(end, axis, count * STEP, turning) for count, share in ORDERS.items()
        )

    def difference(self, end, axis, step, turning):
        """(n,) changes over a step of that coordinate to both sides, for one step."""
        sights = self.places[np.array(self.ends)]
        moved = np.zeros_like(sights)
        moved[end, :, axis] = step
        ends = [self.computed(at, at[0] if turning else sights[0]) for at in (sights + moved, sights - moved)]
        gap = ends[0] - ends[1]
        return (gap - 2 * math.pi * np.round(gap / (2 * math.pi))) / STEP

    def redundancies(self, turning):
        """(n,) 1 - a (A' A)^-1 a' for the rows a of the design A: the squares of its orthogonal factor."""
        orthogonal, _ = np.linalg.qr(self.design(turning))
        return 1.0 - np.square(orthogonal).sum(axis=1)[: len(self.records)]


@pytest.fixture(scope="module")
def polygon(shared_data):
    return Polygon(shared_data / "comp3d-polygone-k06")


@pytest.fixture(scope="module")
def known(polygon):
    """Our rows and Comp3D's of all but the azimuth, which has a number of its own there."""
    pairs = [pair for pair in zip(polygon.records, polygon.theirs, strict=True) if pair[1] is not None]
    assert len(pairs) == 359
    return pairs


def test_redundancies_and_standardised_residuals_are_those_of_a_dense_reference(polygon):
    expected = polygon.redundancies(turning=True)
    found = np.array([row.redundancy for row in polygon.records])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    judged = [k for k, row in enumerate(polygon.records) if row.standardised_residual is not None]
    assert len(judged) == 359  # all but the azimuth, which nothing controls
    for k in judged:
        row = polygon.records[k]
        standardised = row.residual / (row.sigma * math.sqrt(expected[k]))
        assert row.standardised_residual == pytest.approx(standardised, abs=5e-8), row


def test_redundancies_are_those_of_comp3d(known):
    found, printed = np.array([(row.redundancy, theirs["redundancy_pct"] / 100) for row, theirs in known]).T
    np.testing.assert_allclose(found, printed, rtol=0, atol=5e-8)  # it holds the refraction


def test_plumb_lines_that_did_not_turn_would_be_seen(polygon):
    found = np.array([row.redundancy for row in polygon.records])
    assert np.abs(polygon.redundancies(turning=False) - found).max() > 1e-7


def test_standardised_residuals_of_comp3d_come_from_its_residuals_and_our_redundancies(known):
    """All 349 to 5e-7, the refraction that it holds; it gives none where r is below 1 per cent."""
    judged = [(row, theirs) for row, theirs in known if theirs["standardized"] is not None]
    assert len(judged) == 349
    for row, theirs in judged:
        standardised = theirs["residual"] / (theirs["sigma_total"] * math.sqrt(row.redundancy))
        assert standardised == pytest.approx(theirs["standardized"], abs=5e-7), row
        assert row.standardised_residual == pytest.approx(theirs["standardized"], abs=1e-3)


def test_residuals_differ_from_those_of_comp3d_by_its_rounding(known):
    """It computes with R + h, 6e6 m in double precision, which is a multiple of 1e-9 m."""
    for row, theirs in known:
        is_length = row.unit == "m"
        gap = row.residual - theirs["residual"] / (1.0 if is_length else GON)
        assert abs(gap) < (3e-9 if is_length else 1e-9), row


def test_redundancies_do_not_depend_on_the_datum(polygon, shared_data):
    """Inner constraints, without the azimuth, instead of one known point; the plumb lines of both turn."""
    network = Network.read_project(shared_data / "comp3d-polygone-k06" / "project.comp")
    free = [row for row in network.adjust(datum=Datum("inner")).record().observations if row.active]
    given = [row for row in polygon.records if row.type != "Azim"]
    assert len(free) == len(given) == 359
    found, expected = ([row.redundancy for row in rows] for rows in (free, given))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
