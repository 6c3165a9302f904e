"""A network whose approximate coordinates count as true, with its instruments set up there."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError, ObseqError
from obseq.printable import listed
from obseq.survey.initial.initial_values import InitialValues
from obseq.survey.initial.orienting import plumb_rotation
from obseq.survey.initial.steps import GIVEN
from obseq.survey.model import Orientation, automatic_fix

if TYPE_CHECKING:
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
    if not network.frame.has_vertical and (orientations == Orientation.VERT).any():
        first = int(book.stations.observations(int(np.argmax(orientations == Orientation.VERT)))[0])
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
    """The network with coordinates for all points: where some have none, those of an adjustment.

    Raises:
        InputError: the observations do not place them, or contradict each other.
    """
    if network.points.has_coordinates.all():
        return network
    try:
        adjustment = network.adjust()
    except ObseqError as error:
        raise InputError(f"{_lacking(network)}, and the observations do not place them: {error}") from error
    if adjustment.left_out:
        raise InputError(f"{_lacking(network)}; {adjustment.left_out[0].sentence()}")
    if not adjustment.is_honest:
        raise InputError(f"{_lacking(network)}, and the observed values do not agree with each other")
    rows = np.asarray(network.points.is_free.any(axis=1))
    coordinates = np.where(rows[:, None], adjustment.points.coordinates, network.points.coordinates)
    return replace(network, points=replace(network.points, coordinates=coordinates))


def with_values(network: Network, values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Network:
    """The network with other observed values (n,), m or rad."""
    observations = replace(network.book.observations, values=values)
    return replace(network, book=replace(network.book, observations=observations))


def _lacking(network: Network) -> str:
    """What is wrong with a network some of whose points have no coordinates."""
    points = network.points
    lacking = [name for name, has in zip(points.names, points.has_coordinates, strict=True) if not has]
    return (
        f"planning needs approximate coordinates of all points; {listed(lacking, MOST_NAMED)} have "
        "none: add them to the point file"
    )
