"""Made set-ups, as lines of an OBS file that tests spoil: directions, zenith angles and slope distances."""

import math
from dataclasses import dataclass, replace

import numpy as np

from obseq.survey import Network

GON = 200.0 / math.pi
ANGLE, LENGTH = 0.001, 0.003
"""Noise, gon and m."""


@dataclass(frozen=True)
class Line:
    """A line of an OBS file."""

    code: str
    origin: str
    target: str
    value: float
    instrument: float
    prism: float

    @property
    def text(self):
        sigma = LENGTH if self.code == "3" else ANGLE
        heights = f"0 {self.instrument:.3f} {self.prism:.3f}"
        return f"{self.code} {self.origin} {self.target} {self.value:.5f} {sigma} {heights}"


class Site:
    """Points, and set-ups that see some of them.

    Args:
        places: of all points.
        sights: what is seen from each point that carries a set-up.
        known: names of the known points.
        approximate: names of points with approximate coordinates in the file.
    """

    def __init__(self, places, sights, known, approximate=()):
        random = np.random.default_rng(5)
        self.places, self.known, self.approximate = dict(places), known, approximate
        self.lines = []
        for origin, targets in sights.items():
            zero, instrument = random.uniform(0.0, 400.0), round(random.uniform(1.4, 1.7), 3)
            for k, target in enumerate(targets):
                self.lines += self._sight(random, origin, target, zero, instrument, "5" if k else "7")

    def _sight(self, random, origin, target, zero, instrument, code):
        prism = round(random.uniform(1.3, 1.7), 3)
        east, north, up = np.subtract(self.places[target], self.places[origin])
        up += prism - instrument
        hz, zenith = math.atan2(east, north) * GON - zero, math.atan2(math.hypot(east, north), up) * GON
        hz, zenith = hz + random.normal(0.0, ANGLE), zenith + random.normal(0.0, ANGLE)
        length = math.hypot(east, north, up) + random.normal(0.0, LENGTH)
        for kind, value in ((code, hz % 400.0), ("6", zenith), ("3", length)):
            yield Line(kind, origin, target, value, instrument, prism)

    def change(self, change, codes="3567", **where):
        """Changes the lines that have these fields; their numbers in the file."""
        changed = [
            k
            for k, line in enumerate(self.lines)
            if line.code in codes and all(getattr(line, field) in wanted for field, wanted in where.items())
        ]
        assert changed
        for k in changed:
            self.lines[k] = replace(self.lines[k], **change(self.lines[k]))
        return {k + 1 for k in changed}

    def exchange(self, one, other, **where):
        """Exchanges the names of two targets."""
        names = {one: other, other: one}
        return self.change(lambda line: {"target": names[line.target]}, target=tuple(names), **where)

    def network(self, folder):
        points = [f"1 {name} {' '.join(map(str, self.places[name]))} 0.002" for name in self.known]
        points += [
            f"0 {name} {' '.join(f'{value + 0.3:.1f}' for value in self.places[name])}"
            for name in self.approximate
        ]
        (folder / "s.obs").write_text("\n".join(line.text for line in self.lines))
        (folder / "s.cor").write_text("\n".join(points))
        return Network.read(folder / "s.obs", folder / "s.cor")

    def errors(self, folder):
        """What is found, and the lines of the file that each concerns."""
        network = self.network(folder)
        return [
            (error, {int(network.book.observations.lines[row]) for row in error.rows})
            for error in network.gross_errors()
        ]


def free_stations(stations=("F1", "F2", "F3")):
    """Free stations that see the same known and new points."""
    places = {f"C{k}": place for k, place in enumerate(((0, 0, 4), (100, -5, 2), (110, 60, 3), (55, 110, 7)))}
    places |= {"F1": (20.0, 30.0, 0.5), "F2": (70.0, 35.0, 0.7), "F3": (45.0, 80.0, 0.2)}
    places |= {"E0": (80.0, 23.0, 2.0), "E1": (58.0, 20.0, 5.0), "E2": (21.0, 77.0, 4.0)}
    seen = [name for name in places if name[0] != "F"]
    places = {name: place for name, place in places.items() if name[0] != "F" or name in stations}
    return Site(places, dict.fromkeys(stations, seen), ("C0", "C1", "C2", "C3"), stations)


def traverse():
    """A traverse between two pairs of known points."""
    places = {"A": (1000, 1000, 100), "B": (1180, 1020, 103), "C": (2100, 1400, 110), "D": (2150, 1580, 112)}
    ups = (106.5, 103.3, 104.1, 104.4, 99.2)
    turns = (-8, 17, -22, -5, 22)
    places |= {f"T{k + 1}": (1330 + 150 * k, 1082 + 62 * k + turns[k], ups[k]) for k in range(5)}
    way = ("A", "B", "T1", "T2", "T3", "T4", "T5", "C", "D")
    sights = {here: (back, there) for back, here, there in zip(way, way[1:], way[2:], strict=False)}
    return Site(places, sights, ("A", "B", "C", "D"))


def resection():
    """One set-up, at the origin of coordinates, that sees known and new points around it."""
    places = {"K1": (120.0, 5.5, 11.0), "K2": (32.1, 104.1, 15.4), "K3": (-102.8, 48.6, 5.4)}
    places |= {"K4": (-87.1, -73.3, 17.5), "K5": (56.2, -100.0, 11.9), "P": (0.0, 0.0, 9.9)}
    places |= {"N1": (-35.1, 30.2, 14.0), "N2": (38.9, 48.9, 14.1)}
    return Site(places, {"P": [name for name in places if name != "P"]}, ("K1", "K2", "K3", "K4", "K5"))
