"""The system in which the points are given: their coordinates there, and how these change in the frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from obseq import crs
from obseq.arrays import FloatArray, IntArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass

STEP = 50.0
"""Step (m) of the differences of the fourth order that give derivatives: rounding stays below 1e-10."""
NEAREST = 0.003
"""Share of the distance from a pole that a step is at most: there curvature stays below 1e-10."""
SHARES = np.array([8.0, -8.0, -1.0, 1.0]) / 12.0
"""Of the values one step ahead and back, two ahead and back."""
AROUND = np.array([1.0, -1.0, 2.0, -2.0])
RADIUS = 6.4e6
"""Radius (m) of the Earth, for the sizes of steps."""


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
        computed = self.coordinates(points, names)
        rows, metres = self._slopes(points, computed), np.empty((len(points), 3))
        metres[:, :2], metres[:, 2] = self.system.plan_unit.factor, self.system.height_unit.factor
        if self.system.plan_unit.is_angle:
            metres[:, :2] = 1.0 / np.linalg.norm(rows[:, :2], axis=2)
        return computed, rows * metres[:, :, None], metres

    def _slopes(self, points: FloatArray, computed: FloatArray) -> FloatArray:
        """(n, 3, 3) derivatives of the coordinates (n, 3), in their units, by rows."""
        steps = np.full(len(points), STEP)
        if self.system.plan_unit.is_angle:
            away = RADIUS * np.cos(computed[:, 1] * self.system.plan_unit.factor)
            steps = np.clip(NEAREST * away, np.finfo(float).tiny, STEP)
        moved = steps[:, None, None, None] * AROUND[:, None, None] * np.eye(3)
        there = self.coordinates((points[:, None, None] + moved).reshape(-1, 3))
        here = np.repeat(computed, 3 * len(AROUND), axis=0)
        gaps = self.system.differences(there, here).reshape(len(points), len(AROUND), 3, 3)
        return np.asarray(np.einsum("k,nkji->nij", SHARES, gaps) / steps[:, None, None])

    def stretching(self, computed: FloatArray, axes: FloatArray, metres: FloatArray) -> FloatArray:
        """(n, 3, 3) derivatives of `metres`, over `metres`, at points whose `coordinates_and_axes` these are.

        A degree of longitude is shorter nearer to the pole, and one of either lower down.
        """
        found = np.zeros_like(axes)
        if self.system.plan_unit.is_angle:
            factor = self.system.plan_unit.factor
            latitude = computed[:, 1, None] * factor
            outwards = np.cos(latitude) * axes[:, 2] - np.sin(latitude) * axes[:, 1]
            found[:, 0] = outwards * factor / metres[:, :1]
            found[:, 1] = axes[:, 2] * factor / metres[:, 1:2]
        return found
