"""Survey networks whose observations get errors, and their designs, for bench_snooping."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from obseq.cached import cached_property
from obseq.survey import Network, Quality, network_from_tables
from obseq.survey.model import Cluster
from obseq.survey.planning.simulation import Simulation, with_values

if TYPE_CHECKING:
    from obseq.survey.adjustment.adjusted import Adjustment

FloatArray = npt.NDArray[np.float64]
OVERALL = 0.05
PLACES = {
    "K1": (0.0, 0.0, 0.0),
    "K2": (120.0, 5.0, 4.0),
    "A": (60.0, 90.0, 6.0),
    "B": (15.0, 65.0, 1.0),
    "C": (100.0, 60.0, -3.0),
    "D": (55.0, 30.0, 8.0),
}
KNOWN = ("K1", "K2")
STATIONS = ("K1", "A", "B", "C")
SIGMAS = {"Hz": 5e-6, "Zen": 1e-5, "Dist": 0.001}
STEP = 1e-3


@dataclass(frozen=True, eq=False)
class Surveyed:
    """A network that is adjusted as surveys are.

    Attributes:
        network: Its points and exact observations.
        design: (n, u) derivatives of the observations.
        covariance: (n, n) of the observations.
    """

    network: Network
    design: FloatArray
    covariance: FloatArray

    @cached_property
    def _simulation(self) -> Simulation:
        return Simulation(self.network)

    def adjusted(self, errors: FloatArray, quality: Quality) -> Adjustment:
        """The network with these errors (n,) of its observations, adjusted."""
        changed = with_values(self.network, self._simulation.exact + errors)
        return changed.adjust(start=self._simulation.truth, quality=quality)

    def standardised(self, errors: FloatArray) -> FloatArray:
        """(n,) standardised residuals of observations with these errors (n,)."""
        numbers = self.adjusted(errors, Quality()).quality.observations
        assert numbers is not None
        return numbers.standardised

    def snooped(self, errors: FloatArray) -> list[int]:
        """Rows of observations with these errors (n,) that snooping leaves out, the first first."""
        found = self.adjusted(errors, Quality(snooping="w", snooping_level=OVERALL)).quality.snooping
        assert found is not None
        return [item.row for item in found.rejections]


def terrestrial() -> Surveyed:
    """Directions, zenith angles and distances from four instruments to all other points."""
    rows = [(kind, a, b) for a in STATIONS for b in PLACES if b != a for kind in SIGMAS]
    sigmas = np.array([SIGMAS[kind] for kind, _, _ in rows])
    network = _network(rows, sigmas.tolist())
    unknown = [name for name in PLACES if name not in KNOWN]
    design = np.zeros((len(rows), 3 * len(unknown) + len(STATIONS)))
    for row, (kind, a, b) in enumerate(rows):
        for name, sign in ((a, -1.0), (b, 1.0)):
            if name in unknown:
                at = 3 * unknown.index(name)
                design[row, at : at + 3] = sign * _slopes(kind, np.subtract(PLACES[b], PLACES[a]))
        if kind == "Hz":
            design[row, 3 * len(unknown) + STATIONS.index(a)] = -1.0
    return Surveyed(network, design, np.diag(sigmas**2))


def vectors() -> Surveyed:
    """GNSS vectors between all points, the components of each correlated."""
    names = list(PLACES)
    pairs = [(a, b) for k, a in enumerate(names) for b in names[k + 1 :]]
    rows = [(f"V{axis}", a, b) for a, b in pairs for axis in "XYZ"]
    shape = np.array([[9.0, 2.0, 3.0], [2.0, 4.0, 1.0], [3.0, 1.0, 6.0]]) * 1e-6
    network = _network(rows, np.tile(np.sqrt(np.diag(shape)), len(pairs)).tolist(), "GeoC")
    clusters = tuple(Cluster(np.arange(3 * k, 3 * k + 3, dtype=np.int64), shape) for k in range(len(pairs)))
    network = replace(network, book=replace(network.book, clusters=clusters))
    unknown = [name for name in names if name not in KNOWN]
    ends = np.array([[float(n == b) - float(n == a) for n in unknown] for a, b in pairs])
    return Surveyed(network, np.kron(ends, np.eye(3)), np.kron(np.eye(len(pairs)), shape))


def _network(rows: list[tuple[str, str, str]], sigmas: list[float], frame: str = "Local") -> Network:
    """The network with exact observations; known points are held."""
    shift = (4_200_000.0, 170_000.0, 4_780_000.0) if frame == "GeoC" else (0.0, 0.0, 0.0)
    points: dict[str, list[object]] = {"name": list(PLACES)}
    for axis, column in enumerate("xyz"):
        points[column] = [place[axis] + shift[axis] for place in PLACES.values()]
        points[f"s{column}"] = [0.0 if name in KNOWN else None for name in PLACES]
    kinds, starts, ends = (list(part) for part in zip(*rows, strict=True))
    values = [1.0] * len(rows)
    table = {"type": kinds, "from": starts, "to": ends, "value": values, "sigma": sigmas}
    return Simulation(network_from_tables(points, table, frame=frame)).without_errors()


def _slopes(kind: str, sight: FloatArray) -> FloatArray:
    """(3,) derivatives of an observation with respect to its target, by central differences."""
    moved = [_value(kind, sight + step) - _value(kind, sight - step) for step in STEP * np.eye(3)]
    return np.array(moved) / (2.0 * STEP)


def _value(kind: str, sight: FloatArray) -> float:
    if kind == "Dist":
        return float(np.linalg.norm(sight))
    if kind == "Hz":
        return float(np.arctan2(sight[0], sight[1]))
    return float(np.arctan2(np.hypot(sight[0], sight[1]), sight[2]))
