"""What a kind of observation is, and what it may ask of the network it is observed in."""

from __future__ import annotations

import enum
import math
from dataclasses import field
from typing import Protocol

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.kernels import Kernel

FULL_TURN = 2.0 * math.pi * (1.0 + 1e-12)


class Start(enum.Enum):
    """What an observation gives to initial values.

    `HZ` to `DZ` are measures of a sight in the axes of its station; the others join two points, or three
    (`ANGLE`). `FLAT` is a horizontal distance.
    """

    NOTHING = ""
    DISTANCE = "distance"
    FLAT = "flat"
    RISE = "rise"
    ANGLE = "angle"
    HZ = "hz"
    ZENITH = "zenith"
    DX = "dx"
    DY = "dy"
    DZ = "dz"


class FirstPlace(enum.Enum):
    """How an observation, with the others of its family, says where its point is before anything else does.

    Three coordinates, or three components of a vector (geocentric, or along the axes of the frame), on lines
    that follow each other; points around the origin of an axis; the members of a barycentre.
    """

    NOTHING = ""
    POSITION = "position"
    VECTOR = "vector"
    LOCAL_VECTOR = "local vector"
    CIRCLE = "circle"
    BARYCENTRE = "barycentre"


Place = tuple["FloatArray", "FloatArray", "FloatArray"]
"""(n, 3) longitude, latitude, height; (n, 3, 3) from the frame to east, north, up; (n, 3) coordinates."""


class Site(Protocol):
    """The network, as far as equations depend on it; rows are those of the field book."""

    @property
    def is_plane(self) -> bool:
        """Whether the frame is a plane with heights."""

    def measured(self, rows: IntArray) -> FloatArray:
        """(n,) values as observed."""

    def numbers(self, rows: IntArray, n: int) -> FloatArray:
        """(k, n) numbers that are given with observations besides their values."""

    def levelled(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) observed height differences between the points themselves, along the vertical of the frame."""

    def refraction(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) corrections of zenith angles."""

    @property
    def refraction_coefficient(self) -> float:
        """Coefficient of zenith angles."""

    def refraction_of_one(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) what a coefficient of 1 adds to the corrections of zenith angles."""

    def to_geocentric(self, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        """Rotation (3, 3) and translation (3,) of the frame to geocentric coordinates."""

    def to_ground(self, rows: IntArray) -> tuple[float, ...]:
        """R and T of the frame to the ellipsoid to which heights refer, its radius and eccentricity."""

    def sphere(self, rows: IntArray) -> tuple[FloatArray, float]:
        """Centre (3,) in the frame, and radius, of the sphere that stands for height 0."""

    def shared(self, rows: IntArray, part: str) -> IntArray:
        """Blocks (n,) of what the group of each observation, or its parent, has as unknown of this name."""

    def ends(self, rows: IntArray) -> tuple[IntArray, IntArray]:
        """Blocks (n,) of the two points."""

    def backsights(self, rows: IntArray) -> IntArray:
        """Blocks (n,) of the third points of angles."""

    def members(self, rows: IntArray) -> tuple[IntArray, FloatArray]:
        """(n, k) blocks of the points of the group of each observation, and (n, k) their shares in it.

        Groups of fewer points than others are filled up with points of no share.
        """

    def combinations(self, rows: IntArray) -> tuple[IntArray, FloatArray]:
        """(n, k) blocks of the points of the group of each observation, and (n, k, 3) their coefficients."""

    def positions(self, rows: IntArray, coordinates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coordinates (n, 3) of the two points."""

    def heights(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) ellipsoidal heights (m) of the last points, as precise as their coordinates."""

    def geodetic(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 3) longitude, latitude (rad) and ellipsoidal height (m) of the last points."""

    def normals(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 3, 3) rotations from the frame to east, north, up of the ellipsoid at the last points."""

    def places(self, rows: IntArray, coordinates: FloatArray) -> tuple[Place, Place]:
        """Of both points: geodetic coordinates, east, north and up of the ellipsoid, coordinates."""

    def verticals(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 3, 3) rotations from the frame to east, north, up along the plumb lines of the first points."""

    def slopes_of_levelled(self, rows: IntArray, coordinates: FloatArray) -> FloatArray | None:
        """(n, 6) derivatives of `levelled` by the two points; None where it does not depend on them."""

    def slopes_of_refraction(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 6) derivatives of `refraction_of_one` by the two points."""

    def slopes_of_grid(self, rows: IntArray, coordinates: FloatArray) -> FloatArray | None:
        """(n, 6) derivatives of minus the values of stations along the grid; None without such."""

    def shared_values(self, rows: IntArray, part: str) -> FloatArray:
        """(n, m) present values of the unknowns that `shared` names."""

    def offsets(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 3) offsets of the targets above their points minus those of the instruments (m)."""

    def stations(self, rows: IntArray) -> IntArray:
        """Blocks (n,) of the rotations of the stations."""


@dataclass(frozen=True)
class Shared:
    """An unknown of a group, where it starts.

    Attributes:
        value: A number, or a vector (3,) of any length for a direction.
    """

    value: float | FloatArray

    @property
    def is_direction(self) -> bool:
        """Whether it is a direction of space, not a number."""
        return not isinstance(self.value, float)


@dataclass(frozen=True)
class ObservationKind:
    """A kind of observation.

    Attributes:
        name: What files, results and messages call it.
        code: Its number in the columns of observations, that of OBS files where these have it.
        words: What it is, for tables and help.
        formula: The formula of its equation; empty when it is linear rows, made anew at each place.
        is_angle: Whether value and sigma are angles (radians), not lengths (metres).
        needs_station: Whether it is read on an instrument, whose axes are an unknown or given rotation.
        orients: Whether it turns a station about its vertical (0: no, 1: yes, -1: unless its value is 0).
        start: What it gives to initial values.
        first_place: How it places its point before all other initial values.
        family: Kinds of one family have one equation, and may be correlated; its own name when empty.
        is_absolute: Whether one observation says where its point is, not how points lie to each other.
        takes_heights: Whether its formula has a variant, `...Off`, for heights of instrument and target.
        is_raised: Whether these heights move its ends without such a variant.
        is_line: Whether a line of an OBS file can hold one: the others stand in files of their own.
        is_refracted: Whether its values are corrected for refraction, by the coefficient of the network.
        depends_on_place: Whether context or values change with the coordinates, even without heights and
            deflections.
        is_component: Whether it is one of the three of a vector or a position: the last three of its linear
            coefficients are its axis, in the frame.
        is_levelled: Whether it says how heights differ, and nothing of the plan.
        is_from_north: Whether it is an angle from north: it orients a network, and says nothing of its shape.
        is_of_circle: Whether it is read on the circle of an instrument, from a zero of the set-up.
        is_plumb: Whether, without an instrument, it is in the horizon of its first point.
        plain: The kind that becomes this one where a user asks for its unknowns; None for any other.
        with_unknowns: These unknowns, by the names of `estimating`.
        horizontal: The kind that it is where horizontal values were written for it; None if there is none.
        needs_deflections: Whether, where deflections of the vertical are given, both its ends need one.
    """

    name: str
    code: int
    words: str
    formula: str = ""
    is_angle: bool = False
    needs_station: bool = False
    orients: int = 0
    start: Start = Start.NOTHING
    first_place: FirstPlace = FirstPlace.NOTHING
    family: str = ""
    is_absolute: bool = False
    takes_heights: bool = False
    is_raised: bool = False
    is_line: bool = False
    is_refracted: bool = False
    depends_on_place: bool = False
    is_component: bool = False
    is_levelled: bool = False
    is_from_north: bool = False
    is_of_circle: bool = False
    is_plumb: bool = False
    plain: ObservationKind | None = field(default=None, compare=False, repr=False)
    with_unknowns: tuple[str, ...] = ()
    horizontal: ObservationKind | None = field(default=None, compare=False, repr=False)
    needs_deflections: bool = False

    @property
    def group(self) -> str:
        """Its family: what its observations are put together by."""
        return self.family or self.name

    @property
    def sense(self) -> str:
        """How its residual lies in the plan: "across" its sight, "along" it, or "" for neither."""
        if self.start is Start.HZ:
            return "across"
        return "along" if self.start in (Start.DISTANCE, Start.FLAT) else ""

    @property
    def unit(self) -> str:
        """Unit of value, sigma and residual in results."""
        return "rad" if self.is_angle else "m"

    @property
    def has_axes(self) -> bool:
        """Whether it is in axes that turn with the plumb line of its first point."""
        return self.needs_station or self.is_plumb

    def slopes(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray | None:
        """(n, 6) derivatives of its residual by both points through context and value; None for none."""
        return site.slopes_of_grid(rows, coordinates)

    def problem(self, value: float) -> str | None:
        """What is wrong with a value in its unit (rad or m), in words; None when nothing is."""
        if self.is_angle and abs(value) > FULL_TURN:
            return "is beyond one turn"
        return None

    def shared_unknowns(self, site: Site, rows: IntArray, coordinates: FloatArray) -> dict[str, Shared]:
        """The unknowns that a group of such observations has of its own, from the rows of one group."""
        return {}

    def start_values(
        self, values: FloatArray, from_heights: FloatArray, to_heights: FloatArray
    ) -> FloatArray:
        """What initial values make of values (k,): those between the points, on the axes of the station."""
        return values

    def equation(self, suffix: str) -> str | Kernel:
        """Its formula, or the variant of it that a suffix names."""
        return self.formula + suffix

    def is_linear(self, site: Site) -> bool:
        """Whether its equation is linear rows instead of its formula."""
        return not self.formula

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """The unknowns of its equation, by the names of the formula."""
        origins, targets = site.ends(rows)
        if not self.needs_station:
            return {"origin": origins, "target": targets}
        return {"station.centre": origins, "station.rotation": site.stations(rows), "target": targets}

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, k) what its equation takes before the value, at coordinates of the points."""
        return np.zeros((len(rows), 0))

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) values that its equation takes."""
        return site.measured(rows)
