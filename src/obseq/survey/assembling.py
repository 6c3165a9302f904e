"""Points on their way into a network: into its frame, and with the deflections of a geoid."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from obseq import crs
from obseq.arrays import FloatArray
from obseq.crs import CoordinateSystem
from obseq.errors import InputError
from obseq.survey import files
from obseq.survey.equations.frame import Frame, area_warning, frame_of
from obseq.survey.equations.point_system import PointSystem
from obseq.survey.initial.plan_only import with_heights_of_site
from obseq.survey.model import FieldBook, Points


def in_frame(
    points: Points, book: FieldBook, frame: str | None, points_crs: str | None
) -> tuple[Points, CoordinateSystem, CoordinateSystem, str | None]:
    """The points in the computation frame, that frame, the system of the points, and what is to be told."""
    if points_crs is None or crs.parse(points_crs).kind is not crs.Kind.GEOCENTRIC:
        points = with_heights_of_site(points, book)
    computation, given = frame_of(frame, points_crs, points)
    placed, system = points.has_coordinates, PointSystem(computation, given)
    # of a point without plan, the height means something in a plane only
    coordinates = system.parts(points.coordinates)
    names = [points.names[row] for row in np.flatnonzero(placed)]
    coordinates[placed] = system.placed(points.coordinates[placed], names)
    placed_points = replace(points, coordinates=coordinates)
    return placed_points, computation, given, area_warning(given, points)


def deflected(
    points: Points, xyz: FloatArray, frame: Frame, geoid: str | Path
) -> tuple[Points, tuple[str, ...]]:
    """The points with deflections of the vertical of a geoid where they have none, and what is to be told.

    Args:
        points: The points.
        xyz: (n, 3) where they are in the frame; those that are not known are looked up in the middle.
        frame: The computation frame.
        geoid: The file.

    Raises:
        InputError: The geoid says nothing of the points.
    """
    xyz = np.where(np.isfinite(xyz), xyz, np.nanmean(xyz, axis=0))
    longitudes, latitudes, _ = frame.system.geodetic(xyz).T
    heights, *columns = files.read_geoid(geoid).at(points.names, longitudes, latitudes).T
    found = np.column_stack(columns)
    if not np.isfinite(found).any():
        raise InputError(f"{geoid}: gives no deflection of the vertical for any of the points")
    deflections = np.where(np.isnan(points.deflections), found, points.deflections)
    told: tuple[str, ...] = ()
    if not np.nan_to_num(found).any() and np.nan_to_num(heights).any():
        told = (
            f"{geoid}: all its deflections of the vertical are 0, and its geoid heights have no part in "
            "these files: their heights are taken as above the ellipsoid",
        )
    return replace(points, deflections=deflections), told
