"""Survey observations in the system of a block: points of one name are one point."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.stopwatch import Stopwatch
from obseq.survey.adjustment.computation import Computation
from obseq.survey.adjustment.joint_groups import joint_groups
from obseq.survey.adjustment.quality import Examination, Quality
from obseq.survey.equations.equations import Equations
from obseq.survey.initial.left_out import Determined
from obseq.survey.model import Orientation

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from obseq.arrays import FloatArray, IntArray
    from obseq.images.adjustment.equations import Equations as BlockEquations
    from obseq.images.adjustment.start import Start
    from obseq.leastsquares import Batch, LeastSquares, LeastSquaresResult, Reliability
    from obseq.survey import Adjustment, InitialValues, Network

WHOLE = "part of an adjustment of more than this network: counts, sigma0 and its test are of all of it"


@dataclass(frozen=True, eq=False)
class JoinedSurvey:
    """A survey network that shares points with a block.

    Attributes:
        network: the network.
        initial: where its points and stations start.
        equations: its part of the system.
    """

    network: Network
    initial: InitialValues
    equations: Equations

    def coordinates(self, result: LeastSquaresResult) -> FloatArray:
        """(n, 3) adjusted coordinates of the points of the network, in its frame."""
        return result.values(self.equations.points)

    def residuals(self, result: LeastSquaresResult) -> FloatArray:
        """(m,) computed minus observed, metres and radians; NaN for inactive observations."""
        found = np.full(len(self.network.book.observations), np.nan)
        for rows, batch in self.equations.batches.values():
            found[rows] = result.residuals(batch)[:, 0]
        return found

    def adjusted(self, result: LeastSquaresResult, tests: Reliability | None) -> Adjustment:
        """The network as `Network.adjust` gives it, by a solution of the whole system.

        Args:
            result: with covariances.
            tests: of all observations of the system; None where they were not made.
        """
        network, equations, own = self.network, self.equations, self.batches()
        if tests is not None:
            of_network = [part for part in tests.observations if part.source in own]
            tests = replace(tests, observations=tuple(of_network), constraints=())
        computation = Computation(
            network.frame, network.points_crs, network.unit_sigma, 0, 0.0, Stopwatch(), Quality()
        )
        start = Determined(network.points, network.book, self.initial)
        found = computation.described(start, equations, Examination(Quality(), result, tests))
        return replace(found, phases=network.phases, shown=network.shown, notes=(*found.notes, WHOLE))

    def batches(self) -> list[Batch]:
        """Of its observations, then of its known coordinates."""
        return [*(batch for _, batch in self.equations.batches.values()), *self.equations.known.places()]

    def groups(self) -> dict[Batch, list[IntArray]]:
        """By batch, the observations that are tested as one: vectors, and positions with a covariance."""
        return joint_groups(self.equations, self.network.book)


def with_surveys(networks: Sequence[Network], start: Start) -> tuple[Start, list[InitialValues]]:
    """The start of a block, completed by survey networks, and their own initial values.

    What the images place serves the networks as approximations, and the other way round. A point of a network
    that is called like an image is its projection centre.

    Raises:
        InputError: a network cannot be placed, or a point of the block has no coordinates in the end.
    """
    if not networks and np.isfinite(start.coordinates).all():
        return start, []
    coordinates = start.coordinates.copy()
    initial = []
    for network in networks:
        row_of = {name: row for row, name in enumerate(start.points)}
        shared = [(row, row_of[name]) for row, name in enumerate(network.points.names) if name in row_of]
        known = network.points.coordinates.copy()
        centre_of = dict(zip(start.poses.images, start.poses.centres, strict=True))
        for own, name in enumerate(network.points.names):
            if name in centre_of:
                known[own] = centre_of[name]
        for own, other in shared:
            if not np.isfinite(known[own]).all():
                known[own] = coordinates[other]
        # all heights are unknowns: the images may observe those that the survey does not
        book = network.book.without(network.book.of_cameras)
        work = replace(network.fieldwork, points=replace(network.points, coordinates=known), book=book)
        found = work.initial_values()
        found.require_complete()
        found = _with_cameras(found, network, start)
        for own, other in shared:
            if not np.isfinite(coordinates[other]).all():
                coordinates[other] = found.coordinates[own]
        initial.append(found)
    lost = np.flatnonzero(~np.isfinite(coordinates).all(axis=1))
    if lost.size:
        raise InputError(
            f"point {start.points[lost[0]]}: nothing gives it a place ({lost.size} points have none); "
            "measure it in two images, or give approximate coordinates"
        )
    return replace(start, coordinates=coordinates), initial


def _with_cameras(found: InitialValues, network: Network, start: Start) -> InitialValues:
    """The initial values with the stations that are cameras turned as their images.

    Raises:
        InputError: a station is a camera, and no image is called like its point.
    """
    stations = network.book.stations
    cameras = np.flatnonzero(stations.orientations == Orientation.CAM.value)
    if not cameras.size:
        return found
    turned = dict(zip(start.poses.images, start.poses.rotations, strict=True))
    names = [network.points.names[origin] for origin in stations.origins[cameras]]
    if unknown := [name for name in names if name not in turned]:
        raise InputError(f"station {unknown[0]} is a camera (#CAM), but no image is called so")
    rotations, orientations = found.rotations.copy(), found.orientations.copy()
    rotations[cameras] = [turned[name] for name in names]
    orientations[cameras] = Orientation.CAM.value
    return replace(found, rotations=rotations, orientations=orientations)


def places_in(start: Start, equations: BlockEquations) -> Iterator[tuple[str, int]]:
    """Names and blocks of the points and the projection centres of a block in its system."""
    yield from zip(start.points, map(int, equations.points), strict=True)
    yield from zip(start.poses.images, map(int, equations.centres), strict=True)


def join_surveys(
    networks: Sequence[Network],
    initial: Sequence[InitialValues],
    system: LeastSquares,
    shared: Iterable[tuple[str, int]],
    turned: Mapping[str, int] | None = None,
) -> list[JoinedSurvey]:
    """Adds networks to a system that has points already, and rotations of images.

    Args:
        networks: the networks.
        initial: their initial values.
        system: the system.
        shared: name and block of each point that it has.
        turned: block of the rotation of each image, which stations that are cameras have too.
    """
    parts, known = [], dict(shared) if networks else {}
    for network, found in zip(networks, initial, strict=True):
        equations = Equations(
            network.frame,
            network.point_system,
            network.points,
            network.book,
            found,
            system,
            known,
        )
        known |= dict(zip(network.points.names, map(int, equations.points), strict=True))
        _tie_cameras(system, network, equations, turned or {})
        parts.append(JoinedSurvey(network, found, equations))
    return parts


def _tie_cameras(
    system: LeastSquares, network: Network, equations: Equations, turned: Mapping[str, int]
) -> None:
    """Makes stations that are cameras turn with their images, which they are turned as."""
    stations = network.book.stations
    cameras = np.flatnonzero(stations.orientations == Orientation.CAM.value)
    if cameras.size:
        names = [network.points.names[origin] for origin in stations.origins[cameras]]
        own = np.repeat(equations.instruments.ids[cameras], 3)
        images = np.repeat([turned[name] for name in names], 3)
        unit = np.tile(np.eye(3), (len(names), 1))
        labels = [f"station {name} = image, {axis}" for name in names for axis in "xyz"]
        none = np.zeros(len(unit))
        system.constrain_linear([own, images], [unit, -unit], none, labels, is_tangent=True)


def follower(parts: Sequence[JoinedSurvey]) -> Callable[[LeastSquares, int], None] | None:
    """What turns stations with their verticals before each iteration; None without surveys."""
    if not parts:
        return None

    def follow(system: LeastSquares, iteration: int) -> None:
        for part in parts:
            part.equations.follow(system, iteration)

    return follow
