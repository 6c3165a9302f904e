"""The system in which the points are given: their coordinates there, and how these change in the frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.cached import cached_property
from obseq.dataclass import dataclass

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray, IntArray


STEP = 10.0
"""Step (m) of the differences that give derivatives: curvature of the Earth and rounding stay below 1e-9."""
AROUND = STEP * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
"""(7, 3) steps to the point itself, and along the axes."""


@dataclass(frozen=True)
class PointSystem:
    """Coordinates of points in their own system, for points of the computation frame.

    A known height holds the height of this system, and a known plan its plan: a constraint is an equation in
    these coordinates, with its sigma in metres along their axes.

    Attributes:
        frame: The computation frame.
        system: The system of the point files.
    """

    frame: crs.CoordinateSystem
    system: crs.CoordinateSystem

    @cached_property
    def _from_frame(self) -> crs.Transformer:
        return crs.Transformer(self.frame, self.system)

    @cached_property
    def turn(self) -> FloatArray | None:
        """(3, 3) signed permutation from coordinates of the frame to those of the system, if there is one."""
        if self.frame == self.system:
            return np.eye(3)
        return self._from_frame.turn

    @property
    def is_along_frame(self) -> bool:
        """Whether its axes are those of the computation frame, in whatever order and sense."""
        return self.turn is not None

    @property
    def components(self) -> IntArray:
        """(3,) component of the frame that each of its coordinates is, where it is along the frame."""
        return np.asarray(np.abs(np.eye(3) if self.turn is None else self.turn).argmax(axis=1))

    def coordinates(self, points: FloatArray, names: Sequence[str] | None = None) -> FloatArray:
        """(n, 3) coordinates in the system, in its units, of points (n, 3) of the frame."""
        return self._from_frame.forward(points, names)

    def placed(self, coordinates: FloatArray, names: Sequence[str] | None = None) -> FloatArray:
        """(n, 3) points of the frame of coordinates (n, 3) of the system."""
        return crs.Transformer(self.system, self.frame).forward(coordinates, names)

    def parts(self, coordinates: FloatArray) -> FloatArray:
        """(n, 3) points of the frame, component by component, where it has the same axes; else NaN.

        Args:
            coordinates: (n, 3) in the system, NaN for what is not known.
        """
        found = np.full_like(coordinates, np.nan)
        if self.turn is not None:
            found[:, self.components] = coordinates * self.turn.sum(axis=1)
        return found

    def axes(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of the coordinates at points (n, 3) of the frame, and what one unit of them is.

        Returns:
            (n, 3, 3), by rows, of the coordinates in metres with respect to the frame; (n, 3) metres in
            one unit of each coordinate (along the parallel and the meridian for longitude and latitude).
        """
        return self.coordinates_and_axes(points)[1:]

    def coordinates_and_axes(
        self, points: FloatArray, names: Sequence[str] | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """`coordinates` of points (n, 3) of the frame, then both of `axes`."""
        if self.turn is not None or not len(points):
            turn = np.eye(3) if self.turn is None else self.turn
            along = np.broadcast_to(turn, (len(points), 3, 3))
            return self.coordinates(points, names), along, np.ones((len(points), 3))
        there = self._around(points, names)
        differences = self.differences(there[:, 1:4].reshape(-1, 3), there[:, 4:].reshape(-1, 3))
        rows = differences.reshape(-1, 3, 3).transpose(0, 2, 1) / (2.0 * STEP)
        metres = np.empty((len(points), 3))
        metres[:, :2], metres[:, 2] = self.system.plan_unit.factor, self.system.height_unit.factor
        if self.system.plan_unit.is_angle:
            metres[:, :2] = 1.0 / np.linalg.norm(rows[:, :2], axis=2)
        return there[:, 0], rows * metres[:, :, None], metres

    def _around(self, points: FloatArray, names: Sequence[str] | None) -> FloatArray:
        """(n, 7, 3) coordinates in the system at steps `AROUND` from points of the frame."""
        try:
            return self.coordinates((points[:, None] + AROUND).reshape(-1, 3)).reshape(-1, 7, 3)
        except crs.CrsError:
            self.coordinates(points, names)  # its message names the point
            raise

    def differences(self, coordinates: FloatArray, others: FloatArray) -> FloatArray:
        """(n, 3) coordinates minus others, in the units of the system; also across the date line."""
        result = np.asarray(coordinates - others)
        if self.system.plan_unit.is_angle:
            turn = 2.0 * np.pi / self.system.plan_unit.factor
            result[:, 0] -= turn * np.round(result[:, 0] / turn)
        return result
