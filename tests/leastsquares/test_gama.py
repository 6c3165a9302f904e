"""Textbook networks and GNU Gama's own, read from .gkf files and adjusted with formulas of this file.

Inside, coordinates are east, north, up whatever the axes of the file, and horizontal angles are clockwise.
All points are points of space; coordinates that a network does not have are frozen at 0.
"""

import functools
import json
import math
import xml.etree.ElementTree as ET
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest

import obseq
from obseq.codegen import compile_formula
from obseq.errors import SingularSystemError
from obseq.formulas.base import Formula
from obseq.formulas.blocks import Angle, Atom, Declaration, Length, Point3, Vector
from obseq.formulas.functions import Scalar, angle_difference, atan2, sqrt

DATA_SETS = ("gama-textbook-1d", "gama-textbook-2d", "gama-textbook-3d", "gama-local-small")
GON = math.pi / 200
MOST_ANGLES = 6
"""Angles of the largest set with a covariance; smaller sets are filled up with angles of factor 0."""

AXES = {"n": (0, 1, 0), "e": (1, 0, 0), "s": (0, -1, 0), "w": (-1, 0, 0)}


# The formulas


class Points3(tuple):
    """As many points as the attribute (the last label) says, the first label being their prefix."""

    @classmethod
    def declare(cls, labels, formula):
        prefix, number = labels
        count = getattr(formula, number)
        names = [tuple(f"{prefix}{k}_{axis}" for axis in "xyz") for k in range(count)]
        atoms = tuple(Atom("Point3", three, part=str(k)) for k, three in enumerate(names))
        return Declaration(atoms, lambda s, _: tuple(Point3(*s[3 * k : 3 * k + 3]) for k in range(count)))


def bearing(a: Point3, b: Point3) -> Scalar:
    return atan2(b.x - a.x, b.y - a.y)


def length(a: Point3, b: Point3, up: Scalar = 0.0) -> Scalar:
    return sqrt((b.x - a.x) ** 2 + (b.y - a.y) ** 2 + up * up)


class PlaneDistance(Formula):
    def residual(self, a: Point3, b: Point3, *, distance: Length) -> Scalar:
        return length(a, b) - distance


class Reading(Formula):
    """A direction of a set whose zero is unknown."""

    def residual(self, station: Point3, target: Point3, zero: Angle, *, reading: Angle) -> Scalar:
        return angle_difference(bearing(station, target) - zero, reading)


class Azimuth(Formula):
    def residual(self, station: Point3, target: Point3, *, azimuth: Angle) -> Scalar:
        return angle_difference(bearing(station, target), azimuth)


class HorizontalAngle(Formula):
    def residual(self, station: Point3, back: Point3, fore: Point3, *, angle: Angle) -> Scalar:
        return angle_difference(bearing(station, fore) - bearing(station, back), angle)


@dataclass(frozen=True)
class CombinedAngles(Formula):
    """A combination of angles of one station, independent of others where the angles themselves are not."""

    number: int

    @property
    def angles(self) -> tuple[str, ...]:
        return tuple(f"angle{k}" for k in range(self.number))

    @property
    def factors(self) -> tuple[str, ...]:
        return tuple(f"factor{k}" for k in range(self.number))

    def residual(
        self,
        station: Point3,
        back: Annotated[Points3, "back", "number"],
        fore: Annotated[Points3, "fore", "number"],
        *,
        angle: Annotated[Vector, "angles"],
        factor: Annotated[Vector, "factors"],
    ) -> Scalar:
        gaps = [
            angle_difference(bearing(station, f) - bearing(station, b), observed)
            for b, f, observed in zip(back, fore, angle, strict=True)
        ]
        return sum(w * gap for w, gap in zip(factor, gaps, strict=True))


class SlopeDistance(Formula):
    """From instrument to target, `raised`: height of the target over its point, less the instrument's."""

    def residual(self, a: Point3, b: Point3, *, distance: Length, raised: Length) -> Scalar:
        return length(a, b, b.z - a.z + raised) - distance


class ZenithAngle(Formula):
    def residual(self, a: Point3, b: Point3, *, angle: Angle, raised: Length) -> Scalar:
        return atan2(length(a, b), b.z - a.z + raised) - angle


class HeightDifference(Formula):
    def residual(self, a: Point3, b: Point3, *, difference: Length) -> Scalar:
        return b.z - a.z - difference


FORMULAS = {
    "distance": PlaneDistance(),
    "direction": Reading(),
    "azimuth": Azimuth(),
    "angle": HorizontalAngle(),
    "s-distance": SlopeDistance(),
    "z-angle": ZenithAngle(),
    "dh": HeightDifference(),
}


@functools.cache
def kernel(formula):
    return compile_formula(formula)


# The reader


@dataclass
class Network:
    """A .gkf file as a least squares system.

    Attributes:
        system: unknowns and equations.
        axes: (3, 3) the axes of the file, one per row.
        points: id of each point.
        datum: ids of the points that define the datum of a free network.
        datum_axes: which of their coordinates do, "xy" or "xyz".
        observations: per formula, rows of (block ids, observed values, sigma).
    """

    system: obseq.LeastSquares
    axes: np.ndarray
    points: dict[str, int] = field(default_factory=dict)
    datum: list[int] = field(default_factory=list)
    datum_axes: set[str] = field(default_factory=set)
    observations: dict = field(default_factory=lambda: defaultdict(list))

    def bearing(self, a: str, b: str) -> float:
        place = self.system.values([self.points[a], self.points[b]])
        return math.atan2(*(place[1] - place[0])[:2])


def read(path, expected) -> Network:
    network = ET.parse(path).getroot().find("{*}network")
    axes = np.array([*(AXES[letter] for letter in network.get("axes-xy", "ne")), (0, 0, 1)], dtype=float)
    parameters = network.find("{*}parameters")
    sigma_apr = float(parameters.get("sigma-apr", 10)) if parameters is not None else 10.0
    content = network.find("{*}points-observations")
    defaults = {name.removesuffix("-stdev"): float(value) for name, value in content.attrib.items()}
    result = Network(obseq.LeastSquares(), axes)
    read_points(result, content, expected)
    for cluster in content:
        kind = cluster.tag.rpartition("}")[2]
        if kind == "obs":
            read_set(result, cluster, defaults)
        elif kind == "height-differences":
            read_height_differences(result, cluster, sigma_apr)
        elif kind == "coordinates":
            read_linear(result, cluster, coordinate_rows)
        elif kind == "vectors":
            read_linear(result, cluster, vector_rows)
    for formula, rows in result.observations.items():
        add_rows(result.system, formula, rows)
    return result


def read_points(result, content, expected) -> None:
    """Points as the file has them; where it has none, the solution rounded to a decimetre stands in."""
    points = defaultdict(dict)
    for element in content.findall("{*}point") + content.findall("{*}coordinates/{*}point"):
        name = element.get("id")
        points[name] = element.attrib | points[name]
    for name, attributes in points.items():
        adjusted = attributes.get("adj", "")
        values = {axis: round(value, 1) for axis, value in expected.get(name, {}).items()}
        values |= {axis: float(attributes[axis]) for axis in "xyz" if axis in attributes}
        place = np.array([values.get(axis, 0.0) for axis in "xyz"]) @ result.axes
        ids = result.system.add_points([name], [place])
        result.points[name] = ids[0]
        # the plane axes of a file may be swapped, but x and y are adjusted together
        result.system.freeze(ids, [axis for axis in "xyz" if axis not in adjusted.lower()])
        if adjusted.isupper():
            result.datum.append(ids[0])
            result.datum_axes |= set(adjusted.lower())


def read_set(result, cluster, defaults) -> None:
    elements = [element for element in cluster if not element.tag.endswith("cov-mat")]
    zero = None
    rows = []
    for element in elements:
        kind = element.tag.rpartition("}")[2]
        station = element.get("from", cluster.get("from"))
        if kind == "direction" and zero is None:
            first = result.bearing(station, element.get("to")) - angle(element.get("val"))[0]
            (zero,) = result.system.add_scalars([f"zero {len(result.system.unknowns)}"], [first])
        rows.append((kind, *observation(result, kind, station, element, zero, defaults)))
    covariance = cluster.find("{*}cov-mat")
    if covariance is None:
        for kind, blocks, values, sigma in rows:
            result.observations[FORMULAS[kind]].append((blocks, values, sigma))
        return
    assert {kind for kind, *_ in rows} == {"angle"}
    whiten = np.linalg.inv(np.linalg.cholesky(matrix(covariance) * (1e-4 * GON) ** 2))
    spare = MOST_ANGLES - len(rows)
    padded = [*rows, *rows[:1] * spare]
    stations, backs, fores = zip(*(blocks for _, blocks, _, _ in padded), strict=True)
    angles = [values[0] for _, _, values, _ in padded]
    for factors in whiten:
        blocks, values = (stations[0], *backs, *fores), (*angles, *factors, *[0.0] * spare)
        result.observations[CombinedAngles(MOST_ANGLES)].append((blocks, values, 1.0))


def observation(result, kind, station, element, zero, defaults):
    """(block ids, observed values, sigma) of one element of a set."""
    is_length = kind in ("distance", "s-distance")
    value, second = (float(element.get("val")), 1e-3) if is_length else angle(element.get("val"))
    default = defaults.get({"s-distance": "distance", "z-angle": "zenith-angle"}.get(kind, kind))
    sigma = float(element.get("stdev", default or 1.0)) * second
    ends = ("bs", "fs") if kind == "angle" else ("to",)
    blocks = (result.points[station], *(result.points[element.get(end)] for end in ends))
    if kind == "direction":
        return (*blocks, zero), (value,), sigma
    if kind in ("s-distance", "z-angle"):
        return blocks, (value, float(element.get("to_dh", 0)) - float(element.get("from_dh", 0))), sigma
    return blocks, (value,), sigma


def angle(text):
    """(radians, radians per unit of its standard deviation): gon and 1e-4 gon, or d-m-s and seconds."""
    text = text.strip()
    if "-" not in text.lstrip("-"):
        return float(text) * GON, 1e-4 * GON
    degrees, minutes, seconds = (float(part) for part in text.split("-"))
    return math.radians(degrees + minutes / 60 + seconds / 3600), math.radians(1 / 3600)


def read_height_differences(result, cluster, sigma_apr) -> None:
    for element in cluster.findall("{*}dh"):
        sigma = element.get("stdev")
        millimetres = float(sigma) if sigma else sigma_apr * math.sqrt(float(element.get("dist")))
        blocks = tuple(result.points[element.get(end)] for end in ("from", "to"))
        row = blocks, (float(element.get("val")),), millimetres * 1e-3
        result.observations[FORMULAS["dh"]].append(row)


def read_linear(result, cluster, rows_of) -> None:
    """Coordinates or vectors with their covariance, made independent by combining them."""
    rows = [row for element in cluster for row in rows_of(result, element)]
    values = np.array([value for _, value in rows])
    covariance = matrix(cluster.find("{*}cov-mat")) * 1e-6
    whiten = np.linalg.inv(np.linalg.cholesky(covariance))
    for factors in whiten:
        combination = [
            (block, factor * coefficients)
            for factor, (parts, _) in zip(factors, rows, strict=True)
            if factor
            for block, coefficients in parts
        ]
        columns, coefficients = zip(*(([block], [row]) for block, row in combination), strict=True)
        result.system.add_linear(columns, coefficients, [factors @ values], 1.0)


def coordinate_rows(result, element):
    for letter, axis in zip("xyz", result.axes, strict=True):
        if element.get(letter):
            yield [(result.points[element.get("id")], axis)], float(element.get(letter))


def vector_rows(result, element):
    if not element.tag.endswith("vec"):
        return
    a, b = (result.points[element.get(end)] for end in ("from", "to"))
    for letter, axis in zip(("dx", "dy", "dz"), result.axes, strict=True):
        yield [(a, -axis), (b, axis)], float(element.get(letter))


def matrix(element):
    """A symmetric matrix from its upper band, row by row."""
    size, band = int(element.get("dim")), int(element.get("band"))
    numbers = iter(float(word) for word in element.text.split())
    result = np.zeros((size, size))
    for row in range(size):
        for column in range(row, min(size, row + band + 1)):
            result[row, column] = result[column, row] = next(numbers)
    return result


def add_rows(system, formula, rows) -> None:
    blocks, values, sigmas = (np.array(part) for part in zip(*rows, strict=True))
    roles = [block.name for block in kernel(formula).blocks]
    system.add(kernel(formula), dict(zip(roles, blocks.T, strict=True)), values, sigmas)


# The tests


def networks():
    whole = Path(__file__).resolve().parents[3] / "shared" / "data"
    folder = whole if whole.is_dir() else Path(__file__).parents[1] / "data"
    for data_set in DATA_SETS:
        path = folder / data_set / "expected.json"
        names = json.loads(path.read_text())["networks"] if path.is_file() else ["absent"]
        for name in names:
            yield pytest.param(data_set, name, id=name)


def loaded(shared_data, data_set, name):
    expected = json.loads((shared_data / data_set / "expected.json").read_text())["networks"][name]
    return expected, read(shared_data / data_set / expected["file"], expected["points"])


@pytest.mark.parametrize(("data_set", "name"), list(networks()))
def test_network(shared_data, data_set, name):
    expected, network = loaded(shared_data, data_set, name)
    if expected["datum_defect"]:
        network.system.set_datum(network.datum, sorted(network.datum_axes))
    result = network.system.solve(covariance=True)
    assert result.converged
    assert len(result.iterations) <= 6
    assert result.n_observations + result.n_constraints == expected["equations"]
    assert result.n_unknowns == expected["unknowns"]
    assert result.redundancy == expected["dof"]
    assert result.sigma0 == pytest.approx(expected["sigma0"], rel=1e-6)
    for point, values in expected["points"].items():
        solved = list(solution(network, result, point))
        assert {letter for letter, *_ in solved} == set(values) & set("xyz")
        for letter, found, precision in solved:
            where = f"{name}, {letter} of {point}"
            assert found == pytest.approx(values[letter], rel=0, abs=1e-6), where
            assert precision == pytest.approx(values[f"s{letter}"], rel=1e-5), where


def solution(network, result, point):
    """(axis of the file, coordinate, standard deviation) of one point, where it is adjusted."""
    ids = [network.points[point]]
    values, covariance = result.values(ids)[0], result.covariance(ids)[0]
    for letter, axis in zip("xyz", network.axes, strict=True):
        if variance := axis @ covariance @ axis:
            yield letter, axis @ values, math.sqrt(variance)


@pytest.mark.parametrize("name", ["StrangBorre_Distance_free", "LotherStrehle_Direction3"])
def test_a_free_network_without_datum_is_refused_by_name(shared_data, name):
    _, network = loaded(shared_data, "gama-textbook-2d", name)
    with pytest.raises(SingularSystemError, match="undetermined"):
        network.system.solve()
