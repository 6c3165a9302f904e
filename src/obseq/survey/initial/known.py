"""What is known so far while initial values are computed: points, verticals, orientations."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from obseq.arrays import BoolArray, FloatArray, FloatRows
from obseq.crs.normals import Normals
from obseq.errors import InputError
from obseq.survey.initial.closed_forms import Space, minus, plus, scaled
from obseq.survey.sights.sights import Cause

Matrix = tuple[Space, Space, Space]
"""A 3 x 3 matrix by rows, as plain numbers: single points are computed faster without arrays."""

Vertical = Callable[[FloatArray], FloatArray]
"""Points (n, 3) of the frame -> rotations (n, 3, 3) from the frame to local east, north, up."""

_FEW = 40
"""Points from which arrays are quicker than one point after the other."""

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def times(matrix: Matrix, v: Space) -> Space:
    """Matrix times vector."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    x, y, z = v
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


def transposed_times(matrix: Matrix, v: Space) -> Space:
    """Transposed matrix times vector."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    x, y, z = v
    return a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z


def turned(vector: Space, g0: float) -> Space:
    """A vector of a plumb instrument in local east, north, up."""
    (x, y, z), cosine, sine = vector, math.cos(g0), math.sin(g0)
    return x * cosine + y * sine, y * cosine - x * sine, z


def as_matrix(array: FloatArray) -> Matrix:
    """The plain form of a (3, 3) array."""
    first, second, third = array.tolist()
    return tuple(first), tuple(second), tuple(third)


class Known:
    """Known coordinates and orientations; a point can be known in the horizontal, in height, or both.

    Expected errors decide what is used first: `point_sigmas[p]` of a position (m), `relative_sigmas[p]` of a
    position relative to the station `parents[p]` that placed it, `azimuth_sigmas[k]` of the zero of a station
    (rad).

    `is_settled[p]` is true once others may use the position of p.

    `given_heights[p]` is the height that the file gives of a point without horizontal position. `level` has
    the points whose heights are to be that of the reference point: nothing is known of them.

    `positions[p]` is set once the horizontal position is known (on the plumb line of p, at a provisional
    height while `has_height[p]` is false). `height(p)` is a height above the reference point, along mean
    plumb lines: differences of it are differences of ellipsoidal height to about 1e-6.
    """

    def __init__(self, names: Sequence[str], n_stations: int, vertical: Vertical | None) -> None:
        n = len(names)
        self.names = names
        self.vertical = vertical
        self.positions: list[Space | None] = [None] * n
        self.has_height = bytearray(n)
        self.is_settled = bytearray(n)
        self._heights: list[float | None] = [None] * n
        self._verticals: list[Matrix | None] = [None] * n
        self.rotations: list[Matrix | None] = [None] * n_stations
        self.g0: list[float | None] = [None] * n_stations
        self.point_steps: list[Cause | None] = [None] * n
        self.station_steps: list[Cause | None] = [None] * n_stations
        self.reference: int | None = None
        self.point_sigmas: list[float] = [0.0] * n
        self.relative_sigmas: list[float] = [0.0] * n
        self.parents: list[int | None] = [None] * n
        self.azimuth_sigmas: list[float] = [0.0] * n_stations
        self.origins: Sequence[int] = ()
        self.given_heights: dict[int, float] = {}
        self.level: frozenset[int] = frozenset()

    def is_placed(self, point: int) -> bool:
        """True when the three coordinates are known, and settled."""
        return bool(self.is_settled[point] and self.has_height[point])

    def has_all_points(self) -> bool:
        """True when all points are placed."""
        return 0 not in self.is_settled and 0 not in self.has_height

    def is_complete(self) -> bool:
        """True when all points are placed and all stations oriented."""
        return self.has_all_points() and None not in self.station_steps

    def vertical_at(self, position: Space) -> Matrix:
        """R_(frame -> vertical) at a position."""
        if self.vertical is None:
            return IDENTITY
        if isinstance(self.vertical, Normals):
            return self.vertical.at(position)
        return as_matrix(self.vertical(np.array([position]))[0])

    def settle(self, points: Sequence[int]) -> None:
        """Makes usable some points whose position has just been set.

        Verticals are computed now where the frame gives them quicker to many points, else when asked for.

        Raises:
            InputError: the frame gives no vertical at a point.
        """
        if not points:
            return
        if self.reference is None:
            self.reference = points[0]
        waits = isinstance(self.vertical, Normals) and len(points) < _FEW
        matrices = [None] * len(points) if waits else self._matrices(points)
        for point, matrix in zip(points, matrices, strict=True):
            self.is_settled[point], self._verticals[point] = 1, matrix
            if self.has_height[point]:
                self._heights[point] = None

    def _matrices(self, points: Sequence[int]) -> list[Matrix]:
        if self.vertical is None:
            return [IDENTITY] * len(points)
        rotations = np.asarray(self.vertical(np.array([self.positions[point] for point in points])))
        for point, is_finite in zip(points, np.asarray(np.isfinite(rotations).all(axis=(1, 2))), strict=True):
            if not is_finite:
                raise InputError(
                    f"point {self.names[point]}: the frame has no vertical at {self.positions[point]}; "
                    "check its coordinates and the coordinate system"
                )
        return [as_matrix(rotation) for rotation in rotations]

    def forget_point(self, point: int) -> None:
        """Nothing is known of a point any more."""
        self.positions[point] = self._heights[point] = self._verticals[point] = None
        self.point_steps[point], self.has_height[point], self.is_settled[point] = None, 0, 0
        self.point_sigmas[point], self.parents[point] = 0.0, None

    def forget_station(self, station: int) -> None:
        """Nothing is known of the orientation of a station any more."""
        self.rotations[station] = self.g0[station] = self.station_steps[station] = None
        self.azimuth_sigmas[station] = 0.0

    def verticals_of(self, points: Sequence[int]) -> FloatRows:
        """(k, 3, 3) R_(frame -> vertical) at settled points."""
        if isinstance(self.vertical, Normals) and len(points) >= _FEW:
            return self.vertical(np.array([self.positions[point] for point in points]))
        return np.array([self.vertical_of(point) for point in points])

    def position_of(self, point: int) -> Space:
        """Position of a point that has one."""
        position = self.positions[point]
        assert position is not None
        return position

    def vertical_of(self, point: int) -> Matrix:
        """R_(frame -> vertical) at a point that has been settled."""
        matrix = self._verticals[point]
        if matrix is None:
            assert self.is_settled[point]
            matrix = self._verticals[point] = self.vertical_at(self.position_of(point))
        return matrix

    def height(self, point: int) -> float | None:
        """Height of a point that is placed, or has been levelled."""
        height = self._heights[point]
        if height is None and self.is_placed(point):
            height = self.height_of(self.position_of(point), self.vertical_of(point))
            self._heights[point] = height
        return height

    def take_height(self, point: int, height: float) -> None:
        """Takes the height of a point that has been levelled."""
        self._heights[point] = height

    def coordinates(self) -> FloatArray:
        """(n, 3) positions; NaN where there is none."""
        nowhere = (math.nan, math.nan, math.nan)
        positions = [nowhere if position is None else position for position in self.positions]
        return np.array(positions, np.float64).reshape(-1, 3)

    def are_placed(self) -> BoolArray:
        """(n,) whether each point is placed (`is_placed`)."""
        settled, high = (np.frombuffer(flags, np.bool_) for flags in (self.is_settled, self.has_height))
        return settled & high

    def height_of(self, position: Space, vertical: Matrix) -> float:
        """Height above the reference point along the mean of the two plumb lines."""
        if self.reference is None:
            return 0.0
        (a, b, c), (x, y, z) = self.mean_up(vertical), minus(position, self.position_of(self.reference))
        return a * x + b * y + c * z

    def mean_up(self, vertical: Matrix) -> Space:
        """Mean of the plumb lines (upwards) at a point and at the reference point; zero without this."""
        if self.reference is None:
            return 0.0, 0.0, 0.0
        return scaled(plus(vertical[2], self.vertical_of(self.reference)[2]), 0.5)

    @property
    def reference_height(self) -> float:
        """Height (z) of the reference point, of a plane."""
        return 0.0 if self.reference is None else self.position_of(self.reference)[2]

    def relative_sigma(self, a: int, b: int, distance: float) -> float:
        """Expected error (m) of b relative to a; small when one station placed both."""
        station = self._common_station(a, b)
        if station is None:
            return math.hypot(self.point_sigmas[a], self.point_sigmas[b])
        relative_sigmas = [self.relative_sigmas[p] for p in (a, b) if self.parents[p] == station]
        return math.hypot(distance * self.azimuth_sigmas[station], *relative_sigmas)

    def _common_station(self, a: int, b: int) -> int | None:
        """The station that placed both points, or that stands on one and placed the other."""
        first, second = self.parents[a], self.parents[b]
        if first is not None and (first == second or self.origins[first] == b):
            return first
        return second if second is not None and self.origins[second] == a else None
