"""Results on maps: points, error ellipses and observations as GeoJSON, GeoPackage and KML.

GeoJSON (RFC 7946) is in longitude, latitude (degrees, WGS 84) and ellipsoidal height, x first; shapes are cut
at the meridian of 180 degrees. What has no plan (points that are levelled) has no geometry. A
GeoPackage is in the system of the points where PROJ knows it, else in longitude and latitude; a plane without
a place on the Earth is an undefined Cartesian system there, and no GeoJSON at all.
"""

from __future__ import annotations

import json
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from obseq import crs
from obseq.arrays import FloatArray
from obseq.crs.area import cut
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.packages import require
from obseq.records.adjustment import AdjustmentRecord, EllipseRecord, ObservationRecord, PointRecord

Properties: TypeAlias = dict[str, object]
"""What a feature says besides its place."""
RING = 48
"""Corners of an ellipse."""
DEGREES = 9
"""Decimals of longitude and latitude: 0.1 mm."""


@dataclass(frozen=True)
class Layer:
    """Features of one kind.

    Attributes:
        name: Of the layer.
        geometry: "Point", "LineString" or "Polygon".
        shapes: Corners (k, 3) of each feature in the computation frame; none of what has no plan.
        properties: Of each feature.
    """

    name: str
    geometry: str
    shapes: Sequence[FloatArray]
    properties: Sequence[Properties]


def layers_of(record: AdjustmentRecord, ellipse_scale: float) -> list[Layer]:
    """Points, ellipses and observations of a result.

    Args:
        record: The result.
        ellipse_scale: How many times larger than they are ellipses are drawn.
    """
    places = {point.name: _corner(point) for point in record.points}
    points = [
        {key: getattr(point, key) for key in ("name", "sx", "sy", "sz", "crs_sx", "crs_sy", "crs_sz")}
        for point in record.points
    ]
    drawn = [(p.name, p.ellipse) for p in record.points if p.ellipse is not None and p.ellipse.semi_major]
    ends = places.keys()
    seen = [o for o in record.observations if {o.origin, o.target} <= ends and o.origin != o.target]
    return [
        Layer("points", "Point", [places[p.name] for p in record.points], points),
        Layer(
            "ellipses",
            "Polygon",
            [_ring(places[name], ellipse, ellipse_scale) for name, ellipse in drawn],
            [_of_ellipse(name, ellipse, ellipse_scale) for name, ellipse in drawn],
        ),
        Layer(
            "observations",
            "LineString",
            [_line(places[o.origin], places[o.target]) for o in seen],
            [_of_observation(o) for o in seen],
        ),
    ]


def _corner(point: PointRecord) -> FloatArray:
    """(1, 3) where a point is, its height NaN where nobody knows it; (0, 3) without a plan."""
    height = np.nan if point.z is None else point.z
    return np.array([[*point.plan, height]]) if point.plan else np.zeros((0, 3))


def _line(start: FloatArray, end: FloatArray) -> FloatArray:
    """(2, 3) both ends; (0, 3) where one of them has no plan."""
    return np.concatenate([start, end]) if len(start) and len(end) else np.zeros((0, 3))


def _of_ellipse(name: str, ellipse: EllipseRecord, scale: float) -> Properties:
    return {
        "name": name,
        "semi_major_m": ellipse.semi_major,
        "semi_minor_m": ellipse.semi_minor,
        "bearing_rad": ellipse.bearing,
        "drawn_larger": scale,
    }


def _of_observation(observation: ObservationRecord) -> Properties:
    keys = ("type", "value", "sigma", "residual", "normalised_residual", "redundancy", "unit", "active")
    found = {key: getattr(observation, key) for key in keys}
    ends = {"from": observation.origin, "to": observation.target}
    return ends | found | {"place": f"{observation.file}:{observation.line}"}


def _ring(centre: FloatArray, ellipse: EllipseRecord, scale: float) -> FloatArray:
    """(RING + 1, 3) corners counter-clockwise, the last one the first."""
    along = np.array([np.sin(ellipse.bearing), np.cos(ellipse.bearing), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    angles = np.linspace(0.0, 2.0 * np.pi, RING + 1)[:, None]
    offsets = ellipse.semi_major * np.cos(angles) * along + ellipse.semi_minor * np.sin(angles) * across
    corners = centre[0] + scale * offsets
    corners[-1] = corners[0]
    return np.asarray(corners)


def geojson(record: AdjustmentRecord, ellipse_scale: float) -> str:
    """The text of a GeoJSON file.

    Raises:
        InputError: The frame has no place on the Earth.
    """
    frame = _on_the_earth(record, "GeoJSON")
    layers = layers_of(record, ellipse_scale)
    features = [feature for layer in layers for feature in _features(layer, frame)]
    return json.dumps({"type": "FeatureCollection", "features": features}, allow_nan=False, indent=1) + "\n"


def _on_the_earth(record: AdjustmentRecord, what: str) -> crs.CoordinateSystem:
    """The frame.

    Raises:
        InputError: It has no place on the Earth.
    """
    frame = crs.parse(record.frame)
    if frame.kind is crs.Kind.LOCAL:
        raise InputError(
            f"{what} is in longitude and latitude, and the frame {record.frame} has no place on the Earth: "
            "adjust the network with the system of its points (--points-crs), or write a GeoPackage"
        )
    return frame


def _features(layer: Layer, frame: crs.CoordinateSystem) -> Iterator[Properties]:
    if not layer.shapes:
        return
    geodetic = _moved(np.concatenate(layer.shapes), frame.geodetic)
    degrees = np.column_stack([np.degrees(geodetic[:, :2]), geodetic[:, 2]])
    ends = np.cumsum([len(shape) for shape in layer.shapes])[:-1]
    for corners, properties in zip(np.split(degrees, ends), layer.properties, strict=True):
        parts = [_rounded(part) for part in cut(corners)] if len(corners) else []
        geometry = _geometry(layer.geometry, parts) if parts else None
        yield {"type": "Feature", "geometry": geometry, "properties": {"layer": layer.name} | properties}


def _geometry(name: str, parts: list[list[list[float]]]) -> Properties:
    """The geometry of a shape that may be cut in two."""
    nested = [{"Point": part[0], "LineString": part, "Polygon": [part]}[name] for part in parts]
    whole = len(nested) == 1
    return {"type": name if whole else f"Multi{name}", "coordinates": nested[0] if whole else nested}


def _rounded(corners: FloatArray) -> list[list[float]]:
    """Corners as they are written, without heights where one is missing."""
    rounded = np.column_stack([np.round(corners[:, :2], DEGREES), np.round(corners[:, 2], 4)])
    known = rounded[:, :2] if np.isnan(rounded).any() else rounded
    return [[float(value) for value in corner] for corner in known]


def _moved(corners: FloatArray, to: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Corners (n, 3) in another system; those without a height at height 0, which does not come out."""
    if not len(corners):
        return corners
    return np.where(np.isnan(corners) & [False, False, True], np.nan, to(np.nan_to_num(corners)))


def geopackage(record: AdjustmentRecord, ellipse_scale: float) -> bytes:
    """The content of a GeoPackage, a layer for each kind of features.

    Raises:
        InputError: pyogrio is not installed.
    """
    frame = crs.parse(record.frame)
    return _layered(record, ellipse_scale, "GPKG", frame, *_system_of(record, frame))


def kml(record: AdjustmentRecord, ellipse_scale: float) -> bytes:
    """The content of a KML file, in longitude and latitude, on the ground: without heights.

    Raises:
        InputError: The frame has no place on the Earth, or pyogrio is not installed.
    """
    frame = _on_the_earth(record, "KML")
    return _layered(record, ellipse_scale, "LIBKML", frame, crs.parse("Geog"), "OGC:CRS84")


def _layered(
    record: AdjustmentRecord,
    ellipse_scale: float,
    driver: str,
    frame: crs.CoordinateSystem,
    target: crs.CoordinateSystem,
    definition: str | None,
) -> bytes:
    """The content of a file with a layer for each kind of features, which a driver of GDAL writes."""
    require("a map as a GeoPackage or KML", "maps", "pyogrio")
    from pyogrio.raw import write

    has_heights = driver == "GPKG"
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that a plane has no system is meant
        path = Path(folder) / ("map.gpkg" if has_heights else "map.kml")
        for layer in layers_of(record, ellipse_scale):
            if layer.shapes:
                columns = _columns(layer.properties)
                kind = f"{layer.geometry} Z" if has_heights else layer.geometry
                options = {"geometry_type": kind, "crs": definition, "driver": driver}
                corners = _well_known(layer, frame, target, has_heights)
                write(path, corners, list(columns.values()), list(columns), layer=layer.name, **options)
        return path.read_bytes()


def _system_of(
    record: AdjustmentRecord, frame: crs.CoordinateSystem
) -> tuple[crs.CoordinateSystem, str | None]:
    """The system of the file, and its definition for PROJ; None for a plane."""
    given = crs.parse(record.points_crs)
    if frame.kind is crs.Kind.LOCAL:
        return given, None
    if given.kind is crs.Kind.PROJ:
        from pyproj import CRS

        return given, CRS.from_user_input(given.definition).to_wkt()
    return crs.parse("Geog"), "OGC:CRS84"


def _well_known(
    layer: Layer, frame: crs.CoordinateSystem, target: crs.CoordinateSystem, has_heights: bool
) -> npt.NDArray[np.object_]:
    """(n,) shapes as well-known binary, x first."""
    corners = corners_in(layer, frame, target)[:, : 3 if has_heights else 2]
    parts = np.split(corners, np.cumsum([len(shape) for shape in layer.shapes])[:-1])
    more = 1000 if has_heights else 0
    codes = {"Point": (1, ()), "LineString": (2, ("n",)), "Polygon": (3, ("1", "n"))}
    code, counts = codes[layer.geometry]
    found = np.empty(len(parts), object)
    for k, part in enumerate(parts):
        if not len(part):
            continue  # no geometry
        heads = [code + more, *(len(part) if count == "n" else 1 for count in counts)]
        found[k] = b"\x01" + np.array(heads, "<u4").tobytes() + part.astype("<f8").tobytes()
    return found


def corners_in(layer: Layer, frame: crs.CoordinateSystem, target: crs.CoordinateSystem) -> FloatArray:
    """(k, 3) corners of all its shapes in a system; heights that nobody knows are NaN."""
    return _moved(np.concatenate(layer.shapes), crs.Transformer(frame, target).forward)


def _columns(properties: Sequence[Properties]) -> dict[str, npt.NDArray[np.generic]]:
    """Arrays by name: numbers with NaN for what is missing, truths, texts."""
    columns: dict[str, npt.NDArray[np.generic]] = {}
    for name in properties[0]:
        values = [row[name] for row in properties]
        given = next((value for value in values if value is not None), "")
        if isinstance(given, bool):
            columns[name] = np.array(values, np.bool_)
        elif isinstance(given, int | float):
            columns[name] = np.array([np.nan if value is None else value for value in values], np.float64)
        else:
            columns[name] = np.array(["" if value is None else value for value in values], object)
    return columns
