"""Stations of DynAdjust as points: longitude, latitude and ellipsoidal height in the frame of the network."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.cached import cached_property
from obseq.crs.frames import geographic_crs
from obseq.errors import CrsError, InputError
from obseq.formats.dynadjust.records import radians_of_packed
from obseq.reading.text import quoted
from obseq.survey.model import Points

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from obseq.arrays import FloatArray
    from obseq.formats.dynadjust.geoid import Geoid
    from obseq.formats.dynadjust.records import Header, StationRecord

DEGREES = "decimal degrees"
"""Type of coordinates of other programs: longitude, latitude (degrees) and height above the ellipsoid."""
ELLIPSOID = "+proj=longlat +ellps=GRS80 +towgs84=0,0,0"
"""System of longitude and latitude whose geocentric axes are taken as those of any frame."""


class Stations:
    """The stations of a network.

    Args:
        records: As they were read.
        header: Frame and epoch of the network.
        geoid: Geoid heights and deflections; None without.
        files: Names of the files.
        ignores_deflections: Whether plumb lines are taken as normals of the ellipsoid all the same.

    Raises:
        InputError: a station cannot be understood; its line is named.
    """

    def __init__(
        self,
        records: Sequence[StationRecord],
        header: Header,
        geoid: Geoid | None,
        files: tuple[str, ...],
        ignores_deflections: bool = False,
    ) -> None:
        self._ignores = ignores_deflections
        self.header, self.files, self._geoid = header, files, geoid
        self.index: dict[str, int] = {}
        self.again: list[str] = []
        self._records: list[StationRecord] = []
        for record in records:
            self._check(record)
            if self.index.setdefault(record.name, len(self._records)) == len(self._records):
                self._records.append(record)
            else:
                self._note_again(record, self._records[self.index[record.name]])
        self.is_deflected = False
        self.geodetic = self._placed()
        self.undulations = self._from_geoid[:, 0]
        self.geodetic[:, 2] += np.where(self.is_above_geoid, np.nan_to_num(self.undulations), 0.0)

    def _note_again(self, record: StationRecord, first: StationRecord) -> None:
        """A station that is there already: of free ones the first counts; it is refused where one is held."""
        place = first.place
        if "C" in record.constraints + first.constraints:
            raise record.place.error(
                f"station {record.name} is given twice (first at {place.file}:{place.line})"
            )
        self.again.append(f"{record.name} ({record.place.file}:{record.place.line})")

    @staticmethod
    def _check(record: StationRecord) -> None:
        if record.system not in _PLACED:
            known = ", ".join(name for name in _PLACED if name != DEGREES)
            raise record.place.error(f"{quoted(record.system)!r} is no type of coordinates ({known})")
        if len(record.constraints) != 3 or set(record.constraints) - set("CF"):
            raise record.place.error(
                f"{quoted(record.constraints)!r} is not a constraint of three letters C or F"
            )

    @cached_property
    def definition(self) -> str:
        """Definition of the system of the points: that of the frame where PROJ takes it as geocentric."""
        try:
            definition = geographic_crs(self.header.frame)
            given = np.column_stack([np.degrees(self.geodetic[:1, :2]), self.geodetic[:1, 2:]])
            gap = crs.parse(definition).to_geocentric(given) - crs.parse(ELLIPSOID).to_geocentric(given)
        except CrsError as error:
            raise InputError(f"{self.files[0]}: {error}") from error
        return definition if float(np.abs(gap).max()) < 1e-6 else ELLIPSOID

    @cached_property
    def is_above_geoid(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """(n,) whether the height of each is orthometric."""
        return np.array([record.system in ("LLH", "UTM") for record in self._records], np.bool_)

    @cached_property
    def _from_geoid(self) -> FloatArray:
        """(n, 3) geoid height, east and north deflection; NaN where unknown."""
        if self._geoid is None:
            return np.full((len(self._records), 3), np.nan)
        names = [record.name for record in self._records]
        return self._geoid.at(names, self.geodetic[:, 0], self.geodetic[:, 1])

    @property
    def has_geoid(self) -> bool:
        """Whether a geoid was given."""
        return self._geoid is not None

    @property
    def has_deflections(self) -> bool:
        """Whether a geoid was given whose deflections count."""
        return self.has_geoid and not self._ignores

    @property
    def why_plumb(self) -> str:
        """Why there are no deflections, in words."""
        return "as asked for" if self._ignores else "no deflections are given (--geoid FILE)"

    @property
    def without_geoid(self) -> list[str]:
        """Names of stations of which the geoid says nothing."""
        rows = np.flatnonzero(np.isnan(self.undulations)).tolist()
        return [self._records[row].name for row in rows]

    @property
    def deflections(self) -> FloatArray:
        """(n, 2) east and north deflections, rad; 0 where unknown, or asked to be left out."""
        return np.nan_to_num(self._from_geoid[:, 1:]) * (0.0 if self._ignores else 1.0)

    @cached_property
    def geocentric(self) -> FloatArray:
        """(n, 3) approximate geocentric coordinates, m."""
        return geocentric(self.geodetic)

    def _placed(self) -> FloatArray:
        """(n, 3) longitude, latitude (rad), height as given."""
        result = np.empty((len(self._records), 3))
        for row, record in enumerate(self._records):
            try:
                result[row] = _PLACED[record.system](record)
            except (ValueError, CrsError) as error:
                raise record.place.error(str(error)) from error
        return result

    def points(self) -> Points:
        """The points, in degrees and metres; C is held, F is free."""
        records, n = self._records, len(self._records)
        coordinates = np.column_stack([np.degrees(self.geodetic[:, :2]), self.geodetic[:, 2]])
        held = np.array([[letter == "C" for letter in record.constraints] for record in records])
        latitude_first = np.array([record.system in ("LLH", "LLh") for record in records])
        held[latitude_first] = held[latitude_first][:, [1, 0, 2]]
        names = list(dict.fromkeys(record.place.file for record in records))
        numbers = {name: number for number, name in enumerate(names)}
        files = np.array([numbers[record.place.file] for record in records], np.int32)
        return Points(
            tuple(record.name for record in records),
            coordinates,
            np.where(held, 0.0, np.nan),
            self.deflections if self.is_deflected else np.full((n, 2), np.nan),
            tuple(record.description for record in records),
            tuple(names),
            files,
            np.array([record.place.line for record in records], np.int32),
        )

    @property
    def without_hemisphere(self) -> list[str]:
        """Names of stations whose zone is digits alone, which DynAdjust takes as south."""
        return [record.name for record in self._records if record.zone.strip().isdecimal()]

    def height_is_held(self) -> bool:
        """Whether an orthometric height is held."""
        return any(
            record.constraints[2] == "C" for record in self._records if record.system in ("LLH", "UTM")
        )


def geocentric(geodetic: FloatArray) -> FloatArray:
    """(n, 3) geocentric coordinates of longitudes, latitudes (rad) and heights (n, 3)."""
    degrees = np.column_stack([np.degrees(geodetic[:, :2]), geodetic[:, 2]])
    return crs.parse(ELLIPSOID).to_geocentric(degrees)


def _of_angles(record: StationRecord) -> tuple[float, float, float]:
    latitude, longitude = (radians_of_packed(value) for value in record.coordinates[:2])
    if abs(latitude) > math.pi / 2.0 or abs(longitude) > 2.0 * math.pi:
        raise ValueError(
            "the latitude or the longitude is beyond its range; they are d.mmssss, latitude first"
        )
    return longitude, latitude, record.coordinates[2]


def _of_degrees(record: StationRecord) -> tuple[float, float, float]:
    longitude, latitude, height = record.coordinates
    return math.radians(longitude), math.radians(latitude), height


def _of_geocentric(record: StationRecord) -> FloatArray:
    return _from(crs.parse("GeoC"), record)


def _of_grid(record: StationRecord) -> FloatArray:
    written = record.zone.strip().upper()
    zone = f"S{written}" if written.isdecimal() else written  # as DynAdjust reads digits alone
    if zone[:1] not in ("S", "N") or not zone[1:].isdecimal() or not 1 <= int(zone[1:]) <= 60:
        raise ValueError(f"{quoted(written)!r} is not a hemisphere and zone such as S56")
    south = " +south" if zone[0] == "S" else ""
    return _from(crs.parse(f"+proj=utm +zone={zone[1:]}{south} +ellps=GRS80 +towgs84=0,0,0"), record)


def _from(system: crs.CoordinateSystem, record: StationRecord) -> FloatArray:
    place = crs.Transformer(system, crs.parse(ELLIPSOID)).forward(np.array([record.coordinates]))[0]
    return np.array([*np.radians(place[:2]), place[2]])


_PLACED: dict[str, Callable[[StationRecord], Sequence[float] | FloatArray]] = {
    "LLH": _of_angles,
    "LLh": _of_angles,
    "UTM": _of_grid,
    "XYZ": _of_geocentric,
    DEGREES: _of_degrees,
}
"""Longitude, latitude (rad) and height of a station, by its type of coordinates."""
