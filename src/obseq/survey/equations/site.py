"""What kinds of observations ask of a network: blocks of unknowns, corrections at current positions."""

from __future__ import annotations

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.survey.equations.frame import Frame
from obseq.survey.equations.instruments import Instruments
from obseq.survey.equations.plumb import Plumb
from obseq.survey.equations.shared_unknowns import SharedUnknowns
from obseq.survey.kinds.kind import Place
from obseq.survey.kinds.registry import IS_ANGLE
from obseq.survey.model import FieldBook, Orientation


@dataclass(frozen=True, eq=False)
class NetworkSite:
    """A network, as far as the equations of its observations depend on it (`kinds.kind.Site`).

    Attributes:
        frame: The computation frame.
        plumb: The plumb lines of the points.
        book: The observations.
        points: Block of every point.
        instruments: The rotation of every station.
        shared_unknowns: Blocks of the unknowns of groups.
    """

    frame: Frame
    plumb: Plumb
    book: FieldBook
    points: IntArray
    instruments: Instruments
    shared_unknowns: SharedUnknowns

    @property
    def is_plane(self) -> bool:
        """Whether the frame is a plane with heights."""
        return self.frame.is_plane

    def measured(self, rows: IntArray) -> FloatArray:
        """(n,) values as observed."""
        return np.asarray(self.book.observations.values[rows])

    def numbers(self, rows: IntArray, n: int) -> FloatArray:
        """(k, n) numbers that are given with observations besides their values."""
        groups = self.book.observations.groups[rows].tolist()
        given = [self.book.groups[group].numbers for group in groups] if n else []
        return np.array(given, np.float64).reshape(len(rows), n)

    def members(self, rows: IntArray) -> tuple[IntArray, FloatArray]:
        """(n, k) blocks of the points of the group of each observation, and (n, k) their shares in it."""
        most = max(len(group.members) for group in self.book.groups)
        blocks, shares = np.zeros((len(rows), most), np.int64), np.zeros((len(rows), most))
        for k, number in enumerate(self.book.observations.groups[rows].tolist()):
            group = self.book.groups[number]
            members = self.points[list(group.members)]
            blocks[k], blocks[k, : len(members)] = members[0], members
            shares[k, : len(members)] = group.shares
        return blocks, shares

    def combinations(self, rows: IntArray) -> tuple[IntArray, FloatArray]:
        """(n, k) blocks of the points of the group of each observation, and (n, k, 3) their coefficients."""
        groups = [self.book.groups[number] for number in self.book.observations.groups[rows].tolist()]
        most = max(len(group.members) for group in groups)
        blocks, coefficients = np.zeros((len(rows), most), np.int64), np.zeros((len(rows), most, 3))
        for k, group in enumerate(groups):
            members = self.points[list(group.members)]
            blocks[k], blocks[k, : len(members)] = members[0], members
            coefficients[k, : len(members)] = np.reshape(group.weights, (-1, 3))
        return blocks, coefficients

    def levelled(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) observed height differences between the points, along the vertical of the frame."""
        return self.plumb.levelled(self.book, rows, coordinates)

    def slopes_of_levelled(self, rows: IntArray, coordinates: FloatArray) -> FloatArray | None:
        """(n, 6) derivatives of `levelled` by the two points; None where it does not depend on them."""
        return self.plumb.slopes_of_levelled(self.book, rows, coordinates)

    def slopes_of_grid(self, rows: IntArray, coordinates: FloatArray) -> FloatArray | None:
        """(n, 6) derivatives of minus the values of stations along the grid; None without such."""
        is_grid = self._is_grid(rows)
        if self.is_plane or not is_grid.any():
            return None
        _, radius = self.sphere(rows)
        origins = self.book.observations.from_points[rows]
        up = self.frame.verticals(origins, coordinates)[:, 2]
        along = (self.measured(rows) * is_grid / radius)[:, None] * up
        return np.hstack([-along, np.zeros_like(along)])

    def grid_scales(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) lengths at the height of the station for one at height 0: differences of grid coordinates."""
        result, is_grid = np.ones(len(rows)), self._is_grid(rows)
        if is_grid.any() and not self.is_plane:
            _, radius = self.sphere(rows[is_grid])
            origins = self.book.observations.from_points[rows[is_grid]]
            result[is_grid] += self.frame.around(coordinates).geodetic[origins, 2] / radius
        return result

    def _is_grid(self, rows: IntArray) -> BoolArray:
        """(n,) whether observations are lengths of a station along the grid."""
        observations = self.book.observations
        return self._are_grid[observations.stations[rows]] & ~IS_ANGLE[observations.types[rows]]

    @cached_property
    def _are_grid(self) -> BoolArray:
        """(m + 1,) whether each station is along the grid; the last one stands for none."""
        return np.append(self.book.stations.orientations == Orientation.GRID.value, np.False_)

    def refraction(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) corrections of zenith angles."""
        return self.frame.refraction(self.book, rows, coordinates)

    def slopes_of_refraction(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 6) derivatives of `refraction_of_one` by the two points."""
        return self.frame.slopes_of_refraction(self.book, rows, coordinates)

    @property
    def refraction_coefficient(self) -> float:
        """Coefficient of zenith angles."""
        return self.frame.refraction_coefficient

    def refraction_of_one(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) what a coefficient of 1 adds to the corrections of zenith angles."""
        return self.frame.refraction_of_one(self.book, rows, coordinates)

    def to_geocentric(self, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        """Rotation (3, 3) and translation (3,) of the frame to geocentric coordinates."""
        return self.frame.to_geocentric(self.book, rows)

    def to_ground(self, rows: IntArray) -> tuple[float, ...]:
        """R and T of the frame to the ellipsoid to which heights refer, its radius and eccentricity."""
        return self.frame.to_ground(self.book, rows)

    def ends(self, rows: IntArray) -> tuple[IntArray, IntArray]:
        """Blocks (n,) of the two points."""
        observations = self.book.observations
        return self.points[observations.from_points[rows]], self.points[observations.to_points[rows]]

    def backsights(self, rows: IntArray) -> IntArray:
        """Blocks (n,) of the third points of angles."""
        return self.points[self.book.observations.backsights[rows]]

    def verticals(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 3, 3) rotations from the frame to east, north, up along the plumb lines of the first points."""
        return self.plumb.axes(self.book.observations.from_points[rows].astype(np.int64), coordinates)

    def turns_of_axes(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 3, 3) what the axes of observations turn by when the first points move (rad per m)."""
        stations = self.book.observations.stations[rows]
        if (stations >= 0).all():
            return self.instruments.turns(coordinates)[stations]
        return self.plumb.turns(self.book.observations.from_points[rows].astype(np.int64), coordinates)

    def heights(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) ellipsoidal heights (m) of the last points, as precise as their coordinates."""
        self.to_geocentric(rows)
        return np.asarray(self.frame.around(coordinates).heights[self.book.observations.to_points[rows]])

    def geodetic(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 3) longitude, latitude (rad) and ellipsoidal height (m) of the last points."""
        return self.places(rows, coordinates)[1][0]

    def normals(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 3, 3) rotations from the frame to east, north, up of the ellipsoid at the last points."""
        return self.places(rows, coordinates)[1][1]

    def places(self, rows: IntArray, coordinates: FloatArray) -> tuple[Place, Place]:
        """Of both points: geodetic coordinates, east, north and up of the ellipsoid, coordinates."""
        self.to_geocentric(rows)
        observations, around = self.book.observations, self.frame.around(coordinates)
        first, last = (
            (around.geodetic[points], around.verticals[points], coordinates[points])
            for points in (observations.from_points[rows], observations.to_points[rows])
        )
        return first, last

    def offsets(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 3) offsets of the targets above their points minus those of the instruments (m)."""
        return self.plumb.offsets(self.book, rows, coordinates)

    def stations(self, rows: IntArray) -> IntArray:
        """Blocks (n,) of the rotations of the stations."""
        return self.instruments.ids[self.book.observations.stations[rows]]

    def positions(self, rows: IntArray, coordinates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coordinates (n, 3) of the two points."""
        observations = self.book.observations
        return coordinates[observations.from_points[rows]], coordinates[observations.to_points[rows]]

    def shared(self, rows: IntArray, part: str) -> IntArray:
        """Blocks (n,) of what the group of each observation, or its parent, has under this name."""
        return self.shared_unknowns.blocks(rows, part)

    def shared_values(self, rows: IntArray, part: str) -> FloatArray:
        """(n, m) present values of these."""
        return self.shared_unknowns.values(rows, part)

    def sphere(self, rows: IntArray) -> tuple[FloatArray, float]:
        """Centre (3,) in the frame, and radius, of the sphere that stands for height 0."""
        return self.frame.sphere(self.book, rows)
