"""Coordinate systems: Local, GeoC, LEuc, RTL, and anything that PROJ knows.

Axes are x, easting or longitude first, always. Metres and radians, except coordinates in a PROJ definition,
which are in its own units (`plan_unit`, `height_unit`). PROJ itself is loaded when first needed.
"""

from obseq.arrays import FloatArray
from obseq.crs.area import area_warning, outside_area
from obseq.crs.definition import ALIASES, complete_rtl, parse, rtl_at, side_by_side
from obseq.crs.ground import WGS84, Ground
from obseq.crs.normals import Normals
from obseq.crs.operations import KEPT_HEIGHTS, Operation, geodetic_from_geocentric
from obseq.crs.proj import ProjSystem
from obseq.crs.refraction import (
    EQUATORIAL_RADIUS,
    REFRACTION_COEFFICIENT,
    SQUARED_ECCENTRICITY,
    arc_and_radius,
    curvature_radius,
    horizontal_distance,
    refraction_correction,
    slopes_of_arc,
)
from obseq.crs.rigid import LocalTangent, RigidSystem, turn_of_vertical
from obseq.crs.system import METRE, CoordinateSystem, Kind, Unit, east_north_up
from obseq.crs.transformer import Transformer
from obseq.crs.unreferenced import AXES, UnreferencedSystem
from obseq.errors import CrsError

__all__ = [
    "ALIASES",
    "AXES",
    "EQUATORIAL_RADIUS",
    "KEPT_HEIGHTS",
    "METRE",
    "REFRACTION_COEFFICIENT",
    "SQUARED_ECCENTRICITY",
    "WGS84",
    "CoordinateSystem",
    "CrsError",
    "FloatArray",
    "Ground",
    "Kind",
    "LocalTangent",
    "Normals",
    "Operation",
    "ProjSystem",
    "RigidSystem",
    "Transformer",
    "Unit",
    "UnreferencedSystem",
    "arc_and_radius",
    "area_warning",
    "complete_rtl",
    "curvature_radius",
    "east_north_up",
    "geodetic_from_geocentric",
    "horizontal_distance",
    "outside_area",
    "parse",
    "refraction_correction",
    "rtl_at",
    "side_by_side",
    "slopes_of_arc",
    "turn_of_vertical",
]
