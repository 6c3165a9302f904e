"""Redundancies and standardised residuals of a measured polygon, beside a dense reference and Comp3D.

The reference is written plainly here: angles and distances of the geometry, their derivatives by differences,
an orthogonal factor of the dense weighted matrix. Of one thing there are two readings: whether the plumb line
of an instrument turns when its point is moved. Ours, as MMVII's, is held while derivatives are taken and made
anew after each step; the sphere of Comp3D turns it. The derivatives differ by the length of a sight over the
radius of the Earth, 1e-6 here, and the redundancies by 1.1e-7. Each program is compared with its reading.
"""

import json
import math

import numpy as np
import pytest

from obseq import crs
from obseq.crs.refraction import refraction_correction
from obseq.survey import KINDS, Network

CODES = {kind.name: kind.code for kind in KINDS}
STEP = 1e-4  # m: differences are good to 1e-9 of the derivatives
THEIRS = {1: "Dist", 3: "Dist", 5: "Hz", 6: "Zen", 7: "Hz"}
GON = 200.0 / math.pi


class Polygon:
    """The network adjusted, what is active of its observations and of its record, and Comp3D's numbers."""

    def __init__(self, folder):
        network = Network.read_project(folder / "project.comp")
        self.adjusted, self.k = network.adjust(), network.frame.refraction_coefficient
        record, given = self.adjusted.record(), self.adjusted.book.observations
        self.records = [row for row in record.observations if row.active]
        self.constraints = record.constraints
        active = given.active
        self.types, self.stations = given.types[active], given.stations[active]
        self.ends = given.from_points[active], given.to_points[active]
        self.places, self.frame = self.adjusted.points.coordinates, crs.parse(self.adjusted.frame)
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

    def computed(self, places, upright):
        """(n,) azimuths, zenith angles and distances, the plumb lines being those at the places `upright`."""
        origins, targets = self.ends
        axes = self.frame.vertical_rotation(upright)[origins]
        east, north, up = np.einsum("nij,nj->in", axes, places[targets] - places[origins])
        flat = np.hypot(east, north)
        bent = refraction_correction(self.frame, upright[origins], upright[targets], self.k)
        is_zenith, is_distance = self.types == CODES["Zen"], self.types == CODES["Dist"]
        azimuths = np.where(is_zenith, np.arctan2(flat, up) - bent, np.arctan2(east, north))
        return np.where(is_distance, np.hypot(flat, up), azimuths)

    def design(self, turning):
        """(n + 3, 178) derivatives over sigmas, by coordinates and orientations; the known point last."""
        columns = [self.difference(k, turning) for k in range(self.places.size)]
        is_read = self.types == CODES["Hz"]
        for station in np.unique(self.stations[is_read]):
            columns.append(np.where(is_read & (self.stations == station), -1.0, 0.0))
        design = np.column_stack(columns) / np.array([[row.sigma] for row in self.records])
        held = np.zeros((len(self.constraints), design.shape[1]))
        names = self.adjusted.points.names
        for row, known in zip(held, self.constraints, strict=True):
            row[3 * names.index(known.point) + "xyz".index(known.coordinate)] = 1.0 / known.sigma
        return np.vstack([design, held])

    def difference(self, k, turning):
        """(n,) derivatives by coordinate k."""
        step = STEP * np.eye(1, self.places.size, k).reshape(-1, 3)
        ends = [
            self.computed(at, at if turning else self.places)
            for at in (self.places + step, self.places - step)
        ]
        gap = ends[0] - ends[1]
        return (gap - 2 * math.pi * np.round(gap / (2 * math.pi))) / (2 * STEP)

    def redundancies(self, turning):
        """(n,) 1 - a (A' A)^-1 a' for the rows a of the design A: the squares of its orthogonal factor."""
        orthogonal, _ = np.linalg.qr(self.design(turning))
        return 1.0 - np.square(orthogonal).sum(axis=1)[: len(self.records)]


@pytest.fixture(scope="module")
def polygon(shared_data):
    return Polygon(shared_data / "comp3d-polygone-k06")


def test_redundancies_and_standardised_residuals_are_those_of_a_dense_reference(polygon):
    expected = polygon.redundancies(turning=False)
    found = np.array([row.redundancy for row in polygon.records])
    np.testing.assert_allclose(found, expected, rtol=0, atol=5e-8)
    judged = [k for k, row in enumerate(polygon.records) if row.standardised_residual is not None]
    assert len(judged) == 359  # all but the azimuth, which nothing controls
    for k in judged:
        row = polygon.records[k]
        standardised = row.residual / (row.sigma * math.sqrt(expected[k]))
        assert row.standardised_residual == pytest.approx(standardised, abs=5e-8), row


def test_redundancies_of_comp3d_are_those_of_plumb_lines_that_turn(polygon):
    """All to 5e-8: what is between its numbers and ours is the turn of the plumb line, no rounding."""
    turning, held = (polygon.redundancies(turning) for turning in (True, False))
    known = [k for k, row in enumerate(polygon.theirs) if row is not None]
    printed = np.array([polygon.theirs[k]["redundancy_pct"] / 100 for k in known])
    assert len(known) == 359
    assert np.abs(turning[known] - printed).max() < 5e-8
    assert 5e-8 < np.abs(held[known] - printed).max() < 1.2e-7


def test_standardised_residuals_of_comp3d_come_from_its_residuals_and_its_redundancies(polygon):
    """To 5e-7: its R + h, 6e6 m in double precision, is known to 1e-9 m, which shows where r is a hundredth.

    Between its v and ours that rounding makes up to 1e-3 of a standardised residual of small r and sigma.
    """
    redundancies, apart = polygon.redundancies(turning=True), []
    for row, theirs, r in zip(polygon.records, polygon.theirs, redundancies, strict=True):
        if theirs is not None and theirs["standardized"] is not None:
            own = theirs["residual"] / (theirs["sigma_total"] * math.sqrt(r))
            apart.append(abs(own - theirs["standardized"]))
            assert row.standardised_residual == pytest.approx(theirs["standardized"], abs=1e-3)
    assert len(apart) > 340
    assert max(apart) < 5e-7
    assert np.mean(np.array(apart) < 5e-8) > 0.97
