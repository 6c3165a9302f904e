"""Slips as people make them, planted in the survey of a site: one function for each kind."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from diagnosis_networks import DIST, GON, HZ, ZEN
from diagnosis_verdicts import Fault

if TYPE_CHECKING:
    from collections.abc import Callable

    from diagnosis_networks import Planted, Random, Survey

PRISMS = 0.0344, 0.030, 0.0175


def _some(rows: list[int], random: Random) -> list[int]:
    return [int(random.choice(rows))]


def _setup(survey: Survey, random: Random) -> int:
    return int(random.choice([reading.setup for reading in survey.readings]))


def _one(survey: Survey, changed: Survey, rows: list[int], *causes: str) -> Planted:
    return changed, (Fault(survey.places(rows), causes=frozenset(causes)),)


def degrees(survey: Survey, random: Random, *, is_short: bool) -> Planted | None:
    """A zenith angle in degrees, of a sight below 60 m or above."""
    lengths = {(r.setup, r.target): r.value for r in survey.readings if r.code == DIST}
    rows = [
        row
        for row in survey.rows(ZEN)
        if (lengths[survey.readings[row].setup, survey.readings[row].target] < 60.0) == is_short
    ]
    if not rows:
        return None
    chosen = _some(rows, random)
    return _one(survey, survey.scaled(chosen, 0.9), chosen, "W100", "units")


def degrees_long(survey: Survey, random: Random) -> Planted | None:
    """A zenith angle in degrees, of a sight of 60 m or more."""
    return degrees(survey, random, is_short=False)


def degrees_short(survey: Survey, random: Random) -> Planted | None:
    """A zenith angle in degrees, of a sight below 60 m."""
    return degrees(survey, random, is_short=True)


def elevation(survey: Survey, random: Random) -> Planted:
    """An elevation written for a zenith angle."""
    chosen = _some(survey.rows(ZEN), random)
    made = survey.changed(chosen, lambda reading: replace(reading, value=100.0 - reading.value))
    return _one(survey, made, chosen, "W103", "elevation for zenith angle")


def face(survey: Survey, random: Random) -> Planted:
    """A direction read in the other face."""
    chosen = _some(survey.rows(HZ), random)
    return _one(survey, survey.shifted(chosen, 200.0), chosen, "W102", "sense or sign", "mistyped")


def feet(survey: Survey, random: Random) -> Planted:
    """A distance in feet."""
    chosen = _some(survey.rows(DIST), random)
    return _one(survey, survey.scaled(chosen, 1.0 / 0.3048), chosen, "W106", "units")


def digit(survey: Survey, random: Random) -> Planted:
    """One digit of a distance, 5 cm off or more."""
    chosen = _some(survey.rows(DIST), random)
    value = survey.readings[chosen[0]].value
    unit = float(random.choice([unit for unit in (0.1, 1.0, 10.0, 100.0) if unit < value]))
    old = int(value / unit + 1e-9) % 10
    new = int(random.choice([k for k in range(10) if k != old and value + (k - old) * unit > 2.0]))
    return _one(survey, survey.shifted(chosen, (new - old) * unit), chosen, "W109", "mistyped")


def target(survey: Survey, random: Random) -> Planted | None:
    """All readings of one sight under the name of another point."""
    setup = _setup(survey, random)
    own = [reading for reading in survey.readings if reading.setup == setup]
    free = sorted(set(survey.coordinates) - {reading.target for reading in own} - {own[0].origin})
    if not free:
        return None
    name, other = str(random.choice([reading.target for reading in own])), str(random.choice(free))
    rows = survey.rows(HZ, ZEN, DIST, setup=setup, target=name)
    made = survey.changed(rows, lambda reading: replace(reading, target=other))
    return _one(survey, made, rows, "W118", "wrong point", "names swapped")


def circle(survey: Survey, random: Random) -> Planted | None:
    """A circle that turned in the middle of a set-up."""
    rows = survey.rows(HZ, setup=_setup(survey, random))
    if len(rows) < 5:
        return None
    at = int(random.integers(2, len(rows) - 2))
    turn = float(random.uniform(0.05, 100.0) * random.choice([-1.0, 1.0]))
    made, (fault,) = _one(survey, survey.shifted(rows[at:], turn), rows[at:], "S120", "new set-up")
    return made, (replace(fault, alike=(survey.places(rows[:at]),)),)


def height(survey: Survey, random: Random) -> Planted:
    """The height of an instrument left out."""
    setup = _setup(survey, random)
    rows = survey.rows(HZ, ZEN, DIST, setup=setup)
    made = survey.changed(rows, lambda reading: replace(reading, origin_height=0.0))
    return _one(survey, made, survey.rows(ZEN, DIST, setup=setup), "W114", "height of instrument or target")


def constant(survey: Survey, random: Random) -> Planted:
    """A constant on the distances of the second file."""
    rows = survey.rows(DIST, file=1)
    by = float(random.choice(PRISMS) * random.choice([-1.0, 1.0]))
    return _one(survey, survey.shifted(rows, by), rows, "S150", "constant or scale of distances")


def eccentric(survey: Survey, random: Random) -> Planted:
    """An instrument 5 to 50 cm beside its mark."""
    setup, angle = _setup(survey, random), random.uniform(0.0, 2.0 * np.pi)
    shift = float(random.uniform(0.05, 0.5)) * np.array([np.sin(angle), np.cos(angle), 0.0])
    rows = survey.rows(HZ, ZEN, DIST, setup=setup)
    made = list(survey.readings)
    for first in rows[::3]:
        hz, zenith, length = (made[first + k].value for k in range(3))
        a, z = hz * GON, zenith * GON
        sight = length * np.array([np.sin(z) * np.sin(a), np.sin(z) * np.cos(a), np.cos(z)]) - shift
        flat = np.hypot(*sight[:2])
        values = np.arctan2(*sight[:2]) / GON % 400.0, np.arctan2(flat, sight[2]) / GON, np.linalg.norm(sight)
        for k, value in enumerate(values):
            made[first + k] = replace(made[first + k], value=float(value))
    return _one(survey, replace(survey, readings=tuple(made)), rows, "S162")


def feet_of_known(survey: Survey, random: Random) -> Planted:
    """All coordinates in feet."""
    listed = {name: tuple(part / 0.3048 for part in xyz) for name, xyz in survey.coordinates.items()}
    codes = frozenset({"S212"})
    return replace(survey, coordinates=listed), (Fault(codes=codes, causes=codes),)


def below_a_sigma(survey: Survey, random: Random) -> Planted:
    """A constant of at most a sigma on all distances: within what sigmas announce."""
    rows = survey.rows(DIST)
    by = float(random.uniform(0.8, 1.0) * random.choice([-1.0, 1.0])) * survey.readings[rows[0]].sigma
    return survey.shifted(rows, by), ()


def scale(survey: Survey, random: Random) -> Planted:
    """A scale on the distances of the second file."""
    rows = survey.rows(DIST, file=1)
    factor = 1.0 + float(random.uniform(150e-6, 600e-6) * random.choice([-1.0, 1.0]))
    return _one(survey, survey.scaled(rows, factor), rows, "S151", "constant or scale of distances")


def known(survey: Survey, random: Random) -> Planted:
    """One digit of a known coordinate, of centimetres or of metres."""
    name, axis = str(random.choice(survey.known)), int(random.integers(3))
    given = list(survey.coordinates[name])
    unit = float(random.choice([0.1, 10.0]))
    old = int(given[axis] / unit + 1e-9) % 10
    given[axis] += unit * (int(random.choice([k for k in range(10) if k != old])) - old)
    made = replace(survey, coordinates={**survey.coordinates, name: tuple(given)})
    return made, (Fault(points=frozenset({f"{name} {'xyz'[axis]}"}), causes=frozenset({"W109", "mistyped"})),)


SLIPS: dict[str, Callable[[Survey, Random], Planted | None]] = {
    "degrees, long sights": degrees_long,
    "degrees, short sights": degrees_short,
    "elevation": elevation,
    "other face": face,
    "feet": feet,
    "one digit": digit,
    "target": target,
    "circle": circle,
    "height left out": height,
    "constant of a file": constant,
    "scale of a file": scale,
    "known coordinate": known,
    "eccentric set-up": eccentric,
    "coordinates in feet": feet_of_known,
}
