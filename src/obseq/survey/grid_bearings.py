"""Bearings from grid north, as programs that compute on a map write them, turned to azimuths."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.survey.kinds.directions import AZIM

if TYPE_CHECKING:
    import numpy.typing as npt

    from obseq.arrays import FloatArray
    from obseq.survey.network import Network

    Rows = npt.NDArray[np.intp]


def from_grid_north(network: Network) -> Network:
    """The network, whose azimuths were bearings of the map, as azimuths from geographic north.

    A bearing is the angle of the straight line between two points on the map. It becomes the azimuth of the
    sight between them: with the convergence of the meridian, and what the sight is curved on the map. Where
    points are not known, first values from the observations are good enough.
    """
    rows = np.flatnonzero(network.book.observations.types == AZIM.code)
    system, frame = network.points_crs, network.frame.system
    is_map = system.kind is crs.Kind.PROJ and not system.is_geographic
    if not rows.size or not is_map or not isinstance(frame, crs.LocalTangent):
        return network
    if not network.points.has_coordinates.any():
        return network
    xyz = network.points.coordinates
    middle = xyz[network.points.has_coordinates].mean(axis=0)
    near = _turned(network, rows, np.full(len(rows), _turn(network, middle[None], middle[None])[0]))
    if not network.points.has_coordinates.all():
        xyz = near.fieldwork.initial_values().coordinates
        xyz = np.where(np.isfinite(xyz), xyz, middle)
    observations = network.book.observations
    ends = xyz[observations.from_points[rows]], xyz[observations.to_points[rows]]
    turns = _turn(network, *ends)
    largest = turns[np.abs(turns).argmax()]
    bearings = f"{len(rows)} bearings are" if len(rows) > 1 else "1 bearing is"
    text = (
        f"{bearings} from grid north of {system.definition}, as the program of the file takes them: up to "
        f"{np.rad2deg(largest):.5f} degrees are added for azimuths from geographic north"
    )
    found = _turned(network, rows, turns)
    return replace(found, book=found.book.warned(text))


def _turned(network: Network, rows: Rows, turns: FloatArray) -> Network:
    """The network with turns (rad) added to some observations."""
    values = network.book.observations.values.copy()
    values[rows] = np.remainder(values[rows] + turns, 2.0 * np.pi)
    observations = replace(network.book.observations, values=values)
    return replace(network, book=replace(network.book, observations=observations))


def _turn(network: Network, origins: FloatArray, targets: FloatArray) -> FloatArray:
    """(n,) azimuths of sights minus their bearings on the map (rad); the convergence where there is no sight."""
    axes = network.frame.vertical(origins)
    sights = targets - origins
    lengths = np.linalg.norm(sights, axis=1)
    short = lengths < 1.0
    sights[short] = 100.0 * axes[short, 1]  # to the north
    east, north, _ = np.einsum("nij,nj->in", axes, sights)
    start, end = (network.point_system.coordinates(points) for points in (origins, origins + sights))
    on_map = end - start
    turn = np.arctan2(east, north) - np.arctan2(on_map[:, 0], on_map[:, 1])
    return np.asarray(np.remainder(turn + np.pi, 2.0 * np.pi) - np.pi)
