"""Bearings from grid north, as programs that compute on a map write them, turned to azimuths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from obseq import crs
from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.survey.equations.frame import RTL_HINT
from obseq.survey.fieldwork import Fieldwork
from obseq.survey.kinds.registry import among, codes_where
from obseq.survey.model import FieldBook

Rows = npt.NDArray[np.intp]


def from_grid_north(fieldwork: Fieldwork) -> FieldBook:
    """The observations, whose azimuths were bearings of the map, with azimuths from geographic north.

    A bearing is the angle of the straight line between two points on the map. It becomes the azimuth of the
    sight between them: with the convergence of the meridian, and what the sight is curved on the map. Where
    points are not known, first values from the observations are good enough.

    Raises:
        InputError: the frame of the computation is on the Earth, and its stations have no vertical.
    """
    book, points, system = fieldwork.book, fieldwork.points, fieldwork.points_crs
    rows = np.flatnonzero(among(book.observations.types, codes_where(lambda kind: kind.is_from_north)))
    is_map = system.kind is crs.Kind.PROJ and not system.is_geographic
    is_rigid = isinstance(fieldwork.frame.system, crs.RigidSystem)
    if not (rows.size and is_map and is_rigid and points.has_coordinates.any()):
        return book
    if not fieldwork.frame.has_vertical:
        raise InputError(
            f"{book.label(rows[0])}: a bearing from grid north becomes an azimuth in the horizon of its "
            f"station, which the frame {fieldwork.frame.system.definition} does not have; {RTL_HINT}"
        )
    xyz = _places(fieldwork, rows)
    turns = _turn(fieldwork, xyz[book.observations.from_points[rows]], xyz[book.observations.to_points[rows]])
    bearings = f"{len(rows)} bearings are" if len(rows) > 1 else "1 bearing is"
    largest = np.rad2deg(turns[np.abs(turns).argmax()])
    return _turned(book, rows, turns).warned(
        f"{bearings} from grid north of {system.definition}, as the program of the file takes them: up to "
        f"{largest:.5f} degrees are added for azimuths from geographic north"
    )


def _places(fieldwork: Fieldwork, rows: Rows) -> FloatArray:
    """(n, 3) coordinates of all points; of those that nothing places yet, the middle of the others."""
    points = fieldwork.points
    xyz, is_placed = points.coordinates, points.has_coordinates
    middle = xyz[is_placed].mean(axis=0)
    if not is_placed.all():
        turns = np.repeat(_turn(fieldwork, middle[None], middle[None]), len(rows))
        near = replace(fieldwork, book=_turned(fieldwork.book, rows, turns))
        xyz = near.initial_values().coordinates
    return np.where(np.isfinite(xyz), xyz, middle)


def _turned(book: FieldBook, rows: Rows, turns: FloatArray) -> FieldBook:
    """The observations, with turns (rad) added to some."""
    values = book.observations.values.copy()
    values[rows] = np.remainder(values[rows] + turns, 2.0 * np.pi)
    return replace(book, observations=replace(book.observations, values=values))


def _turn(fieldwork: Fieldwork, origins: FloatArray, targets: FloatArray) -> FloatArray:
    """(n,) azimuths of sights minus their bearings on the map (rad); of no sight, the convergence."""
    axes = fieldwork.frame.vertical(origins)
    sights = targets - origins
    is_short = np.linalg.norm(sights, axis=1) < 1.0
    sights[is_short] = 100.0 * axes[is_short, 1]  # to the north
    east, north, _ = np.einsum("nij,nj->in", axes, sights)
    start, end = (fieldwork.point_system.coordinates(points) for points in (origins, origins + sights))
    on_map = end - start
    turn = np.arctan2(east, north) - np.arctan2(on_map[:, 0], on_map[:, 1])
    return np.asarray(np.remainder(turn + np.pi, 2.0 * np.pi) - np.pi)
