"""The least-squares system of a survey network: unknowns of points and stations, one batch per type."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares import LeastSquares
from obseq.survey.adjustment.known_coordinates import KnownCoordinates
from obseq.survey.adjustment.plumb import Plumb
from obseq.survey.adjustment.shared_unknowns import SharedUnknowns
from obseq.survey.adjustment.site import NetworkSite
from obseq.survey.adjustment.vectors import Vectors
from obseq.survey.kinds.registry import IS_ANGLE, KINDS
from obseq.survey.model import Orientation

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.leastsquares import Batch, LeastSquaresResult
    from obseq.survey.adjustment.frame import Frame
    from obseq.survey.adjustment.point_system import PointSystem
    from obseq.survey.initial.initial_values import InitialValues
    from obseq.survey.kinds.kind import ObservationKind
    from obseq.survey.model import FieldBook, Points


WITH_OFFSETS = "Off"
"""What ends the name of a formula that takes offsets of instrument and target."""
SHORTEST_SIGHT = 1e-6
"""Distance (m) that stands for shorter ones where a sigma is divided by it."""
FROZEN_TURNS = {Orientation.FIX: (0, 1, 2), Orientation.VERT: (0, 1)}
"""Components of the small rotation (right, front, up) that an orientation keeps."""


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
        batches: Rows of the field book and batch of every kind of observation present. The rows of a vector
            are those of its components; its residuals, in sigmas, are combinations of theirs.
        known: The equations of known coordinates.
    """

    def __init__(
        self,
        frame: Frame,
        point_system: PointSystem,
        points: Points,
        book: FieldBook,
        initial: InitialValues,
        system: LeastSquares | None = None,
        shared: Mapping[str, int] | None = None,
    ) -> None:
        """Puts the unknowns and equations of a network in a system.

        Args:
            frame: The computation frame.
            point_system: Coordinate system of the points.
            points: Points of the network.
            book: Observations.
            initial: Where points and stations start.
            system: One that holds other equations too; a new one when None.
            shared: Block of the points that are in that system already, by name.
        """
        self._frame = frame
        self._plumb = Plumb(frame, points)
        self._book = book
        self._origins = book.stations.origins.astype(np.int64)
        self.system = LeastSquares() if system is None else system
        self.points = self._blocks_of_points(points, initial.coordinates, shared or {})
        self._verticals = self._plumb.axes(self._origins, initial.coordinates)
        self.stations = self.system.add_rotations(
            station_names(points, book), self._plumbed(initial, frame.vertical)
        )
        self.known = KnownCoordinates(self.system, self.points, points, point_system)
        for status, components in FROZEN_TURNS.items():
            ids = self.stations[initial.orientations == status]
            if ids.size:
                self.system.freeze(ids, components)
        shared_unknowns = SharedUnknowns(self.system, book)
        self._site = NetworkSite(frame, self._plumb, book, self.points, self.stations, shared_unknowns)
        shared_unknowns.add(self._site, initial.coordinates)
        self._vectors: Vectors | None = None
        self.batches = self._add_observations(initial.coordinates)

    def _blocks_of_points(
        self, points: Points, coordinates: FloatArray, shared: Mapping[str, int]
    ) -> IntArray:
        new = [row for row, name in enumerate(points.names) if name not in shared]
        ids = np.array([shared.get(name, -1) for name in points.names], dtype=np.int64)
        ids[new] = self.system.add_points([points.names[row] for row in new], coordinates[new])
        return ids

    def _plumbed(self, initial: InitialValues, vertical: Callable[[FloatArray], FloatArray]) -> FloatArray:
        """Initial rotations of the stations, turned from the vertical of the frame to the plumb line."""
        before = vertical(initial.coordinates[self._origins])
        rotations = self._verticals.transpose(0, 2, 1) @ before @ initial.rotations
        grid = self._book.stations.orientations == Orientation.GRID
        rotations[grid] = _along_grid(self._verticals[grid])
        return np.asarray(rotations)

    def _add_observations(self, coordinates: FloatArray) -> dict[ObservationKind, tuple[IntArray, Batch]]:
        observations = self._book.observations
        batches = {}
        for kind in KINDS:
            rows = np.flatnonzero((observations.types == kind.code) & observations.active)
            if rows.size and kind.size:
                batch = self._added(kind, rows, coordinates)
                batches[kind] = (rows if kind.size == 1 else _components(rows, kind.size), batch)
        return batches

    def _added(self, kind: ObservationKind, rows: IntArray, coordinates: FloatArray) -> Batch:
        if kind.size > 1:
            return self._add_vectors(kind, rows, coordinates)
        add = self._linear if kind.is_linear(self._site) else self._observed
        return add(kind, rows, coordinates)

    def _add_vectors(self, kind: ObservationKind, rows: IntArray, coordinates: FloatArray) -> Batch:
        """Vectors as whitened linear rows."""
        self._vectors = Vectors.of(self._book, rows)
        rotation, _ = self._site.to_geocentric(rows)
        values = self._vectors.values(self._site, self._plumb, self._book, coordinates)
        coefficients, right = self._vectors.equations(rotation, values)
        ends = [np.repeat(blocks, kind.size) for blocks in self._site.ends(rows)]
        labels = Labels(self._book, self._vectors.components.ravel())
        return self.system.add_linear(
            ends, [-coefficients, coefficients], right, 1.0, labels=labels, group=kind.name
        )

    def _observed(self, kind: ObservationKind, rows: IntArray, coordinates: FloatArray) -> Batch:
        """Observations of a formula."""
        return self.system.add(
            kind.formula + (WITH_OFFSETS if self._has_offsets(kind, rows) else ""),
            kind.blocks(self._site, rows),
            self._measured(kind, rows, coordinates),
            self.sigmas(rows, coordinates),
            labels=Labels(self._book, rows),
            group=kind.name,
        )

    def _linear(self, kind: ObservationKind, rows: IntArray, coordinates: FloatArray) -> Batch:
        """Observations as linear rows: what precedes the value are the coefficients of the blocks."""
        measured = self._measured(kind, rows, coordinates)
        blocks = list(kind.blocks(self._site, rows).values())
        coefficients = np.split(measured[:, :-1], len(blocks), axis=1)
        return self.system.add_linear(
            blocks,
            coefficients,
            measured[:, -1],
            self.sigmas(rows, coordinates),
            labels=Labels(self._book, rows),
            group=kind.name,
        )

    def _has_offsets(self, kind: ObservationKind, rows: IntArray) -> bool:
        observations = self._book.observations
        heights = (observations.from_heights[rows], observations.to_heights[rows])
        return kind.takes_heights and any(column.any() for column in heights)

    def _measured(self, kind: ObservationKind, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, m) what the equation takes besides blocks: offsets if any, its context, the value last."""
        site = self._site
        values = kind.values(site, rows, coordinates).reshape(len(rows), -1)
        columns = [kind.context(site, rows, coordinates), values]
        if self._has_offsets(kind, rows):
            columns.insert(0, self._plumb.offsets(self._book, rows, coordinates))
        return np.hstack(columns)

    def sigmas(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) sigmas of observations, with their relative parts at the distances between points there."""
        observations = self._book.observations
        relative = observations.relative_sigmas[rows]
        if not relative.any():
            return observations.sigmas[rows]
        sights = coordinates[observations.to_points[rows]] - coordinates[observations.from_points[rows]]
        sights = sights + self._plumb.offsets(self._book, rows, coordinates)
        distances = np.linalg.norm(sights, axis=1)
        is_angle = IS_ANGLE[observations.types[rows]]
        share = np.where(is_angle, 1.0 / np.maximum(distances, SHORTEST_SIGHT), distances)
        return np.asarray(observations.sigmas[rows] + relative * share)

    def follow(self, system: LeastSquares, _: int) -> None:
        """Before an evaluation: turns the stations with their verticals, renews what depends on positions."""
        self.known.follow(system)
        coordinates = system.values(self.points)
        if self._frame.has_vertical and self.stations.size:
            verticals = self._plumb.axes(self._origins, coordinates)
            rotations = verticals.transpose(0, 2, 1) @ self._verticals @ system.values(self.stations)
            system.set_values(self.stations, rotations)
            self._verticals = verticals
        for kind, (rows, batch) in self.batches.items():
            if kind.size > 1:
                continue
            if kind.depends_on_place or self._has_offsets(kind, rows) or self._plumb.is_deflected:
                batch.observations = self._measured(kind, rows, coordinates)
            if self._book.observations.relative_sigmas[rows].any():
                batch.sigmas = self.sigmas(rows, coordinates)

    def fitted(self, solution: LeastSquaresResult) -> tuple[FloatArray, FloatArray]:
        """(n,) residuals of all observations, NaN for inactive ones, and the sigmas of the adjustment."""
        residuals = np.full(len(self._book.observations), np.nan)
        sigmas = self._book.observations.sigmas.copy()
        for kind, (rows, batch) in self.batches.items():
            found = solution.residuals(batch)
            if kind.size > 1 and self._vectors is not None:
                components = self._vectors.components
                residuals[components], sigmas[components] = (
                    self._vectors.residuals(found),
                    self._vectors.sigmas,
                )
            else:
                residuals[rows], sigmas[rows] = kind.residuals(found)[:, 0], batch.sigmas[:, 0]
        return residuals, sigmas

    def instrument_rotations(self, solution: LeastSquaresResult) -> FloatArray:
        """(m, 3, 3) rotations from the vertical to the instrument, in the solution."""
        if not self.stations.size:
            return np.zeros((0, 3, 3))
        coordinates = solution.values(self.points)
        verticals = self._plumb.axes(self._origins, coordinates)
        rotations = solution.values(self.stations)
        return np.asarray(rotations.transpose(0, 2, 1) @ verticals.transpose(0, 2, 1))


def _components(rows: IntArray, size: int) -> IntArray:
    """(size n,) rows of all components of vectors, from those of the first ones."""
    return np.asarray((rows[:, None] + np.arange(size)).ravel())


def station_names(points: Points, book: FieldBook) -> list[str]:
    """Names of the stations for messages: their point, numbered when it has several."""
    seen: dict[str, int] = {}
    names = []
    for origin in book.stations.origins:
        name = points.names[origin]
        seen[name] = seen.get(name, 0) + 1
        names.append(f"station {name}" if seen[name] == 1 else f"station {name} ({seen[name]})")
    return names


def _along_grid(verticals: FloatArray) -> FloatArray:
    """(n, 3, 3) rotations, plumb instrument to frame, whose front is the y axis of the frame seen from above.

    Args:
        verticals: (n, 3, 3) rotations from the frame to east, north, up.
    """
    azimuths = np.arctan2(verticals[:, 0, 1], verticals[:, 1, 1])
    cosine, sine, zero, one = (
        np.cos(azimuths),
        np.sin(azimuths),
        np.zeros(len(azimuths)),
        np.ones(len(azimuths)),
    )
    turns = np.array([[cosine, -sine, zero], [sine, cosine, zero], [zero, zero, one]]).transpose(2, 0, 1)
    return np.asarray((turns @ verticals).transpose(0, 2, 1))
