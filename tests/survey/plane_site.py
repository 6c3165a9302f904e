"""A made network of the plane: points of a grid that see their neighbours, with horizontal distances."""

import math
from dataclasses import dataclass, replace

import numpy as np

from obseq.survey import Network, network_from_tables

GON = 200.0 / math.pi
ANGLE, LENGTH = 0.001, 0.002
"""Noise, gon and m."""


@dataclass(frozen=True)
class Row:
    """A row of a table of observations, gon and m."""

    type: str
    origin: str
    target: str
    value: float
    backsight: str = ""

    @property
    def sigma(self) -> float:
        """Of its value."""
        return LENGTH if self.type == "DistHz" else ANGLE


class PlaneSite:
    """Points of a grid, each of which sees its neighbours; the corners, and one within, are known.

    Args:
        columns: points of the grid eastwards.
        rows: and northwards.
        with_angles: horizontal angles from the first target instead of directions.
    """

    def __init__(self, columns: int = 3, rows: int = 3, *, with_angles: bool = False, seed: int = 3) -> None:
        random = np.random.default_rng(seed)
        grid = {f"M{i}{j}": (150.0 * i, 140.0 * j) for i in range(columns) for j in range(rows)}
        self.places = {
            name: np.add(place, (1000.0, 5000.0)) + random.uniform(-25.0, 25.0, 2)
            for name, place in grid.items()
        }
        corners = {f"M{i}{j}" for i in (0, columns - 1) for j in (0, rows - 1)}
        self.known = corners | {f"M{columns // 2}{rows // 2}"}
        self.rows = [row for name in self.places for row in self._seen_from(name, random, with_angles)]

    def _seen_from(self, name: str, random: np.random.Generator, with_angles: bool) -> list[Row]:
        zero, rows, back = random.uniform(0.0, 400.0), [], ""
        for target in self._neighbours(name):
            azimuth, length = self.sight(name, target)
            noisy = azimuth + random.normal(0.0, ANGLE)
            if not with_angles:
                rows.append(Row("Hz", name, target, (noisy - zero) % 400.0))
            elif back:
                rows.append(Row("Angle", name, target, (noisy - self.sight(name, back)[0]) % 400.0, back))
            back = back or target
            rows.append(Row("DistHz", name, target, length + random.normal(0.0, LENGTH)))
        return rows

    def _neighbours(self, name: str) -> list[str]:
        lengths = {other: self.sight(name, other)[1] for other in self.places if other != name}
        return sorted(lengths, key=lengths.__getitem__)[:6]

    def sight(self, origin: str, target: str) -> tuple[float, float]:
        """Azimuth (gon) and length (m) from one point to another."""
        east, north = self.places[target] - self.places[origin]
        return math.atan2(east, north) * GON, math.hypot(east, north)

    def change(self, change, kinds=("Hz", "Angle", "DistHz"), origin: str = "") -> list[int]:
        """Changes rows of some kinds, all of them or those from one point; their numbers."""
        chosen = [
            k for k, row in enumerate(self.rows) if row.type in kinds and (not origin or row.origin == origin)
        ]
        for k in chosen:
            self.rows[k] = change(self.rows[k])
        return chosen

    def change_values(self, change, kinds, origin: str = "") -> list[int]:
        """Changes values of some kinds (gon, m)."""
        return self.change(lambda row: replace(row, value=change(row.value)), kinds, origin)

    def network(self) -> Network:
        """The network of the tables."""
        east, north = np.array(list(self.places.values())).T
        points = {"name": list(self.places), "x": east, "y": north, "z": [0.0] * len(east)}
        points |= {
            axis: [0.002 if name in self.known else None for name in self.places] for axis in ("sx", "sy")
        }
        points["sz"] = [0.0] * len(east)
        columns = {"type": "type", "from": "origin", "to": "target", "value": "value", "sigma": "sigma"}
        rows = {name: [getattr(row, field) for row in self.rows] for name, field in columns.items()}
        if any(row.backsight for row in self.rows):
            rows["backsight"] = [row.backsight for row in self.rows]
        return network_from_tables(points, rows, angles="gon")
