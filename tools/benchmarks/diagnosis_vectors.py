"""Random networks of GNSS vectors in two sessions on the Earth, and what goes wrong with these."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import make_network as simulated
import numpy as np
from diagnosis_networks import LENGTH, Reading, Survey, apart
from diagnosis_verdicts import Fault

from obseq.crs import Transformer, parse

if TYPE_CHECKING:
    from collections.abc import Callable

    from diagnosis_networks import FloatArray, Planted, Random
    from diagnosis_verdicts import Line

ZONE, OTHER_ZONE = "EPSG:32631", "EPSG:32632"
COMPONENTS = 107, 108, 109
NAMES = dict(zip(COMPONENTS, ("VX", "VY", "VZ"), strict=True))


class Vectors(Survey):
    """A network of vectors, in tables."""

    def texts(self) -> dict[str, str]:
        """The files."""
        sigmas = (",".join(["0.002" * (name in self.known)] * 3) for name in self.coordinates)
        rows = zip(self.coordinates.items(), sigmas, strict=True)
        points = [f"{name},{x:.4f},{y:.4f},{z:.4f},{own}" for (name, (x, y, z)), own in rows]
        found = {"points.csv": "\n".join(["name,x,y,z,sx,sy,sz", *points, ""])}
        for one in self.readings:
            text = found.setdefault(self._name(one), "type,from,to,value,sigma\n")
            line = f"{NAMES[one.code]},{one.origin},{one.target},{one.value:.4f},{one.sigma:g}\n"
            found[self._name(one)] = text + line
        return found

    def place(self, row: int) -> Line:
        """File and line of a component, below the line of names."""
        name, line = super().place(row)
        return name, line + 1

    @staticmethod
    def _name(reading: Reading) -> str:
        return f"day{reading.file + 1}.csv"


def vectors(random: Random) -> Survey:
    """Six to nine points, each of which begins some vectors in both files; 4 or 5 are known."""
    n, size = int(random.integers(6, 10)), float(random.uniform(1000.0, 5000.0))
    true = apart(n, size, size / 10.0, random, 200.0)
    names = [f"P{k}" for k in range(n)]
    turn, _ = parse(simulated.FRAME).geocentric_pose()
    readings = []
    for file in (0, 1):
        for origin in random.permutation(n)[: n - 2].tolist():
            others = [k for k in random.permutation(n).tolist() if k != origin]
            for target in others[: int(random.integers(2, 4))]:
                exact = turn @ (true[target] - true[origin])
                values = exact + LENGTH * random.normal(0.0, 1.0, 3)
                readings += [
                    Reading(file, -1, code, names[origin], names[target], float(value), LENGTH)
                    for code, value in zip(COMPONENTS, values, strict=True)
                ]
    known = names[: int(random.integers(4, 6))]
    listed = simulated.in_system(true, ZONE)
    noise = np.where(np.isin(names, known)[:, None], 0.002, 0.3) * random.normal(0.0, 1.0, true.shape)
    coordinates = {name: tuple(row) for name, row in zip(names, (listed + noise).tolist(), strict=True)}
    options = {"frame": simulated.FRAME, "points_crs": ZONE}
    return Vectors(tuple(readings), coordinates, tuple(known), options)


def _vector(survey: Survey, random: Random) -> list[int]:
    """The components of one vector."""
    first = 3 * int(random.integers(len(survey.readings) // 3))
    return [first, first + 1, first + 2]


def turned(survey: Survey, random: Random) -> Planted:
    """The ends of a vector exchanged."""
    rows = _vector(survey, random)
    made = survey.changed(rows, lambda one: replace(one, origin=one.target, target=one.origin))
    return made, (Fault(survey.places(rows), causes=frozenset({"W134"})),)


def of_another(survey: Survey, random: Random) -> Planted:
    """A vector that goes to another point than its name says."""
    rows = _vector(survey, random)
    own = survey.readings[rows[0]]
    other = str(random.choice(sorted(set(survey.coordinates) - {own.origin, own.target})))
    made = survey.changed(rows, lambda one: replace(one, target=other))
    return made, (Fault(survey.places(rows), causes=frozenset({"W118"})),)


def _session(survey: Survey, random: Random) -> list[int]:
    """All vectors that begin at a point in a file; as many others, or more, begin there in the other."""
    origins = {one.origin for one in survey.readings if one.file == 1}
    both = sorted(origins & {one.origin for one in survey.readings if one.file == 0})
    return survey.rows(*COMPONENTS, file=1, origin=str(random.choice(both)))


def _moved(survey: Survey, rows: list[int], by: FloatArray) -> Survey:
    """The same with something added to some vectors: metres east, north and up at their first point."""
    frame, system = parse(simulated.FRAME), parse(ZONE)
    place = Transformer(system, frame).forward(
        np.array([survey.coordinates[survey.readings[rows[0]].origin]])
    )
    along = frame.geocentric_pose()[0] @ frame.vertical_rotation(place)[0].T @ by
    return survey.changed(
        rows, lambda one: replace(one, value=one.value + float(along[one.code - COMPONENTS[0]]))
    )


def antenna(survey: Survey, random: Random) -> Planted:
    """The height of an antenna wrong by 5 to 50 cm, in all vectors from there in a session."""
    rows = _session(survey, random)
    by = float(random.uniform(0.05, 0.5) * random.choice([-1.0, 1.0]))
    made = _moved(survey, rows, np.array([0.0, 0.0, by]))
    return made, (Fault(survey.places(rows), causes=frozenset({"S171"})),)


def beside(survey: Survey, random: Random) -> Planted:
    """An antenna 5 to 50 cm beside its mark, in all vectors from there in a session."""
    rows, angle = _session(survey, random), random.uniform(0.0, 2.0 * np.pi)
    by = float(random.uniform(0.05, 0.5)) * np.array([np.sin(angle), np.cos(angle), 0.0])
    return _moved(survey, rows, by), (Fault(survey.places(rows), causes=frozenset({"S172"})),)


def _listed(survey: Survey, change: Callable[[FloatArray], FloatArray]) -> Survey:
    places = np.array(list(survey.coordinates.values()))
    changed = map(tuple, change(places).tolist())
    return replace(survey, coordinates=dict(zip(survey.coordinates, changed, strict=True)))


def geoid(survey: Survey, random: Random) -> Planted:
    """Levelled heights: without the geoid's, which have a slope of 10 to 60 mm/km."""
    slope, angle = random.uniform(1e-5, 6e-5), random.uniform(0.0, 2.0 * np.pi)
    gradient = slope * np.array([np.sin(angle), np.cos(angle)])

    def lowered(places: FloatArray) -> FloatArray:
        rise = 45.0 + (places[:, :2] - places[:, :2].mean(axis=0)) @ gradient
        return np.column_stack([places[:, :2], places[:, 2] - rise])

    fault = Fault(codes=frozenset({"S114"}), causes=frozenset({"S114"}))
    return _listed(survey, lowered), (fault,)


def zone(survey: Survey, random: Random) -> Planted:
    """Coordinates of the next zone of UTM."""
    into = Transformer(parse(ZONE), parse(OTHER_ZONE))
    codes = frozenset({"S213", "S116"})
    return _listed(survey, into.forward), (Fault(codes=codes, causes=codes),)


def ground(survey: Survey, random: Random) -> Planted:
    """Known points on a scale of their own, 50 to 400 ppm off."""
    factor = 1.0 + float(random.uniform(5e-5, 4e-4) * random.choice([-1.0, 1.0]))

    def scaled(places: FloatArray) -> FloatArray:
        centre = places.mean(axis=0)
        return np.asarray(centre + (places - centre) * [factor, factor, 1.0])

    fault = Fault(codes=frozenset({"S115"}), causes=frozenset({"S115"}))
    return _listed(survey, scaled), (fault,)


SLIPS: dict[str, Callable[[Survey, Random], Planted | None]] = {
    "exchanged ends": turned,
    "another point": of_another,
    "antenna height": antenna,
    "antenna beside": beside,
    "geoid heights": geoid,
    "zone": zone,
    "ground scale": ground,
}
