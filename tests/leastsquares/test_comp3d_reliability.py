"""Redundancy numbers, standardised residuals and the global test against those of IGN's Comp3D."""

import json
from typing import Annotated

import numpy as np
import pytest

import obseq
from obseq.codegen import compile_formula
from obseq.formulas.base import Formula
from obseq.formulas.blocks import Length, Point2, norm
from obseq.formulas.functions import Scalar
from obseq.leastsquares.statistics.ellipses import error_ellipses
from obseq.leastsquares.statistics.hypothesis_tests import global_test
from obseq.leastsquares.statistics.reliability import reliability


class FlatDistance(Formula):
    def residual(self, a: Point2, b: Point2, *, distance: Annotated[Length, "D"]) -> Scalar:
        return norm(b - a) - distance


def expected_of(shared_data, name):
    expected = json.loads((shared_data / name / "expected.json").read_text())
    rows = [row for row in expected["observations"] if row["active"]]
    return expected, rows


def plane_network(shared_data):
    """Three distances to a point from three points that are known to 0.1 mm."""
    expected, rows = expected_of(shared_data, "comp3d-simple2d")
    system = obseq.LeastSquares()
    names = ["A1", "B1", "C1", "P1"]
    ids = system.add_points(names, [expected["points"][name]["initial"][:2] for name in names])
    points = dict(zip(names, ids, strict=True))
    system.add_prior(ids[:3], system.values(ids[:3]), 1e-4)
    sights = [row for row in rows if row["code"] == 2]
    blocks = {"a": [points[row["from"]] for row in sights], "b": [points[row["to"]] for row in sights]}
    values, sigmas = ([row[key] for row in sights] for key in ("value", "sigma_total"))
    batch = system.add(compile_formula(FlatDistance()), blocks, values, sigmas)
    return expected, sights, system, ids, batch


def levelling_network(shared_data):
    """Six pairs of points, each with two height differences of different weight."""
    expected, rows = expected_of(shared_data, "comp3d-weights")
    sights = [row for row in rows if row["code"] == 4]
    system = obseq.LeastSquares()
    names = sorted({row[end] for row in sights for end in ("from", "to")})
    points = dict(zip(names, system.add_scalars(names, np.zeros(len(names))), strict=True))
    for row in rows:
        if row["code"] == -3:
            system.add_prior([points[row["from"]]], [[row["value"]]], row["sigma_total"])
    columns = [[points[row[end]] for row in sights] for end in ("from", "to")]
    one = np.ones((len(sights), 1))
    values, sigmas = ([row[key] for row in sights] for key in ("value", "sigma_total"))
    return expected, sights, system, system.add_linear(columns, [-one, one], values, sigmas)


def compare(sights, part):
    for row, sight in enumerate(sights):
        where = part.label(row)
        assert part.residuals[row, 0] == pytest.approx(sight["residual"], abs=2e-9), where
        assert 100 * part.redundancy[row, 0] == pytest.approx(sight["redundancy_pct"], abs=1e-5), where
        if sight["standardized"] is None:  # Comp3D tells none below one per cent
            assert part.redundancy[row, 0] < 0.01, where
        else:
            assert part.w[row, 0] == pytest.approx(sight["standardized"], rel=1e-5), where


def test_plane_network(shared_data):
    expected, sights, system, ids, batch = plane_network(shared_data)
    result = system.solve(covariance=True, tolerance=1e-9)
    assert result.redundancy == expected["summary"]["dof"]
    assert result.sigma0 == pytest.approx(expected["summary"]["sigma0_final"], rel=1e-6)
    quality = reliability(system, result)
    compare(sights, quality.of(batch))
    constrained = [row for row in expected["observations"] if row["code"] < 0]
    (priors,) = quality.constraints
    percent = [row["redundancy_pct"] for row in constrained]
    np.testing.assert_allclose(100 * priors.redundancy[:, 0], percent, atol=1e-6)
    assert quality.sum_of_redundancy_numbers == pytest.approx(1.0, abs=1e-9)
    assert "FlatDistance C1 -> P1 (row 2)" in quality.uncontrolled()
    longest = expected["points"]["P1"]["ellipsoid_axes"][0][0]
    assert error_ellipses(result, ids[3:]).semi_major[0] == pytest.approx(longest, rel=1e-6)


def test_levelling_network(shared_data):
    expected, sights, system, batch = levelling_network(shared_data)
    result = system.solve(covariance=True)
    assert result.sigma0 == pytest.approx(expected["summary"]["sigma0_final"], rel=1e-6)
    compare(sights, reliability(system, result).of(batch))


@pytest.mark.parametrize("name", ["comp3d-simple2d", "comp3d-weights"])
def test_global_test(shared_data, name):
    expected, _, system, *_ = (plane_network if name == "comp3d-simple2d" else levelling_network)(shared_data)
    theirs = expected["summary"]["chi2_test"]
    test = global_test(system.solve(), level=1 - theirs["confidence"])
    # Comp3D gives the factors that carry sigma0 to the ends of its confidence interval
    np.testing.assert_allclose(test.sigma0_limits, [1 / theirs["max"], 1 / theirs["min"]], rtol=1e-9)
    assert test.passed == (theirs["min"] * test.sigma0 < 1 < theirs["max"] * test.sigma0)
