"""Random surveys: mixed networks with planted blunders, and sites for slips.

Mixed networks lie on the Earth, 50 m to 3 km wide, and have directions, zenith angles, distances, height
differences and components. Their blunders are of so many detectable sigmas: f sigma / sqrt(r).
Sites are of total stations, in a plane, in two files; refraction cancels the curvature that a plane lacks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import make_network as simulated
import numpy as np
from diagnosis_verdicts import Fault, Line

from obseq.crs import parse

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

Random = np.random.Generator

GON = np.pi / 200.0
HZ, ZEN, DIST, DH, DX = 5, 6, 3, 4, 14
FIRST = 7
"""Code of the direction that begins a set-up."""
LENGTH = 0.003
"""Sigma of lengths and of components, m."""
ANGLES = HZ, ZEN
CONTROLLED = 0.1
"""Redundancy number from which an observation may get a blunder: others see it."""
MOST_TURN = 0.5 / GON
"""Gon that a blunder turns an angle, at most: beyond, it comes round."""


@dataclass(frozen=True)
class Reading:
    """A line of an OBS file; angles in gon."""

    file: int
    setup: int
    code: int
    origin: str
    target: str
    value: float
    sigma: float
    relative: float = 0.0
    origin_height: float = 0.0
    target_height: float = 0.0

    def line(self, opens: bool) -> str:
        """As it is written; with code 7 where a direction opens its set-up."""
        code = FIRST if opens else self.code
        heights = f"{self.relative:g} {self.origin_height:.3f} {self.target_height:.3f}"
        decimals = 5 if self.code in ANGLES else 4
        return f"{code} {self.origin} {self.target} {self.value:.{decimals}f} {self.sigma:.6g} {heights}"


@dataclass(frozen=True)
class Survey:
    """A network as its files have it.

    Attributes:
        readings: in the order of the files.
        coordinates: of all points, as the COR file gives them.
        known: names of those that are known.
        options: of `Network.read`.
    """

    readings: tuple[Reading, ...]
    coordinates: Mapping[str, tuple[float, float, float]]
    known: tuple[str, ...]
    options: Mapping[str, object]

    def texts(self) -> dict[str, str]:
        """The files."""
        found: dict[str, list[str]] = {self._name(reading): [] for reading in self.readings}
        opened: set[int] = set()
        for reading in self.readings:
            opens = reading.code == HZ and reading.setup not in opened
            opened |= {reading.setup} if opens else set()
            found[self._name(reading)].append(reading.line(opens))
        found["site.cor"] = [
            f"{int(name in self.known)} {name} {x:.4f} {y:.4f} {z:.4f}"
            + (" 0.002 0.002 0.002" if name in self.known else "")
            for name, (x, y, z) in self.coordinates.items()
        ]
        return {name: "\n".join(lines) + "\n" for name, lines in found.items()}

    def place(self, row: int) -> Line:
        """File and line of a reading."""
        own = self._name(self.readings[row])
        return own, sum(self._name(reading) == own for reading in self.readings[: row + 1])

    def places(self, rows: list[int]) -> frozenset[Line]:
        """Files and lines of readings."""
        return frozenset(map(self.place, rows))

    def rows(self, *codes: int, **attributes: object) -> list[int]:
        """Readings with some of the codes and attributes."""
        wanted = attributes.items()
        return [
            row
            for row, reading in enumerate(self.readings)
            if reading.code in codes and all(getattr(reading, name) == value for name, value in wanted)
        ]

    def changed(self, rows: list[int], change: Callable[[Reading], Reading]) -> Survey:
        """The same with some readings changed."""
        made = list(self.readings)
        for row in rows:
            made[row] = change(made[row])
        return replace(self, readings=tuple(made))

    def scaled(self, rows: list[int], factor: float) -> Survey:
        """The same with some values multiplied."""
        return self.changed(rows, lambda reading: replace(reading, value=reading.value * factor))

    def shifted(self, rows: list[int], by: float) -> Survey:
        """The same with something added to some values; directions stay in their circle."""
        return self.changed(rows, lambda reading: replace(reading, value=_turned(reading, by)))

    @staticmethod
    def _name(reading: Reading) -> str:
        return f"day{reading.file + 1}.obs"


def _turned(reading: Reading, by: float) -> float:
    return (reading.value + by) % 400.0 if reading.code == HZ else reading.value + by


Planted = tuple[Survey, tuple[Fault, ...]]


EARTH = {"frame": simulated.FRAME, "points_crs": simulated.PLANE}


def mixed(random: Random) -> Survey:
    """A network of 5 to 9 points with all usual observations, on the Earth."""
    n, size = int(random.integers(5, 10)), 10.0 ** random.uniform(1.7, 3.5)
    true = apart(n, size, size / 12.0, random, min(size / 10.0, 300.0))
    listed = simulated.in_system(true, simulated.PLANE)
    names = [f"P{k}" for k in range(n)]
    readings: list[Reading] = []
    for setup, station in enumerate(random.permutation(n)[: int(random.integers(3, n))].tolist()):
        others = [k for k in random.permutation(n).tolist() if k != station]
        readings += _round(true, setup, station, others[: int(random.integers(4, n))], random)
    for _ in range(int(random.integers(2, 5))):
        a, b = random.choice(n, 2, replace=False).tolist()
        value = float(listed[b, 2] - listed[a, 2] + random.normal(0.0, LENGTH))
        readings.append(Reading(0, -1, DH, names[a], names[b], value, LENGTH))
    known = names[: int(random.integers(2, 4))]
    noise = np.where(np.isin(names, known)[:, None], 0.002, 0.3) * random.normal(0.0, 1.0, true.shape)
    coordinates = {name: tuple(row) for name, row in zip(names, (listed + noise).tolist(), strict=True)}
    return Survey(tuple(readings), coordinates, tuple(known), dict(EARTH))


def apart(n: int, size: float, least: float, random: Random, high: float) -> FloatArray:
    """Points of a square, none too near to another."""
    while True:
        plan = random.uniform(-size / 2.0, size / 2.0, (n, 2))
        if (np.linalg.norm(plan[:, None] - plan[None], axis=2) + np.eye(n) * size).min() > least:
            return np.column_stack([plan, 100.0 + random.uniform(0.0, high, n)])


def _round(true: FloatArray, setup: int, station: int, targets: list[int], random: Random) -> list[Reading]:
    """Direction, zenith angle and distance to each target, and components to the last."""
    pairs = np.array([(station, target) for target in targets], np.int32)
    exact = simulated.exact_values(true, pairs, np.full(len(pairs), random.uniform(-np.pi, np.pi)))
    vertical = parse(simulated.FRAME).vertical_rotation(true)[station]
    east, north, up = vertical @ (true[targets[-1]] - true[station])
    level = np.hypot(east, north)
    components = level * np.sin(exact[-1, 0]), level * np.cos(exact[-1, 0]), up
    made = [
        (target, code, float(value), sigma)
        for target, row in zip(targets, exact, strict=True)
        for code, value, sigma in zip((HZ, ZEN, DIST), row, (1.5e-5, 2.5e-5, LENGTH), strict=True)
    ]
    made += [(targets[-1], DX + k, float(value), LENGTH) for k, value in enumerate(components)]
    return [
        _written(setup, code, (f"P{station}", f"P{target}"), value + sigma * random.normal(), sigma)
        for target, code, value, sigma in made
    ]


def _written(setup: int, code: int, ends: tuple[str, str], value: float, sigma: float) -> Reading:
    """A reading, its value and sigma in m or rad."""
    unit = GON if code in ANGLES else 1.0
    turned = value / unit % 400.0 if code == HZ else value / unit
    return Reading(0, setup, code, *ends, float(turned), sigma / unit)


def site(random: Random, rounds: int = 1) -> Survey:
    """Five to seven set-ups of a total station on 8 to 14 points, in two files; no line is wrong.

    Args:
        random: what is drawn from.
        rounds: how often each sight is read.
    """
    n, size = int(random.integers(8, 15)), float(random.uniform(120.0, 500.0))
    true = apart(n, size, 12.0, random, 0.0) + np.array([1000.0, 2000.0, 0.0])
    true[:, 2] += random.normal(0.0, size / 40.0, n)
    names = [f"P{k + 1}" for k in range(n)]
    readings: list[Reading] = []
    stations = random.permutation(n)[: int(random.integers(5, 8))].tolist()
    for file in (0, 1):
        for setup in range(file, len(stations), 2):
            targets = [k for k in random.permutation(n).tolist() if k != stations[setup]]
            readings += _sights(true, (file, setup, stations[setup]), targets, random, rounds)
    known = random.permutation(names)[: int(random.integers(3, 6))].tolist()
    noise = np.where(np.isin(names, known)[:, None], 0.002, 0.3) * random.normal(0.0, 1.0, true.shape)
    coordinates = {name: tuple(row) for name, row in zip(names, (true + noise).tolist(), strict=True)}
    return Survey(tuple(readings), coordinates, tuple(known), {"refraction": 1.0})


def _sights(
    true: FloatArray, setup: tuple[int, int, int], targets: list[int], random: Random, rounds: int
) -> list[Reading]:
    """Direction, zenith angle and distance to five to eight targets; setup: file, number and point."""
    file, number, station = setup
    hi, zero = round(float(random.uniform(1.4, 1.7)), 3), random.uniform(0.0, 400.0)
    readings = []
    for target in targets[: int(random.integers(5, 9))] * rounds:
        ht = float(random.choice([1.3, 1.5, 1.8, 2.15]))
        x, y, z = true[target] - true[station] + [0.0, 0.0, ht - hi]
        length = float(np.linalg.norm([x, y, z]))
        exact = (np.arctan2(x, y) / GON - zero) % 400.0, np.arctan2(np.hypot(x, y), z) / GON, length
        sigmas, parts = (0.0006, 0.001, 0.002), (0.001, 0.001, 2e-6)
        spread = [sigmas[0] + parts[0] / length / GON, sigmas[1] + parts[1] / length / GON]
        values = exact + random.normal(0.0, 1.0, 3) * [*spread, sigmas[2] + parts[2] * length]
        values[0] %= 400.0
        ends = f"P{station + 1}", f"P{target + 1}"
        readings += [
            Reading(file, number, code, *ends, float(values[i]), sigmas[i], parts[i], hi, ht)
            for i, code in enumerate((HZ, ZEN, DIST))
        ]
    return readings


def blunders(
    survey: Survey, random: Random, redundancies: FloatArray, sigmas: FloatArray, count: int, most: float
) -> Planted | None:
    """Wrong values of 5 detectable sigmas and more, log-uniform.

    Args:
        survey: the network without error.
        random: what is drawn from.
        redundancies: (n,) of the readings.
        sigmas: (n,) m or rad.
        count: how many of them are wrong.
        most: detectable sigmas at most; below 5, all are of 8.

    Returns:
        None where there are not so many that others control, or a blunder would be seen when it is read.
    """
    able = np.flatnonzero(redundancies > CONTROLLED)
    if len(able) < count:
        return None
    rows = random.choice(able, count, replace=False).tolist()
    times = 8.0 if most < 5.0 else 5.0 * (most / 5.0) ** random.uniform()
    for row in rows:
        size = times * float(sigmas[row] / np.sqrt(redundancies[row])) * float(random.choice([-1.0, 1.0]))
        by = _shift(survey.readings[row], size, random)
        if by is None:
            return None
        survey = survey.shifted([row], by)
    return survey, tuple(Fault(survey.places([row])) for row in rows)


def _shift(reading: Reading, size: float, random: Random) -> float | None:
    """By how much a blunder (m or rad) moves a reading, in its unit; None where it is seen at once."""
    if reading.code in ANGLES:
        by = size / GON
        by = by if abs(by) < MOST_TURN else float(np.sign(by) * random.uniform(3.0, MOST_TURN))
        return by if reading.code != ZEN or 2.0 < reading.value + by < 198.0 else None
    return abs(size) if reading.code == DIST and reading.value + size < 1.0 else size
