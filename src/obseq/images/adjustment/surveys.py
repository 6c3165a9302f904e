"""Survey observations in the system of a block: points of one name are one point."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.survey.adjustment.equations import Equations

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from obseq.arrays import FloatArray
    from obseq.images.adjustment.equations import Equations as BlockEquations
    from obseq.images.adjustment.start import Start
    from obseq.leastsquares import LeastSquares, LeastSquaresResult
    from obseq.survey import InitialValues, Network


@dataclass(frozen=True, eq=False)
class JoinedSurvey:
    """A survey network that shares points with a block.

    Attributes:
        network: the network.
        equations: its part of the system.
    """

    network: Network
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
        work = replace(network.fieldwork, points=replace(network.points, coordinates=known))
        found = work.initial_values()
        found.require_complete()
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


def places_in(start: Start, equations: BlockEquations) -> Iterator[tuple[str, int]]:
    """Names and blocks of the points and the projection centres of a block in its system."""
    yield from zip(start.points, map(int, equations.points), strict=True)
    yield from zip(start.poses.images, map(int, equations.centres), strict=True)


def join_surveys(
    networks: Sequence[Network],
    initial: Sequence[InitialValues],
    system: LeastSquares,
    shared: Iterable[tuple[str, int]],
) -> list[JoinedSurvey]:
    """Adds networks to a system that has the points `shared` (name, block) already."""
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
        parts.append(JoinedSurvey(network, equations))
    return parts


def follower(parts: Sequence[JoinedSurvey]) -> Callable[[LeastSquares, int], None] | None:
    """What turns stations with their verticals before each iteration; None without surveys."""
    if not parts:
        return None

    def follow(system: LeastSquares, iteration: int) -> None:
        for part in parts:
            part.equations.follow(system, iteration)

    return follow
