"""The instruments of a network as unknowns: rotations that turn with the plumb lines of their points."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray
from obseq.leastsquares import LeastSquares, LeastSquaresResult
from obseq.leastsquares.problem.manifolds import PLUMB
from obseq.survey.equations.plumb import Plumb
from obseq.survey.initial.initial_values import InitialValues
from obseq.survey.initial.orienting import plumb_rotation
from obseq.survey.model import FieldBook, Orientation, Points

FROZEN_TURNS = {Orientation.FIX: (0, 1, 2), Orientation.VERT: (0, 1)}
"""Components of the small rotation (right, front, up) that an orientation keeps."""


class Instruments:
    """The rotations of the stations, from the axes of the instrument to the frame.

    They follow their station: when its point moves, the vertical there turns with it, and the instrument
    keeps its orientation with respect to the vertical, or stays along the grid. A camera follows its image.

    Attributes:
        ids: Block of the rotation of every station.
    """

    def __init__(self, system: LeastSquares, plumb: Plumb, book: FieldBook, initial: InitialValues) -> None:
        """Adds the unknowns to a system.

        Args:
            system: The least-squares system.
            plumb: The plumb lines of the points.
            book: Observations.
            initial: Where points and stations start.
        """
        self._plumb = plumb
        self._origins = book.stations.origins.astype(np.int64)
        self._grid = book.stations.orientations == Orientation.GRID.value
        self._cameras = book.stations.orientations == Orientation.CAM.value
        values = self._started(initial)
        self.ids = system.add_blocks(PLUMB, station_names(plumb.points, book), values)
        for status, components in FROZEN_TURNS.items():
            frozen = self.ids[initial.orientations == status.value]
            if frozen.size:
                system.freeze(frozen, components)

    def _started(self, initial: InitialValues) -> FloatArray:
        """(m, 3, 6) initial rotations, and plumb lines.

        Of a plumb instrument only where it points counts, whatever its initial rotation stands along: the
        vertical of the frame, or a plumb line that was found elsewhere.
        """
        verticals = self._plumb.axes(self._origins, initial.coordinates)
        rotations, fronts = initial.rotations.copy(), initial.rotations[:, :, 1]
        east, north, _ = np.einsum("nij,nj->in", verticals, fronts)
        azimuths = np.where(initial.orientations == Orientation.FIX.value, 0.0, np.arctan2(east, north))
        plumb = (initial.orientations != Orientation.BASC.value) & ~self._cameras
        rotations[plumb] = plumb_rotation(verticals[plumb], azimuths[plumb])
        return self._turned(rotations, verticals, initial.coordinates)

    def _turned(self, rotations: FloatArray, before: FloatArray, coordinates: FloatArray) -> FloatArray:
        """(m, 3, 6) rotations (m, 3, 3) and the plumb lines (m, 3, 3) at coordinates, from those before."""
        verticals = self._plumb.axes(self._origins, coordinates)
        turned = verticals.transpose(0, 2, 1) @ before @ rotations
        if self._grid.any():
            turned[self._grid] = _along_grid(verticals[self._grid])
        turned[self._cameras] = rotations[self._cameras]
        return np.concatenate([turned, verticals], axis=2)

    def restart(self, system: LeastSquares, plumb: Plumb, initial: InitialValues) -> None:
        """Comes back to where stations start."""
        self._plumb = plumb
        if self.ids.size:
            system.set_values(self.ids, self._started(initial))

    def rotations(self, solution: LeastSquaresResult | LeastSquares) -> FloatArray:
        """(m, 3, 3) rotations from the instruments to the frame."""
        return solution.values(self.ids)[:, :, :3] if self.ids.size else np.zeros((0, 3, 3))

    def oriented(self, solution: LeastSquaresResult, coordinates: FloatArray) -> FloatArray:
        """(m, 3, 3) rotations from the vertical to the instruments, at the coordinates of a solution."""
        verticals = self._plumb.axes(self._origins, coordinates)
        return np.asarray((verticals @ self.rotations(solution)).transpose(0, 2, 1))

    def follow(self, system: LeastSquares, coordinates: FloatArray) -> None:
        """Turns them with the plumb lines at coordinates of the points; in a plane these are all alike."""
        if self._plumb.turn and self.ids.size:
            values = system.values(self.ids)
            turned = self._turned(values[:, :, :3], values[:, :, 3:], coordinates)
            system.set_values(self.ids, turned)

    def turns(self, coordinates: FloatArray) -> FloatArray:
        """(m, 3, 3) what they turn by when their points move, in the frame (rad per m)."""
        turns = self._plumb.turns(self._origins, coordinates)
        if self._grid.any():
            verticals = self._plumb.axes(self._origins[self._grid], coordinates)
            turns[self._grid] = _turns_along_grid(_along_grid(verticals), turns[self._grid])
        turns[self._cameras] = 0.0
        return turns


def _along_grid(verticals: FloatArray) -> FloatArray:
    """(n, 3, 3) rotations, plumb instrument to frame, whose front is the y axis of the frame seen from above.

    Args:
        verticals: (n, 3, 3) rotations from the frame to east, north, up.
    """
    return plumb_rotation(verticals, np.arctan2(verticals[:, 0, 1], verticals[:, 1, 1]))


def _turns_along_grid(rotations: FloatArray, turns: FloatArray) -> FloatArray:
    """(n, 3, 3) turns of instruments along the grid: of their verticals, the front staying below the y axis.

    Args:
        rotations: (n, 3, 3) from the instruments to the frame.
        turns: (n, 3, 3) of east, north, up.
    """
    front, up = rotations[:, :, 1], rotations[:, :, 2]
    about_up = np.einsum("ni,nij->nj", front * (up[:, 1] / front[:, 1])[:, None] - up, turns)
    return np.asarray(turns + up[:, :, None] * about_up[:, None, :])


def station_names(points: Points, book: FieldBook) -> list[str]:
    """Names of the stations for messages: their point, numbered when it has several."""
    seen: dict[str, int] = {}
    names = []
    for origin in book.stations.origins:
        name = points.names[origin]
        seen[name] = seen.get(name, 0) + 1
        names.append(f"station {name}" if seen[name] == 1 else f"station {name} ({seen[name]})")
    return names
