"""Tilted set-ups that share points are one body; known heights of three of these say what is vertical.

Nothing of such a set-up is plumb, and no three points that it sees need be placed. Turned upright, the body
is a local frame as any other (`local_frames`).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from obseq.arrays import FloatArray
from obseq.geometry import isometry
from obseq.survey.initial.orienting import LEAST_SPREAD, centred, spread
from obseq.survey.initial.relations import free_direction
from obseq.survey.sights.sight_graph import SightGraph


class Body(NamedTuple):
    """Points in the axes of a tilted set-up, in any place.

    Attributes:
        stations: whose vectors they are.
        places: (3,) of each point, metres.
        rows: observations of each point.
    """

    stations: list[int]
    places: dict[int, FloatArray]
    rows: dict[int, tuple[int, ...]]


def bodies(graph: SightGraph, stations: Iterable[int]) -> list[Body]:
    """The bodies that tilted set-ups make: those that share three points, not on a line, are one."""
    alone = {station: _seen(graph, station) for station in stations}
    found = []
    while alone:
        first = max(alone, key=lambda station: len(alone[station].places))
        found.append(_grown(alone.pop(first), alone))
    return found


def _seen(graph: SightGraph, station: int) -> Body:
    """A set-up and the points of its complete vectors."""
    body = Body([station], {graph.origins[station]: np.zeros(3)}, {graph.origins[station]: ()})
    for number in graph.sights_from[station]:
        sight = graph.sights[number]
        vector = free_direction(sight)
        if vector is not None and vector[1]:
            body.places.setdefault(sight.target, np.array(vector[0][0]))
            body.rows.setdefault(sight.target, vector[0][1])
    return body


def _grown(body: Body, alone: dict[int, Body]) -> Body:
    """The body with all that hang on it; these are taken from `alone`."""
    seeing: dict[int, list[int]] = {}
    for station, other in alone.items():
        for point in other.places:
            seeing.setdefault(point, []).append(station)
    shared: Counter[int] = Counter()
    waiting = list(body.places)
    while waiting:
        for station in seeing.get(waiting.pop(), ()):
            shared[station] += 1
            if shared[station] >= 3 and station in alone and _takes(body, alone[station], waiting):
                del alone[station]
    return body


def _takes(body: Body, other: Body, waiting: list[int]) -> bool:
    """Takes another body in, if it can; its further points wait for those that see them."""
    common = [point for point in other.places if point in body.places]
    theirs, ours = (np.array([each.places[point] for point in common]) for each in (other, body))
    if spread(centred(theirs), centred(ours)) <= LEAST_SPREAD**2:
        return False
    pose = isometry(theirs, ours)
    new = [point for point in other.places if point not in body.places]
    body.places.update((point, pose.to_world(other.places[point])) for point in new)
    body.rows.update((point, other.rows[point]) for point in new)
    body.stations.extend(other.stations)
    waiting.extend(new)
    return True


def uprights(places: FloatArray, heights: FloatArray) -> list[FloatArray]:
    """Rotations (3, 3) of a body to a plumb frame of any azimuth: two, mirrored in the plane of its points.

    Args:
        places: (n, 3) points of the body, metres.
        heights: (n,) of them above anything.

    Returns:
        None of them where the points are on a line.
    """
    if len(heights) < 3:
        return []
    left, sizes, axes = np.linalg.svd(centred(places), full_matrices=False)
    if sizes[1] <= LEAST_SPREAD * sizes[0]:
        return []
    along = (left[:, :2].T @ (heights - heights.mean())) / sizes[:2]
    out = math.sqrt(max(1.0 - float(along @ along), 0.0))
    return [_with_up((*along.tolist(), side), axes) for side in (out, -out)]


def _with_up(parts: Sequence[float], axes: FloatArray) -> FloatArray:
    """The rotation that makes a direction, by its parts along three axes (rows), the vertical."""
    up = parts @ axes / np.linalg.norm(parts)
    east = np.cross(np.eye(3)[np.argmin(np.abs(up))], up)
    east /= np.linalg.norm(east)
    return np.array([east, np.cross(up, east), up])
