"""The computation frame of a network: where it is on the Earth, and what can be observed in it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from obseq import crs
from obseq.arrays import FloatArray, IndexArray, IntArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.survey.equations.surroundings import Recent, Surroundings
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.model import FieldBook, Points

RTL_HINT = "compute in a local tangent frame (--frame RTL*X0*Y0*Z0*DEFINITION)"
MEAN_RADIUS = 6371008.8
"""Radius (m) of the Earth where its place is not known: the mean one of GRS 80."""

SHORTEST = 1e-9
"""Length (m) that stands for shorter ones in a division."""

UPRIGHT = np.broadcast_to(np.eye(3), (2**40, 3, 3))
"""The unit matrix, as often as there are points."""

_LARGEST_COEFFICIENT = 1.0
"""Refraction coefficients beyond it, in size, are mistakes: at 1 rays are as curved as the Earth."""
_FARTHEST = 1000.0
"""Distance from the middle of the points, in typical ones, beyond which a point has no part in the origin."""


@dataclass(frozen=True)
class Frame:
    """The coordinate system of the computation.

    The vertical of a station (its local east, north and up) is that of the ellipsoid to which the heights of
    the points refer in RTL systems (`obseq.crs.Ground`). In a Local system, a plane with heights, all
    verticals are parallel to z, and zenith angles are corrected for the curvature of the Earth. Elsewhere a
    `#FIX` station has the axes of the system.

    Attributes:
        system: The coordinate system.
        refraction_coefficient: k of zenith angles: rays are arcs of radius (radius of the Earth) / k.
    """

    system: crs.CoordinateSystem
    refraction_coefficient: float = crs.REFRACTION_COEFFICIENT

    def __post_init__(self) -> None:
        """Refuses a coefficient that no air has.

        Raises:
            InputError: It is beyond 1, or below -1.
        """
        if not abs(self.refraction_coefficient) <= _LARGEST_COEFFICIENT:
            raise InputError(
                f"refraction coefficient {self.refraction_coefficient:g}: air bends rays by -1 to 1, "
                "commonly by 0.07 to 0.2 (0.12 when nothing is said; 0: no refraction; 1: neither refraction "
                "nor curvature); correct it"
            )

    @property
    def is_plane(self) -> bool:
        """Whether it is a plane with heights, without a place on the Earth."""
        return self.system.kind is crs.Kind.LOCAL

    @property
    def has_place(self) -> bool:
        """Whether it has a place on the Earth."""
        return not self.is_plane

    @property
    def is_geocentric(self) -> bool:
        """Whether its axes are those of the Earth, of which none is up or to the north anywhere."""
        return self.system.kind is crs.Kind.GEOCENTRIC

    @property
    def has_vertical(self) -> bool:
        """Whether stations have a vertical."""
        return self.is_plane or self.system.kind is crs.Kind.LOCAL_TANGENT

    def vertical(self, points: FloatArray) -> FloatArray:
        """(n, 3, 3) rotations from the frame to east, north, up at points; identity without vertical."""
        if self.has_turning_vertical:
            return self.system.vertical_rotation(points)
        return UPRIGHT[: len(points)]

    def around(self, coordinates: FloatArray) -> Surroundings:
        """What a frame with a place on the Earth has at coordinates (n, 3).

        Many ask about the same coordinates one after the other: what was found for the last ones is kept.
        """
        return self._recent.of(coordinates)

    @cached_property
    def _recent(self) -> Recent[Surroundings]:
        """The surroundings last asked for."""
        return Recent(partial(Surroundings, self.system))

    def verticals(self, rows: IntArray | IndexArray, coordinates: FloatArray) -> FloatArray:
        """(k, 3, 3) `vertical` of some points, at the coordinates (n_points, 3) of all."""
        if self.has_turning_vertical:
            return np.asarray(self.around(coordinates).verticals[rows])
        return self.vertical(coordinates[rows])

    def turns(self, rows: IntArray | IndexArray, coordinates: FloatArray) -> FloatArray:
        """(k, 3, 3) what east, north, up of points turn by when these move, in the frame (rad per m).

        Columns are those of the movement; deflections of the vertical do not change them.
        """
        if not self.has_turning_vertical:
            return np.zeros((len(rows), 3, 3))
        return np.asarray(self.around(coordinates).turns[rows])

    @property
    def has_turning_vertical(self) -> bool:
        """Whether stations have a vertical, which turns from place to place."""
        return self.system.kind is crs.Kind.LOCAL_TANGENT

    @property
    def plumb(self) -> Callable[[FloatArray], FloatArray] | None:
        """What gives the vertical of points; None in a system without."""
        if not self.has_vertical:
            return None
        return crs.Normals(self.system) if isinstance(self.system, crs.RigidSystem) else self.vertical

    @property
    def bend(self) -> float:
        """About what `refraction` is for each metre of a distance (rad / m)."""
        if not (self.has_vertical or self.is_plane):
            return 0.0
        return (self.refraction_coefficient - self.is_plane) / (2.0 * MEAN_RADIUS)

    def refraction(self, book: FieldBook, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) corrections (rad) of some zenith angles, at the coordinates (n_points, 3) given.

        They are for refraction; in a plane for curvature as well, which makes them (k - 1) D / (2 R).
        """
        distances, radii = self._arcs(book, rows, coordinates)
        coefficient = self.refraction_coefficient - (1.0 if self.is_plane else 0.0)
        return np.asarray(coefficient * distances / (2.0 * radii))

    def refraction_of_one(self, book: FieldBook, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) what a coefficient of 1 adds to these corrections (rad)."""
        distances, radii = self._arcs(book, rows, coordinates)
        return np.asarray(distances / (2.0 * radii))

    def slopes_of_refraction(self, book: FieldBook, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 6) derivatives of `refraction_of_one` by the two points."""
        origins, targets = book.observations.from_points[rows], book.observations.to_points[rows]
        if self.is_plane:
            plan = (coordinates[targets] - coordinates[origins]) * (1.0, 1.0, 0.0)
            along = plan / np.maximum(np.linalg.norm(plan, axis=1), SHORTEST)[:, None]
            return np.hstack([-along, along]) / (2.0 * MEAN_RADIUS)
        rotation, _ = self.to_geocentric(book, rows)
        around = self.around(coordinates)
        place, up = around.geodetic[origins], around.verticals[origins][:, 2] @ rotation.T
        slopes = crs.slopes_of_arc(around.geocentric[origins], around.geocentric[targets], place, up)
        return np.hstack([slope @ rotation for slope in slopes])

    def _arcs(
        self, book: FieldBook, rows: IntArray, coordinates: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """(n,) horizontal lengths of sights, and (n,) radii of the Earth below them."""
        observations = book.observations
        origins, targets = observations.from_points[rows], observations.to_points[rows]
        if self.is_plane:
            plan = (coordinates[targets] - coordinates[origins])[:, :2]
            return np.hypot(*plan.T), np.full(len(rows), MEAN_RADIUS)
        if not rows.size:
            return np.zeros(0), np.ones(0)
        try:
            around = self.around(coordinates)
            place = around.geodetic[origins]
            return crs.arc_and_radius(around.geocentric[origins], around.geocentric[targets], place)
        except crs.CrsError as error:
            raise InputError(
                f"{book.label(rows[0])}: a zenith angle is corrected for refraction, which needs a place on "
                f"the Earth; {RTL_HINT} ({error})"
            ) from error

    def to_geocentric(self, book: FieldBook, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        """Rotation (3, 3) and translation (3,) of the frame to geocentric coordinates, for observations."""
        try:
            return self.system.geocentric_pose()
        except crs.CrsError as error:
            kind = BY_CODE[int(book.observations.types[rows[0]])]
            raise InputError(
                f"{book.label(rows[0])}: {kind.words} needs a Euclidean frame with a place on the Earth; "
                f"{RTL_HINT} ({error})"
            ) from error

    def to_ground(self, book: FieldBook, rows: IntArray) -> tuple[float, ...]:
        """What leads to the ellipsoid to which heights refer, for observations.

        Rotation (9) and translation (3) of the frame to its axes, its equatorial radius and its squared
        eccentricity.
        """
        self.to_geocentric(book, rows)
        assert isinstance(self.system, crs.RigidSystem)
        ground, (rotation, translation) = self.system.ground, self.system.ground_pose()
        shape = ground.equatorial, ground.squared_eccentricity
        return (*rotation.ravel().tolist(), *translation.tolist(), *shape)

    def sphere(self, book: FieldBook, rows: IntArray) -> tuple[FloatArray, float]:
        """Centre (3,) in the frame, and radius, of the sphere that stands for height 0, for observations.

        It is below the origin of the frame, with the mean curvature there.
        """
        if self.is_plane:
            return np.array([0.0, 0.0, -MEAN_RADIUS]), MEAN_RADIUS
        self.to_geocentric(book, rows)
        return self._sphere_below

    @cached_property
    def _sphere_below(self) -> tuple[FloatArray, float]:
        """That sphere of a Euclidean frame with a place on the Earth."""
        _, latitude, height = self.around(np.zeros((1, 3))).geodetic[0]
        radius = float(crs.curvature_radius(latitude))
        up = self.system.vertical_rotation(np.zeros((1, 3)))[0, 2]
        return np.asarray(-(radius + height) * up), radius


def frame_of(
    definition: str | None, points_crs: str | None, points: Points
) -> tuple[crs.CoordinateSystem, crs.CoordinateSystem]:
    """The system of the computation and that of the points, from their definitions.

    Without either, the computation is in a plane with heights (Local). Without a system of the points they
    are in the frame. Without a frame it is that of the points where one can compute in it, else a local
    tangent frame at the mean of the known points. A bare `RTL` has its origin at the mean of all points.
    Points that lie far away from the others do not count in a mean.

    Args:
        definition: Definition of the frame.
        points_crs: Definition of the system of the points.
        points: The points, in their system; those without coordinates do not count in a mean.
    """
    frame, given = _systems_of(definition, points_crs, points)
    placed = crs.side_by_side(points.coordinates[points.has_coordinates], given)
    if isinstance(frame, crs.RigidSystem) and given.kind is crs.Kind.PROJ and len(placed):
        is_own = isinstance(frame, crs.LocalTangent) and frame.base == given
        frame = frame if is_own else frame.with_heights_of(given, np.median(placed, axis=0))
    return frame, given


def _systems_of(
    definition: str | None, points_crs: str | None, points: Points
) -> tuple[crs.CoordinateSystem, crs.CoordinateSystem]:
    """The systems as they are defined: the heights of the frame are not yet those of the points."""
    given = crs.parse(points_crs) if points_crs else None
    if given is not None:
        _require_angles(given, points)
    if definition is None:
        if given is None or given.kind in (crs.Kind.LOCAL, crs.Kind.LOCAL_TANGENT):
            frame = _frame_like(given)
            return (frame, given or frame) if frame.is_complete else _systems_of("RTL", None, points)
        known = points.has_coordinates & ~points.is_free.all(axis=1)
        chosen = points.coordinates[known if known.any() else points.has_coordinates]
        return crs.complete_rtl(_together(chosen, given), given), given
    frame = crs.parse(definition)
    if frame.is_complete:
        return frame, given or frame
    if given is None:
        raise InputError("the frame RTL takes its origin from the points: say their system (--points-crs)")
    if not points.has_coordinates.any():
        raise InputError("the frame RTL takes its origin from the points, and none has coordinates")
    return crs.complete_rtl(_together(points.coordinates[points.has_coordinates], given), given), given


def _require_angles(given: crs.CoordinateSystem, points: Points) -> None:
    """Refuses coordinates in metres where longitude and latitude are expected."""
    unit = given.plan_unit
    if not unit.is_angle:
        return
    beyond = np.flatnonzero((np.abs(points.coordinates[:, :2]) * unit.factor > 2.0 * np.pi).any(axis=1))
    if beyond.size:
        first = int(beyond[0])
        values = ", ".join(f"{value:.10g}" for value in points.coordinates[first, :2])
        raise InputError(
            f"point {points.names[first]} ({points.place(first)}): {values} are no longitude and latitude in "
            f"{unit.name}, which {given.definition} takes. They look like metres: name their own system "
            "(--points-crs EPSG:2154, for instance), or none for a local site"
        )


def _frame_like(given: crs.CoordinateSystem | None) -> crs.CoordinateSystem:
    """The frame of points in a Local or RTL system or in none: that system; a plane has x to the east."""
    plane = crs.parse("Local")
    if given is None:
        return plane
    is_plane = isinstance(given, crs.UnreferencedSystem) and given.turn_to(plane) is not None
    return plane if is_plane else given


def _together(coordinates: FloatArray, given: crs.CoordinateSystem) -> FloatArray:
    """The points (n, 3) that lie together: an approximation of 0 0 0 does not move the origin of a frame."""
    coordinates = crs.side_by_side(coordinates, given)
    away = np.linalg.norm(coordinates[:, :2] - np.median(coordinates[:, :2], axis=0), axis=1)
    near = away <= _FARTHEST * max(float(np.median(away)), 1e-3)
    return np.asarray(coordinates[near])


def area_warning(system: crs.CoordinateSystem, points: Points) -> str | None:
    """What to say of known points outside the area of their system; of all points where none is known.

    Approximate coordinates may be placeholders, such as 0 0 0.
    """
    known = points.has_coordinates & ~points.is_free.all(axis=1)
    rows = np.flatnonzero(known if known.any() else points.has_coordinates)
    return crs.area_warning(system, points.coordinates[rows], [points.names[row] for row in rows.tolist()])
