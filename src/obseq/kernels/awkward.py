"""Kernels against their formulas at awkward places: half turns, axes, poles, zero distances, far coordinates.

The formula is read in 50 digits, so that what it cancels there is seen. Where it has no derivative (the
azimuth of a vertical sight), kernels give what is not finite, and nothing is judged.
"""

from __future__ import annotations

import importlib
import math
import zlib
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.kernels import index
from obseq.kernels.calculator import Calculator, calculator
from obseq.kernels.derivatives import FRAME, draw
from obseq.kernels.loading import Kernel, formula_names
from obseq.module_texts import OWN

EXACT = 1e-14
"""Largest relative error that passes: that of some forty roundings; those of the catalogue have five."""

FAR = np.array([4.2e6, 2.0e5, 4.8e6])
"""Added to all coordinates: a place on the Earth, seen from its centre; metres."""

APART = 1e-6
"""Distance of points that nearly coincide; metres."""

BESIDE = 1e-9
"""Distance of points from the axis that they are nearly on, as a part of their distance from each other."""

HALF_TURN = 1e-9
"""How far differences of angles are from a half turn; radians."""

AXES = {f"{sign}{name}": (k, s) for sign, s in (("+", 1.0), ("-", -1.0)) for k, name in enumerate("xyz")}


class Place(NamedTuple):
    """A place: what is awkward there, (n_unknowns,) unknowns, (n_observations,) observations."""

    name: str
    unknowns: FloatArray
    observations: FloatArray


@dataclass(frozen=True)
class AwkwardCheck:
    """How far a kernel is from its formula at awkward places.

    Attributes:
        name: of the formula.
        value_error: largest relative error of a value.
        value_place: where.
        slope_error: largest relative error of a derivative along a direction.
        slope_place: where.
        singular: places where the formula has no derivative.
    """

    name: str
    value_error: float
    value_place: str
    slope_error: float
    slope_place: str
    singular: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether the errors are those of rounding."""
        return max(self.value_error, self.slope_error) <= EXACT


def check(
    names: Sequence[str] | None = None, seed: int = 1, progress: Callable[[str], None] | None = None
) -> list[AwkwardCheck]:
    """Compares kernels with their formulas, which needs the generator.

    Args:
        names: Names of the formulas; all generated ones when None.
        seed: Seed of what is not awkward about the places.
        progress: Called with the name of each formula.

    Raises:
        FormulaError: No formula has one of the names.
    """
    reader = importlib.import_module("obseq.codegen.ondemand")
    checks = []
    for name in formula_names() if names is None else names:
        if progress:
            progress(f"comparing {name} with its formula")
        place = index.place(name)
        formula = reader.formula_of(name, place.package if place else OWN)
        if place and place.package != OWN:
            formula.expressions()  # tells what fails in it, with its line
        checks.append(compared(calculator(name), formula, seed))
    return checks


def compared(ours: Calculator, formula: object, seed: int = 1) -> AwkwardCheck:
    """Compares a calculator with a formula, at each awkward place that it has."""
    exact = importlib.import_module("obseq.codegen.exact")
    random = np.random.default_rng([seed, zlib.crc32(ours.name.encode())])
    value, slope, singular = (0.0, ""), (0.0, ""), []
    for place in places(ours, random):
        inputs = (place.unknowns, place.observations)
        with np.errstate(all="ignore"):
            values, jacobian = ours.values_and_jacobian(inputs[0][None], inputs[1][None])
        direction = random.normal(size=len(place.unknowns))
        found = exact.compare(formula, inputs, direction, values[0], jacobian[0])
        value = max(value, (found.value, place.name))
        if found.slope is None:
            singular.append(place.name)
        else:
            slope = max(slope, (found.slope, place.name))
    return AwkwardCheck(ours.name, *value, *slope, tuple(singular))


def places(ours: Calculator, random: np.random.Generator) -> Iterator[Place]:
    """The awkward places of a formula."""
    kernel = ours.kernel
    yield Place("anywhere", *_drawn(kernel, random))
    if points := _points(kernel):
        yield from _aligned(kernel, points, random)
        yield from _together(kernel, points, random)
    yield from _half_turns(ours, random)


def _aligned(kernel: Kernel, points: list[tuple[int, slice]], random: np.random.Generator) -> Iterator[Place]:
    """Points one after the other along an axis of upright frames, exactly and nearly."""
    for axis, (k, sign) in AXES.items():
        for beside in (0.0, BESIDE):
            place = _upright(kernel, *_drawn(kernel, random))
            first = _coordinates(place, points[0])
            for n, point in enumerate(points):
                step = np.zeros(3)
                step[k] = sign * (1.0 + n) * n
                aside = beside * random.normal(size=3) if n else 0.0
                _put(place, point, first + step + aside)
            yield Place(f"near {axis}" if beside else f"along {axis}", *place)


def _together(
    kernel: Kernel, points: list[tuple[int, slice]], random: np.random.Generator
) -> Iterator[Place]:
    """Points at one place, nearly there, and all far away."""
    for name, apart in (("one point", 0.0), ("a micrometre apart", APART)):
        place = _drawn(kernel, random)
        first = _coordinates(place, points[0])
        for point in points:
            _put(place, point, first + apart * random.normal(size=3))
        yield Place(name, *place)
    place = _drawn(kernel, random)
    solid = [point for point in points if point[1].stop - point[1].start == len(FAR)]
    for point in solid:
        _put(place, point, _coordinates(place, point) + FAR)
    if solid:
        yield Place("far coordinates", *place)


def _half_turns(ours: Calculator, random: np.random.Generator) -> Iterator[Place]:
    """A measured angle a half turn from what is computed, on either side."""
    angles = [given.start for given in ours.kernel.inputs if given.unit == "rad"]
    if not angles or len(ours.residuals) != 1:
        return
    for sign in (1.0, -1.0):
        unknowns, observations = _drawn(ours.kernel, random)
        residual = float(ours.values(unknowns[None], observations[None])[0, 0])
        observations[angles[0]] += residual - sign * (math.pi - HALF_TURN)
        yield Place("half turn", unknowns, observations)


def _drawn(kernel: Kernel, random: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    unknowns, observations = draw(kernel, 1, random)
    return unknowns[0], observations[0]


def _points(kernel: Kernel) -> list[tuple[int, slice]]:
    """The points of a formula in space or in a plane: 0 for unknowns, 1 for observations, and where."""
    found = [
        (0, slice(block.start, block.start + block.size))
        for block in kernel.blocks
        if block.kind == "Point3" or (block.kind == "Point2" and not block.unit)
    ]
    given = [one for one in kernel.inputs if one.kind == "Point3" and one.unit == "m"]
    return found + [(1, slice(one.start, one.start + one.size)) for one in given]


def _coordinates(place: tuple[FloatArray, FloatArray], point: tuple[int, slice]) -> FloatArray:
    """The three coordinates of a point; 0 for a height that it has not."""
    found = np.zeros(3)
    plain = place[point[0]][point[1]]
    found[: len(plain)] = plain
    return found


def _put(place: tuple[FloatArray, FloatArray], point: tuple[int, slice], coordinates: FloatArray) -> None:
    room = place[point[0]][point[1]]
    room[:] = coordinates[: len(room)]


def _upright(kernel: Kernel, unknowns: FloatArray, observations: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same with all frames along the axes."""
    for block in kernel.blocks:
        if block.context and block.context[1] - block.context[0] == FRAME:
            unknowns[block.start : block.start + block.size] = 0.0
            observations[slice(*block.context)] = np.eye(3).ravel()
    return unknowns, observations
