"""The least-squares system of a survey network: unknowns of points and stations, one batch per type."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares import LeastSquares
from obseq.survey.model import ObservationType, Orientation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from obseq.arrays import FloatArray, IntArray
    from obseq.leastsquares import Batch, LeastSquaresResult
    from obseq.survey.adjustment.frame import Frame
    from obseq.survey.model import FieldBook, Points


FORMULAS = {
    ObservationType.Dist: "TopoDist",
    ObservationType.DH: "TopoDH",
    ObservationType.Hz: "TopoHz",
    ObservationType.Zen: "TopoZen",
    ObservationType.DX: "TopoDX",
    ObservationType.DY: "TopoDY",
    ObservationType.DZ: "TopoDZ",
}
FROZEN_TURNS = {Orientation.FIX: (0, 1, 2), Orientation.VERT: (0, 1)}
"""Components of the small rotation (right, front, up) that an orientation keeps."""
POINTS = "points"
"""The group of the constraints on coordinates, which MMVII's sigma0 leaves out."""


class Labels(Sequence[str]):
    """What observations are called in messages, made when somebody asks."""

    def __init__(self, book: FieldBook, rows: IntArray) -> None:
        self._book = book
        self._rows = rows

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        return self._book.label(int(self._rows[index]))


class Equations:
    """A network as a least-squares system.

    Orientations follow their station: when its point moves, the vertical there turns with it, and the
    instrument keeps its orientation with respect to the vertical.

    Attributes:
        system: The least-squares system.
        points: Block of every point.
        stations: Block of the rotation of every station.
        batches: Rows of the field book and batch of every observation type present.
    """

    def __init__(
        self,
        frame: Frame,
        points: Points,
        book: FieldBook,
        orientations: NDArray[np.int8],
        coordinates: FloatArray,
        rotations: FloatArray,
    ) -> None:
        self._frame = frame
        self._book = book
        self.system = LeastSquares()
        self.points = self.system.add_points(points.names, coordinates)
        self.stations = self.system.add_rotations(station_names(points, book), rotations)
        self._verticals = frame.vertical(coordinates[book.stations.origins])
        self._constrain(points)
        for status, components in FROZEN_TURNS.items():
            ids = self.stations[orientations == status]
            if ids.size:
                self.system.freeze(ids, components)
        self.batches = self._add_observations(coordinates)

    def _constrain(self, points: Points) -> None:
        for component in range(3):
            held = self.points[points.is_held[:, component]]
            if held.size:
                self.system.freeze(held, (component,))
        sigmas = np.where(points.is_free | points.is_held, np.inf, points.sigmas)
        given = np.isfinite(sigmas).any(axis=1)
        if given.any():
            self.system.add_prior(self.points[given], points.coordinates[given], sigmas[given], group=POINTS)

    def _add_observations(self, coordinates: FloatArray) -> dict[ObservationType, tuple[IntArray, Batch]]:
        observations = self._book.observations
        batches = {}
        for kind, formula in FORMULAS.items():
            rows = np.flatnonzero((observations.types == kind) & observations.active)
            if rows.size:
                batches[kind] = (
                    rows,
                    self.system.add(
                        formula,
                        self._blocks(kind, rows),
                        self._measured(kind, rows, coordinates),
                        observations.sigmas[rows],
                        labels=Labels(self._book, rows),
                    ),
                )
        return batches

    def _blocks(self, kind: ObservationType, rows: IntArray) -> dict[str, IntArray]:
        observations = self._book.observations
        origins = self.points[observations.from_points[rows]]
        targets = self.points[observations.to_points[rows]]
        if not kind.needs_station:
            return {"origin": origins, "target": targets}
        turns = self.stations[observations.stations[rows]]
        return {"station.centre": origins, "station.rotation": turns, "target": targets}

    def _measured(self, kind: ObservationType, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, m) what the formula takes besides blocks, the value last."""
        values = self._book.observations.values[rows, None]
        if kind is ObservationType.Zen:
            return np.hstack([self._frame.refraction(self._book, rows, coordinates)[:, None], values])
        if kind is ObservationType.DH:
            return np.hstack([self._frame.height_context(self._book, rows), values])
        return values

    def follow(self, system: LeastSquares, _: int) -> None:
        """Before an evaluation: turns the stations with their verticals, and corrects refraction."""
        coordinates = system.values(self.points)
        if self._frame.has_vertical and self.stations.size:
            verticals = self._frame.vertical(coordinates[self._book.stations.origins])
            rotations = verticals.transpose(0, 2, 1) @ self._verticals @ system.values(self.stations)
            system.set_values(self.stations, rotations)
            self._verticals = verticals
        if ObservationType.Zen in self.batches:
            rows, batch = self.batches[ObservationType.Zen]
            batch.observations = self._measured(ObservationType.Zen, rows, coordinates)

    def instrument_rotations(self, solution: LeastSquaresResult) -> FloatArray:
        """(m, 3, 3) rotations from the vertical to the instrument, in the solution."""
        if not self.stations.size:
            return np.zeros((0, 3, 3))
        coordinates = solution.values(self.points)
        verticals = self._frame.vertical(coordinates[self._book.stations.origins])
        rotations = solution.values(self.stations)
        return np.asarray(rotations.transpose(0, 2, 1) @ verticals.transpose(0, 2, 1))


def station_names(points: Points, book: FieldBook) -> list[str]:
    """Names of the stations for messages: their point, numbered when it has several."""
    seen: dict[str, int] = {}
    names = []
    for origin in book.stations.origins:
        name = points.names[origin]
        seen[name] = seen.get(name, 0) + 1
        names.append(f"station {name}" if seen[name] == 1 else f"station {name} ({seen[name]})")
    return names
