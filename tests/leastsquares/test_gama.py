"""Textbook networks and GNU Gama's own, read from .gkf files and adjusted with formulas of this file.

Inside, coordinates are east, north, up whatever the axes of the file, horizontal angles are clockwise, and
the plane position and the height of a point are two blocks of unknowns.
"""

import functools
import json
import math
import xml.etree.ElementTree as ET
from collections import defaultdict
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
import pytest

import obseq
from obseq.codegen import compile_formula
from obseq.errors import SingularSystemError
from obseq.formulas.base import Formula
from obseq.formulas.blocks import Angle, Length, Number, Point2, Points2, Vector
from obseq.formulas.functions import Scalar, angle_difference, atan2, sqrt

DATA_SETS = ("gama-textbook-1d", "gama-textbook-2d", "gama-textbook-3d", "gama-local-small")
GON = math.pi / 200
AXES = {"n": (0.0, 1.0), "e": (1.0, 0.0), "s": (0.0, -1.0), "w": (-1.0, 0.0)}
HAS_DATUM = hasattr(obseq.LeastSquares, "set_datum")
FREE = ("LotherStrehle_Direction3", "LotherStrehle_Direction4", "StrangBorre_Distance_free")
FREE += ("fixed-constrained", "jezerka-dir", "jezerka-ang")
NOT_YET = {} if HAS_DATUM else dict.fromkeys(FREE, "free network: LeastSquares has no datum yet")
NOT_YET["local_3d"] = "free network whose datum is made of blocks of two kinds, plane points and heights"
"""Networks that cannot be adjusted yet, and why."""


# The formulas


def bearing(a: Point2, b: Point2) -> Scalar:
    return atan2(b.x - a.x, b.y - a.y)


def length(a: Point2, b: Point2, up: Scalar = 0.0) -> Scalar:
    return sqrt((b.x - a.x) ** 2 + (b.y - a.y) ** 2 + up * up)


class PlaneDistance(Formula):
    def residual(self, a: Point2, b: Point2, *, distance: Length) -> Scalar:
        return length(a, b) - distance


class Reading(Formula):
    """A direction of a set whose zero is unknown."""

    def residual(self, station: Point2, target: Point2, zero: Angle, *, reading: Angle) -> Scalar:
        return angle_difference(bearing(station, target) - zero, reading)


class Azimuth(Formula):
    def residual(self, station: Point2, target: Point2, *, azimuth: Angle) -> Scalar:
        return angle_difference(bearing(station, target), azimuth)


class HorizontalAngle(Formula):
    def residual(self, station: Point2, back: Point2, fore: Point2, *, angle: Angle) -> Scalar:
        return angle_difference(bearing(station, fore) - bearing(station, back), angle)


@dataclass(frozen=True)
class CorrelatedAngles(Formula):
    """Angles of one station, combined by a lower triangular matrix that makes them independent."""

    number: int

    @property
    def name(self) -> str:
        return f"CorrelatedAngles{self.number}"

    @property
    def angles(self) -> tuple[str, ...]:
        return tuple(f"angle{k}" for k in range(self.number))

    @property
    def factors(self) -> tuple[str, ...]:
        return tuple(f"factor{k}_{j}" for k in range(self.number) for j in range(k + 1))

    def residual(
        self,
        station: Point2,
        back: Annotated[Points2, "back_e{}", "back_n{}", "number"],
        fore: Annotated[Points2, "fore_e{}", "fore_n{}", "number"],
        *,
        angle: Annotated[Vector, "angles"],
        factor: Annotated[Vector, "factors"],
    ) -> list[Scalar]:
        gaps = [
            angle_difference(bearing(station, f) - bearing(station, b), observed)
            for b, f, observed in zip(back, fore, angle, strict=True)
        ]
        rows = [factor[k * (k + 1) // 2 : (k + 1) * (k + 2) // 2] for k in range(self.number)]
        return [sum(w * gap for w, gap in zip(row, gaps, strict=False)) for row in rows]


class SlopeDistance(Formula):
    """From instrument to target, `raised`: height of the target over its point, less the instrument's."""

    def residual(
        self, a: Point2, z_a: Length, b: Point2, z_b: Length, *, distance: Length, raised: Length
    ) -> Scalar:
        return length(a, b, z_b - z_a + raised) - distance


class ZenithAngle(Formula):
    def residual(
        self, a: Point2, z_a: Length, b: Point2, z_b: Length, *, angle: Angle, raised: Length
    ) -> Scalar:
        return atan2(length(a, b), z_b - z_a + raised) - angle


class HeightDifference(Formula):
    def residual(self, z_a: Length, z_b: Length, *, difference: Number) -> Scalar:
        return z_b - z_a - difference


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

    `observations` holds, per formula, rows of (block ids, observed values, sigma or None when whitened).
    """

    system: obseq.LeastSquares
    axes: np.ndarray
    plane: dict[str, int] = field(default_factory=dict)
    height: dict[str, int] = field(default_factory=dict)
    datum: list[int] = field(default_factory=list)
    observations: dict = field(default_factory=lambda: defaultdict(list))

    def bearing(self, a: str, b: str) -> float:
        east, north = (self.system.values([self.plane[b]]) - self.system.values([self.plane[a]]))[0]
        return math.atan2(east, north)

    def linear(self, combination, value: float, sigma: float) -> None:
        """A row: sum over (block, coefficients) = value."""
        columns = [[block] for block, _ in combination]
        self.system.add_linear(columns, [[row] for _, row in combination], [value], sigma, group="linear")


def read(path, expected) -> Network:
    network = ET.parse(path).getroot().find("{*}network")
    axes = np.array([AXES[letter] for letter in network.get("axes-xy", "ne")])
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
        fixed, adjusted = attributes.get("fix", ""), attributes.get("adj", "")
        kinds = (fixed + adjusted).lower()
        values = {axis: round(value, 1) for axis, value in expected.get(name, {}).items()}
        values |= {axis: float(attributes[axis]) for axis in "xyz" if axis in attributes}
        if "x" in kinds:
            place = np.array([values["x"], values["y"]]) @ result.axes
            (result.plane[name],) = result.system.add_points([name], [place])
        if "z" in kinds:
            (result.height[name],) = result.system.add_scalars([name], [values["z"]])
        for letter, blocks in (("x", result.plane), ("z", result.height)):
            if letter in fixed.lower():
                result.system.freeze([blocks[name]])
            if letter.upper() in adjusted:
                result.datum.append(blocks[name])


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
    factors = whiten[np.tril_indices(len(rows))]
    stations, backs, fores = zip(*(blocks for _, blocks, _, _ in rows), strict=True)
    values = (*(values[0] for _, _, values, _ in rows), *factors)
    result.observations[CorrelatedAngles(len(rows))].append(((stations[0], *backs, *fores), values, 1.0))


def observation(result, kind, station, element, zero, defaults):
    """(block ids, observed values, sigma) of one element of a set."""
    plane, height = result.plane, result.height
    is_length = kind in ("distance", "s-distance")
    value, second = (float(element.get("val")), 1e-3) if is_length else angle(element.get("val"))
    default = defaults.get({"s-distance": "distance", "z-angle": "zenith-angle"}.get(kind, kind))
    sigma = float(element.get("stdev", default or 1.0)) * second
    if kind == "angle":
        return (plane[station], plane[element.get("bs")], plane[element.get("fs")]), (value,), sigma
    target = element.get("to")
    if kind in ("s-distance", "z-angle"):
        raised = float(element.get("to_dh", 0)) - float(element.get("from_dh", 0))
        return (plane[station], height[station], plane[target], height[target]), (value, raised), sigma
    blocks = (plane[station], plane[target]) + ((zero,) if kind == "direction" else ())
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
        blocks = tuple(result.height[element.get(end)] for end in ("from", "to"))
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
            (block, factor * np.asarray(coefficients))
            for factor, (parts, _) in zip(factors, rows, strict=True)
            if factor
            for block, coefficients in parts
        ]
        result.linear(combination, factors @ values, 1.0)


def coordinate_rows(result, element):
    name = element.get("id")
    for letter, axis in zip("xy", result.axes, strict=True):
        if element.get(letter):
            yield [(result.plane[name], axis)], float(element.get(letter))
    if element.get("z"):
        yield [(result.height[name], [1.0])], float(element.get("z"))


def vector_rows(result, element):
    if not element.tag.endswith("vec"):
        return
    a, b = element.get("from"), element.get("to")
    for letter, axis in zip(("dx", "dy"), result.axes, strict=True):
        yield [(result.plane[a], -axis), (result.plane[b], axis)], float(element.get(letter))
    yield [(result.height[a], [-1.0]), (result.height[b], [1.0])], float(element.get("dz"))


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
    from pathlib import Path

    folder = Path(__file__).resolve().parents[3] / "shared" / "data"
    for data_set in DATA_SETS:
        path = folder / data_set / "expected.json"
        names = json.loads(path.read_text())["networks"] if path.is_file() else ["absent"]
        for name in names:
            marks = [pytest.mark.skip(reason=NOT_YET[name])] if name in NOT_YET else []
            yield pytest.param(data_set, name, id=name, marks=marks)


def loaded(shared_data, data_set, name):
    expected = json.loads((shared_data / data_set / "expected.json").read_text())["networks"][name]
    return expected, read(shared_data / data_set / expected["file"], expected["points"])


@pytest.mark.parametrize(("data_set", "name"), list(networks()))
def test_network(shared_data, data_set, name):
    expected, network = loaded(shared_data, data_set, name)
    if expected["datum_defect"]:
        network.system.set_datum(network.datum)
    result = network.system.solve(max_iterations=50, tolerance=1e-9, covariance=True)
    assert result.converged
    assert result.n_observations + result.n_constraints == expected["equations"]
    assert result.n_unknowns == expected["unknowns"]
    assert result.redundancy == expected["dof"]
    assert result.sigma0 == pytest.approx(expected["sigma0"], rel=1e-6)
    for point, values in expected["points"].items():
        for letter, found, precision in solution(network, result, point):
            where = f"{name}, {letter} of {point}"
            assert found == pytest.approx(values[letter], rel=0, abs=1e-6), where
            assert precision == pytest.approx(values[f"s{letter}"], rel=1e-5), where


def solution(network, result, point):
    """(axis of the file, coordinate, standard deviation) of one point."""
    if point in network.plane:
        ids = [network.plane[point]]
        covariance = result.covariance(ids)[0]
        for letter, axis in zip("xy", network.axes, strict=True):
            yield letter, float(axis @ result.values(ids)[0]), math.sqrt(axis @ covariance @ axis)
    if point in network.height:
        ids = [network.height[point]]
        yield "z", float(result.values(ids)[0, 0]), float(result.precisions(ids)[0, 0])


@pytest.mark.parametrize("name", ["StrangBorre_Distance_free", "LotherStrehle_Direction3"])
def test_a_free_network_without_datum_is_refused_by_name(shared_data, name):
    _, network = loaded(shared_data, "gama-textbook-2d", name)
    with pytest.raises(SingularSystemError, match="undetermined"):
        network.system.solve()
