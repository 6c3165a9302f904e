"""A network whose approximate coordinates count as true, with its instruments set up there."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError, ObseqError
from obseq.printable import listed
from obseq.survey.initial.approximations import sentences_of
from obseq.survey.initial.initial_values import InitialValues
from obseq.survey.initial.orienting import plumb_rotation
from obseq.survey.model import Orientation, automatic_fix
from obseq.survey.sights.steps import GIVEN

if TYPE_CHECKING:
    from obseq.arrays import BoolArray
    from obseq.survey.model import Points
    from obseq.survey.network import Network

MOST_NAMED = 10


def truth(network: Network) -> InitialValues:
    """Where points and instruments are, if the coordinates of the network are true.

    The zero of every horizontal circle points to the north of its place.

    Args:
        network: all its points have coordinates.

    Raises:
        InputError: a plumb instrument stands where there is no vertical.
    """
    points, book = network.points, network.book
    orientations = automatic_fix(book)
    stations = len(book.stations)
    if not network.frame.has_vertical and (orientations == Orientation.VERT.value).any():
        first = int(book.stations.observations(int(np.argmax(orientations == Orientation.VERT.value)))[0])
        raise InputError(f"{book.label(first)}: a #VERT station needs a frame in which there is a vertical")
    verticals = network.frame.vertical(points.coordinates[book.stations.origins])
    return InitialValues(
        coordinates=points.coordinates.copy(),
        rotations=plumb_rotation(verticals, np.zeros(stations)),
        g0=np.zeros(stations),
        orientations=orientations,
        point_steps=(GIVEN,) * len(points),
        station_steps=(GIVEN,) * stations,
        unplaced=(),
        expected_sigmas=np.zeros(len(points)),
    )


def placed(network: Network) -> Network:
    """The network with true coordinates for all points.

    Those of an adjustment where some have none, or placeholders, which are approximations at the origin or at
    another point (0 0 0, say) that an adjustment would not use; a warning says so of these. Other coordinates
    count, whatever the observed values are.

    Raises:
        InputError: the observations do not place such points, or contradict each other.
    """
    points = network.points
    unusable = ~points.has_coordinates | _are_placeholders(network)
    if not unusable.any():
        return network
    lacking = _lacking(points, unusable)
    try:
        adjustment = network.adjust()
    except ObseqError as error:
        raise InputError(f"{lacking}, and the observations do not place them: {error}") from error
    if adjustment.left_out:
        raise InputError(f"{lacking}; {adjustment.left_out[0].sentence}")
    if not adjustment.converged or adjustment.gross_errors:
        raise InputError(f"{lacking}, and the observed values do not agree with each other")
    rows = np.asarray(points.is_free.any(axis=1))
    coordinates = np.where(rows[:, None], adjustment.points.places, points.coordinates)
    unobserved = adjustment.points.points.is_invented & np.isnan(points.coordinates)
    invented = points.is_invented | unobserved
    book = network.book.warned(*sentences_of(adjustment.replaced))
    return replace(network, points=replace(points, coordinates=coordinates, invented=invented), book=book)


def _are_placeholders(network: Network) -> BoolArray:
    """(n,) free points at the origin of their system, or where another is, if an adjustment moves them."""
    points, there = network.points, network.given_points().coordinates
    _, which, counts = np.unique(there, axis=0, return_inverse=True, return_counts=True)
    is_shared = counts[which.reshape(-1)] > 1
    is_origin = (there[:, :2] == 0.0).all(axis=1)
    found = np.asarray(points.is_free.any(axis=1) & (is_shared | is_origin))
    if found.any():
        doubted = list(network.fieldwork.initial_values().replaced)
        found[np.setdiff1d(np.arange(len(points)), doubted)] = False
    return found


def with_values(network: Network, values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Network:
    """The network with other observed values (n,), m or rad."""
    observations = replace(network.book.observations, values=values)
    return replace(network, book=replace(network.book, observations=observations))


def _lacking(points: Points, unusable: BoolArray) -> str:
    """What is wrong with a network some of whose points have no coordinates, or placeholders."""
    names = [name for name, is_one in zip(points.names, unusable, strict=True) if is_one]
    has_none = not points.has_coordinates[unusable].any()
    have = "have none: add them to" if has_none else "have none, or a placeholder (0 0 0): correct them in"
    told = f"{listed(names, MOST_NAMED)} {have} the point file"
    return f"planning needs approximate coordinates of all points; {told}"
