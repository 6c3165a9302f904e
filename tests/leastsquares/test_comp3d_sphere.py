"""A polygon of IGN's Comp3D with Comp3D's equations, in the engine: redundancies, and why residuals differ.

Comp3D computes on a sphere of radius R. Its lengths and zenith angles come from R + height in double
precision, whose last place is 0.9 nm: so far, divided by sigma sqrt(r), are its standardised residuals from
those of its own equations. Written without that cancellation they are the formulas below.
"""

import json
from typing import Annotated

import numpy as np
import pytest

import obseq
from obseq.codegen import compile_formula
from obseq.formulas.base import Formula
from obseq.formulas.blocks import Angle, Length, Point3
from obseq.formulas.functions import Scalar, angle_difference, atan2, cos, sin, sqrt
from obseq.leastsquares.statistics.reliability import reliability

GON = np.pi / 200
RADIUS = 6380935.2757568145
REFRACTION = 0.12


def arc(a: Point3, b: Point3) -> Scalar:
    return sqrt((b.x - a.x) ** 2 + (b.y - a.y) ** 2) / RADIUS


def azimuth(a: Point3, b: Point3) -> Scalar:
    za, zb = (sqrt(1 - (p.x**2 + p.y**2) / RADIUS**2) for p in (a, b))
    return atan2(b.x - a.x * cos(arc(a, b)), b.y * za - a.y * zb)


class SphereLength(Formula):
    def residual(self, a: Point3, b: Point3, *, length: Annotated[Length, "D"]) -> Scalar:
        chord = 4 * (RADIUS + a.z) * (RADIUS + b.z) * sin(arc(a, b) / 2) ** 2
        return sqrt((b.z - a.z) ** 2 + chord) - length


class SphereZenith(Formula):
    def residual(self, a: Point3, b: Point3, *, zenith: Annotated[Angle, "Z"]) -> Scalar:
        far = RADIUS + b.z
        up = b.z - a.z - 2 * far * sin(arc(a, b) / 2) ** 2
        return angle_difference(atan2(far * sin(arc(a, b)), up), zenith)


class SphereDirection(Formula):
    def residual(
        self, a: Point3, b: Point3, zero: Annotated[Angle, "G0"], *, hz: Annotated[Angle, "Hz"]
    ) -> Scalar:
        return angle_difference(azimuth(a, b) - zero, hz)


FORMULAS = ((SphereLength, (1, 3)), (SphereZenith, (6,)), (SphereDirection, (5, 7, 8)))


def on_sphere(points):
    """(n, 3) x, y, height of Comp3D's computation, from coordinates in its stereographic plane."""
    given = np.array(points)
    given[:, :2] /= 1 + (given[:, :2] ** 2).sum(axis=1, keepdims=True) / (4 * RADIUS**2)
    return given


def unit_of(rows):
    """Metres or radians in the unit of the observations of one formula."""
    return 1.0 if rows[0]["code"] in (1, 3) else GON


def values_of(rows, places):
    """(n,) observed values in metres and radians; zenith angles are corrected for refraction."""
    values = unit_of(rows) * np.array([row["value"] for row in rows])
    if rows[0]["code"] != 6:
        return values
    sights = [np.hypot(*(places[row["to"]] - places[row["from"]])[:2]) for row in rows]
    return values + REFRACTION * np.array(sights) / (2 * RADIUS)


@pytest.fixture(scope="module")
def expected(shared_data):
    return json.loads((shared_data / "comp3d-polygone-k06" / "expected.json").read_text())


@pytest.fixture(scope="module")
def places(expected):
    names = list(expected["points"])
    return dict(zip(names, on_sphere([expected["points"][name]["xyz"] for name in names]), strict=True))


def zeros_of(system, expected):
    """Azimuths of the zeros of the circles by station, and that of the north, which is held."""
    stations = [name.removesuffix("_G0_1") for name in expected["parameters"]]
    start = [entry["value"] * GON for entry in expected["parameters"].values()]
    ids = system.add_scalars([*stations, "north"], [*start, 0.0])
    system.freeze(ids[-1:])
    return dict(zip([*stations, "north"], ids, strict=True))


def network(expected, places):
    """The system, blocks of the points, and the rows of the file with their batches, by formula.

    The convergence of the meridians turns the whole network and is left out: no residual feels it.
    """
    system = obseq.LeastSquares()
    points = dict(zip(places, system.add_points(list(places), list(places.values())), strict=True))
    zeros = zeros_of(system, expected)
    rows = [row for row in expected["observations"] if row["active"]]
    known = [row for row in rows if row["code"] < 0]
    system.add_prior([points[known[0]["from"]]], [[row["value"] for row in known]], known[0]["sigma_total"])
    batches = []
    for formula, codes in FORMULAS:
        sights = [row for row in rows if row["code"] in codes]
        blocks = {"a": [points[row["from"]] for row in sights], "b": [points[row["to"]] for row in sights]}
        if 8 in codes:
            blocks["zero"] = [zeros["north" if row["code"] == 8 else row["from"]] for row in sights]
        sigmas = unit_of(sights) * np.array([row["sigma_total"] for row in sights])
        added = system.add(compile_formula(formula()), blocks, values_of(sights, places), sigmas)
        batches.append((sights, added))
    return system, points, batches


@pytest.fixture(scope="module")
def polygon(expected, places):
    """The result in the engine, and the rows of the file with their reliability, by formula."""
    system, _, batches = network(expected, places)
    result = system.solve(covariance=True, tolerance=1e-9)
    quality = reliability(system, result)
    return result, [(sights, quality.of(batch)) for sights, batch in batches]


def rounding(code, a, b):
    """What R + height in double precision does to Comp3D's lengths (m) and zenith angles (rad).

    Args:
        code: Of the observations, in Comp3D's files.
        a: (n, 3) x, y, height of the stations.
        b: (n, 3) of the targets.
    """
    if code in (5, 7, 8):
        return np.zeros(len(a))
    theta = np.hypot(b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]) / RADIUS
    za, zb, half = a[:, 2] + RADIUS, b[:, 2] + RADIUS, np.sin(theta / 2) ** 2
    rise = b[:, 2] - a[:, 2]
    if code in (1, 3):
        return np.sqrt((za - zb) ** 2 + 4 * za * zb * half) - np.sqrt(rise**2 + 4 * za * zb * half)
    across = zb * np.sin(theta)
    theirs = np.arctan2(np.sin(theta), np.cos(theta) - za / zb)
    return theirs - np.arctan2(across, rise - 2 * zb * half)


@pytest.fixture(scope="module")
def emulation(expected):
    """Comp3D's two iterations from its start, its rounding fed to the engine with the observations."""
    names = list(expected["points"])
    start = on_sphere([expected["points"][name]["initial"] for name in names])
    final = on_sphere([expected["points"][name]["xyz"] for name in names])
    system, points, batches = network(expected, dict(zip(names, start, strict=True)))
    solved = dict(zip(names, final, strict=True))  # refraction and sigmas are those of the end
    given = [values_of(sights, solved) for sights, _ in batches]

    def follow(system, _):
        for (sights, batch), values in zip(batches, given, strict=True):
            a, b = (system.values([points[row[end]] for row in sights]) for end in ("from", "to"))
            observations = batch.observations.copy()
            observations[:, -1] = values - rounding(sights[0]["code"], a, b)
            batch.observations = observations

    result = system.solve(2, tolerance=-1.0, covariance=True, before_iteration=follow)
    quality = reliability(system, result)
    return [(sights, quality.of(batch)) for sights, batch in batches]


def test_sigma0_is_that_of_comp3d(expected, polygon):
    result, _ = polygon
    assert result.redundancy == expected["summary"]["dof"]
    assert result.sigma0 == pytest.approx(expected["summary"]["sigma0_final"], rel=1e-6)


def test_redundancies_are_those_of_comp3d(polygon):
    _, parts = polygon
    assert sum(len(sights) for sights, _ in parts) == 360
    for sights, part in parts:
        theirs = [row["redundancy_pct"] / 100 for row in sights]
        np.testing.assert_allclose(part.redundancy[:, 0], theirs, rtol=0, atol=5e-8)


def test_its_residuals_are_standardised_as_by_comp3d(polygon):
    for sights, part in polygon[1]:
        for row, redundancy in zip(sights, part.redundancy[:, 0], strict=True):
            if row["standardized"] is not None:  # Comp3D tells none below one per cent
                found = row["residual"] / (row["sigma_total"] * np.sqrt(redundancy))
                assert found == pytest.approx(row["standardized"], abs=5e-8)


def test_residuals_differ_by_less_than_two_last_places_of_the_radius(polygon, places):
    for sights, part in polygon[1]:
        for row, residual in zip(sights, part.residuals[:, 0], strict=True):
            far = np.linalg.norm(places[row["to"]] - places[row["from"]])
            at_target = 1.0 if row["code"] in (1, 3) else far
            assert abs(residual - unit_of(sights) * row["residual"]) * at_target < 2 * np.spacing(RADIUS)


def test_with_its_rounding_the_residuals_are_those_of_comp3d(emulation):
    differences, tight = [], []
    for sights, part in emulation:
        for row, residual, w in zip(sights, part.residuals[:, 0], part.w[:, 0], strict=True):
            assert residual == pytest.approx(unit_of(sights) * row["residual"], abs=1e-11)
            if row["standardized"] is not None:
                differences.append(abs(w - row["standardized"]))
                tight.append(row["redundancy_pct"] < 1.5)
    # What is left is the last place of Comp3D's sine, cosine and solver: 1e-12 m over sigma sqrt(r)
    assert np.median(differences) < 5e-8
    assert np.mean(np.array(differences) < 5e-8) > 0.8
    assert np.max(differences) < 5e-6
    assert np.max(np.array(differences)[~np.array(tight)]) < 3e-7
