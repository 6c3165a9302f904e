"""Measurements of DynAdjust as observations: reductions to the ellipsoid, frames and epochs, clusters."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from obseq import crs
from obseq.arrays import FloatArray
from obseq.crs.frames import FrameAtEpoch, moved
from obseq.errors import CrsError
from obseq.formats.columns import Columns, Measure
from obseq.formats.dynadjust.records import VECTORS, Header, MeasurementRecord, Member, radians_of_packed
from obseq.formats.dynadjust.stations import Stations, geocentric
from obseq.printable import listed
from obseq.reading.text import LEAST_SIGMA, quoted
from obseq.survey.kinds.calibrated import DIST_SCALE
from obseq.survey.kinds.directions import ANGLE, AZIM, HZ, ZEN
from obseq.survey.kinds.geodetic import CHORD, GEO_X, GEO_Y, GEO_Z, HEIGHT, LATITUDE, LONGITUDE, curvatures
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.kinds.lengths import DH, DIST
from obseq.survey.kinds.vectors import VECTOR, VECTOR_Y, VECTOR_Z
from obseq.survey.model import FieldBook, Orientation

QUARTER = math.pi / 2.0
KINDS = dict.fromkeys("CEM", CHORD) | {"S": DIST, "L": DH, "H": HEIGHT, "R": HEIGHT}
KINDS |= {"B": AZIM, "K": AZIM, "V": ZEN, "Z": ZEN}
KINDS |= {"P": LATITUDE, "I": LATITUDE, "Q": LONGITUDE, "J": LONGITUDE}
"""Kinds of single measurements with one or two points."""
PLUMB = "AVZDKIJ"
"""Types that depend on the direction of the plumb line."""
ABOVE_GEOID = "LHM"
"""Types that depend on the geoid."""
GEODETIC = ("LLH", "LLh")
"""How clusters of positions may be given beside XYZ: with heights above the geoid, or the ellipsoid."""
SHOWN = 5
"""Names of many that a warning gives."""
VECTOR_KINDS, POSITION_KINDS = (VECTOR, VECTOR_Y, VECTOR_Z), (GEO_X, GEO_Y, GEO_Z)


def field_book(
    stations: Stations,
    records: Sequence[MeasurementRecord],
    ignore_frames: bool,
    scaled: Sequence[Sequence[int]] = (),
) -> FieldBook:
    """The observations of all measurements.

    Args:
        stations: The stations of the network.
        records: The measurements.
        ignore_frames: Take vectors and positions of other frames and epochs as they are.
        scaled: Positions of the distances of each set that has a scale of its own.

    Raises:
        InputError: a measurement cannot be understood, or its frame cannot be brought to that of the network.
    """
    book = _Book(stations, records)
    book.share_scales([[records[k] for k in members] for members in scaled])
    return book.read(records, _values_of(stations, records, ignore_frames), ignore_frames)


class _Book:
    """Makes observations of one measurement after the other."""

    def __init__(self, stations: Stations, records: Sequence[MeasurementRecord]) -> None:
        self._stations, self._columns = stations, Columns()
        self._files = {
            name: number for number, name in enumerate(dict.fromkeys(record.place.file for record in records))
        }
        self._columns.files.extend(self._files)
        types = Counter(record.code for record in records if record.is_active)
        stations.is_deflected = stations.has_deflections and any(types[code] for code in PLUMB)
        self._types = types
        self._plumb: dict[int, int] = {}
        self._scales: dict[int, int] = {}

    def share_scales(self, sets: Sequence[Sequence[MeasurementRecord]]) -> None:
        """Gives each set of distances an unknown scale."""
        for members in sets:
            group = self._columns.open_group(f"distances from {members[0].names[0]}")
            self._scales |= {id(record): group for record in members}

    def read(
        self,
        records: Sequence[MeasurementRecord],
        values: dict[int, FloatArray],
        ignore_frames: bool,
    ) -> FieldBook:
        """The observations; values of vectors and positions are those in the frame of the network."""
        for record in records:
            if record.code in VECTORS:
                self._cluster(record, values[id(record)])
            elif record.code == "D":
                self._directions(record)
            else:
                self._single(record)
        self._warn(records, ignore_frames)
        return self._columns.field_book()

    def _row(self, record: MeasurementRecord | Member, name: str) -> int:
        """Row of a point, which must be a station."""
        if name not in self._stations.index:
            raise record.place.error(f"station {quoted(name)} is in no file of stations; add it there")
        return self._columns.names.setdefault(name, len(self._columns.names))

    def _add(self, record: MeasurementRecord | Member, measure: Measure) -> None:
        if measure.is_active and not measure.sigma >= LEAST_SIGMA:
            raise record.place.error("a standard deviation that is not positive makes the weight infinite")
        problem = measure.kind.problem(measure.value) if measure.is_active else None
        if problem is not None:
            raise record.place.error(f"the {measure.kind.words} {problem}; correct it or ignore it (*)")
        self._columns.append(measure, self._files[record.place.file], record.place.line - 1)

    def _single(self, record: MeasurementRecord) -> None:
        if len(set(record.names)) < len(record.names):
            raise record.place.error("two of the stations are the same; correct one of the names")
        rows = [self._row(record, name) for name in record.names]
        if record.code == "A":
            origin, backsight, target = rows
            kind: ObservationKind = ANGLE
        else:
            origin, target, backsight = rows[0], rows[-1], -1
            kind = DIST_SCALE if id(record) in self._scales else KINDS[record.code]
        measure = Measure(
            kind,
            origin,
            target,
            self._reduced(record),
            record.sigma,
            record.is_active,
            0.0,
            *record.heights,
            station=self._columns.station_of(kind, origin, self._plumb),
            group=self._scales.get(id(record), -1),
            backsight=backsight,
        )
        self._add(record, measure)

    def _reduced(self, record: MeasurementRecord) -> float:
        """The value as our equations take it."""
        value, code = record.value, record.code
        if code == "Z":
            return QUARTER - value
        if code in ABOVE_GEOID or code == "E":
            return self._above_ellipsoid(record)
        if code in "KIJ":
            row = self._stations.index[record.names[0]]
            east, north = self._stations.deflections[row]
            latitude = self._stations.geodetic[row, 1]
            corrections = {"K": east * math.tan(latitude), "I": north, "J": east / math.cos(latitude)}
            return value - float(corrections[code])
        return value

    def _above_ellipsoid(self, record: MeasurementRecord) -> float:
        rows = [self._stations.index[name] for name in record.names]
        heights = np.nan_to_num(self._stations.undulations[rows])
        if record.code == "H":
            return record.value + float(heights[0])
        if record.code == "L":
            return record.value + float(heights[1] - heights[0])
        radius = math.sqrt(math.prod(curvatures(self._stations.geodetic[rows, 1].mean(keepdims=True))[0]))
        if record.code == "E":
            return 2.0 * radius * math.sin(record.value / (2.0 * radius))
        level = radius + float(heights.mean())
        chord = 2.0 * level * math.sin(record.value / (2.0 * level))
        scale = math.prod(1.0 + heights / radius)
        return math.sqrt(max(chord**2 - float(heights[1] - heights[0]) ** 2, 0.0) / scale)

    def _directions(self, record: MeasurementRecord) -> None:
        """A set of directions, with one unknown orientation."""
        origin = self._row(record, record.names[0])
        station = self._columns.open_station(origin, Orientation.VERT)
        for member in record.members:
            target = self._row(member, member.names[1])
            if target == origin:
                raise member.place.error("a station sights itself; correct the name")
            is_active = record.is_active and member.is_active
            self._add(
                member,
                Measure(HZ, origin, target, member.values[0], member.sigma, is_active, station=station),
            )

    def _cluster(self, record: MeasurementRecord, values: FloatArray) -> None:
        """Vectors or positions (n, 3), with their covariance."""
        covariance = self._covariance(record)
        kinds = POSITION_KINDS if record.code == "Y" else VECTOR_KINDS
        first, sigmas = len(self._columns), np.sqrt(np.diag(covariance)).reshape(-1, 3)
        for member, three, of_three in zip(record.members, values.tolist(), sigmas.tolist(), strict=True):
            rows = [self._row(member, name) for name in member.names]
            if len(set(rows)) < len(rows):
                raise member.place.error("a vector leads from a station to itself; correct one of the names")
            for kind, value, sigma in zip(kinds, three, of_three, strict=True):
                self._add(
                    member,
                    Measure(kind, rows[0], rows[-1], value, sigma, record.is_active, 0.0, *record.heights),
                )
        self._columns.correlate(list(range(first, len(self._columns))), covariance)

    def _covariance(self, record: MeasurementRecord) -> FloatArray:
        """(3 n, 3 n) of a cluster in geocentric axes, with its scales."""
        n = len(record.members)
        whole = np.zeros((n, 3, n, 3))
        for k, member in enumerate(record.members):
            whole[k, :, k] = member.covariance
            for shift, block in enumerate(member.crossed, start=1):
                whole[k, :, k + shift], whole[k + shift, :, k] = block, block.T
        turn = self._turn(record)
        matrix = turn @ whole.reshape(3 * n, 3 * n) @ turn.T
        try:
            np.linalg.cholesky(matrix)
        except np.linalg.LinAlgError as error:
            raise record.place.error("the covariance is not positive definite, or not complete") from error
        return np.asarray((matrix + matrix.T) / 2.0)

    def _turn(self, record: MeasurementRecord) -> FloatArray:
        """(3 n, 3 n) what makes the covariance of a record one in geocentric axes, in its scales."""
        n, (v, *others) = len(record.members), record.scales
        if min(record.scales) <= 0.0:
            raise record.place.error("a scale of variances is not positive")
        turn = np.eye(3 * n) * math.sqrt(v)
        if record.system in GEODETIC:
            for k, member in enumerate(record.members):
                part = slice(3 * k, 3 * k + 3)
                turn[part, part] = math.sqrt(v) * _derivatives(_place_of(self._stations, record, member))
        if others == [1.0, 1.0, 1.0]:
            return turn
        longitude, latitude = self._stations.geodetic[self._stations.index[record.names[0]], :2]
        axes = crs.east_north_up(longitude, latitude)
        north, east, up = np.sqrt(others)
        stretch = axes @ np.diag([east, north, up]) @ axes.T
        return np.asarray(np.kron(np.eye(n), stretch) @ turn)

    def _warn(self, records: Sequence[MeasurementRecord], ignore_frames: bool) -> None:
        warnings, files = self._columns.warnings, ", ".join(self._files)
        levelled = sum(self._types[code] for code in ABOVE_GEOID) + sum(
            record.code == "Y" and record.system == "LLH" and record.is_active for record in records
        )
        needs_geoid = bool(levelled) or self._stations.height_is_held()
        if self._stations.has_geoid and needs_geoid and self._stations.without_geoid:
            names = self._stations.without_geoid
            warnings.append(
                f"{files}: the geoid says nothing of {len(names)} stations, whose heights are taken as above "
                f"the ellipsoid: {listed(names, SHOWN)}"
            )
        if not self._stations.has_geoid and needs_geoid:
            warnings.append(
                f"{files}: heights above the geoid are taken as above the ellipsoid: no geoid is given "
                "(--geoid FILE)"
            )
        if again := self._stations.again:
            warnings.append(
                f"{files}: {len(again)} free stations are given again: their first coordinates count: "
                f"{listed(again, SHOWN)}"
            )
        southern = self._stations.without_hemisphere
        if southern:
            warnings.append(
                f"{files}: zones without a hemisphere are taken as south, as DynAdjust does: {len(southern)} "
                f"stations, {listed(southern, SHOWN)}"
            )
        plumb = sum(self._types[code] for code in PLUMB)
        if plumb and not self._stations.is_deflected:
            warnings.append(
                f"{files}: {plumb} measurements depend on the plumb line, taken as the normal of the "
                f"ellipsoid: {self._stations.why_plumb}"
            )
        others = [
            record for record in records if record.code in VECTORS and _is_other(self._stations, record)
        ]
        for frame, count in Counter(record.header.frame for record in others).items():
            epochs = sorted({record.header.epoch for record in others if record.header.frame == frame})
            span = "" if math.isnan(epochs[0]) else f" from {epochs[0]:.3f} to {epochs[-1]:.3f}"
            how = "taken as they are, as asked for" if ignore_frames else "brought to"
            ours = "" if ignore_frames else f" {_named(self._stations.header)}"
            warnings.append(f"{files}: {count} measurements in {frame}{span}: {how}{ours}")


def _derivatives(place: FloatArray) -> FloatArray:
    """(3, 3) geocentric coordinates with respect to latitude, longitude (rad) and height."""
    longitude, latitude, height = place
    parallel, meridian = curvatures(np.array([latitude]))[0]
    east, north, up = crs.east_north_up(longitude, latitude).T
    columns = [north * (meridian + height), east * (parallel + height) * math.cos(latitude), up]
    return np.asarray(np.column_stack(columns))


def _place_of(stations: Stations, record: MeasurementRecord, member: Member) -> FloatArray:
    """Longitude, latitude (rad) and height above the ellipsoid of a member of a cluster of positions."""
    try:
        latitude, longitude = (radians_of_packed(value) for value in member.values[:2])
    except ValueError as error:
        raise member.place.error(str(error)) from error
    height = member.values[2]
    if record.system == "LLH":
        height += float(np.nan_to_num(stations.undulations[_index(stations, member)]))
    return np.array([longitude, latitude, height])


def _index(stations: Stations, member: Member) -> int:
    """Row of the first point of a member among the stations."""
    if member.names[0] not in stations.index:
        raise member.place.error(f"station {quoted(member.names[0])} is in no file of stations")
    return stations.index[member.names[0]]


def _geocentric_values(stations: Stations, record: MeasurementRecord) -> FloatArray:
    """(n, 3) vectors or positions of a record, along geocentric axes."""
    if record.code == "Y" and record.system in GEODETIC:
        return geocentric(np.array([_place_of(stations, record, member) for member in record.members]))
    if record.code == "Y" and record.system != "XYZ":
        raise record.place.error(
            f"{quoted(record.system)!r}: positions are given as XYZ, {' or '.join(GEODETIC)}"
        )
    return np.array([member.values for member in record.members])


def _named(header: Header) -> str:
    return header.frame + (f" at {header.epoch:.3f}" if math.isfinite(header.epoch) else "")


def _is_other(stations: Stations, record: MeasurementRecord) -> bool:
    ours, theirs = stations.header, record.header
    return ours.frame != theirs.frame or abs(ours.epoch - theirs.epoch) > 1e-9


def _values_of(
    stations: Stations, records: Sequence[MeasurementRecord], ignore_frames: bool
) -> dict[int, FloatArray]:
    """Vectors and positions of each record, by its identity, in the frame and at the epoch of the network.

    Records of one frame and epoch go to PROJ together.
    """
    values = {
        id(record): _geocentric_values(stations, record) for record in records if record.code in VECTORS
    }
    if ignore_frames:
        return values
    groups: dict[tuple[str, float], list[MeasurementRecord]] = {}
    for record in records:
        if record.code in VECTORS and _is_other(stations, record) and record.header.frame:
            groups.setdefault((record.header.frame, record.header.epoch), []).append(record)
    for (frame, epoch), alike in groups.items():
        _move(stations, alike, FrameAtEpoch(frame, epoch), values)
    return values


def _move(
    stations: Stations, records: list[MeasurementRecord], source: FrameAtEpoch, values: dict[int, FloatArray]
) -> None:
    """Replaces values by those in the frame of the network."""
    target = FrameAtEpoch(stations.header.frame, stations.header.epoch)
    starts = np.concatenate([_starts(stations, record) for record in records])
    given = np.concatenate([values[id(record)] for record in records])
    try:
        ends, origins = moved(starts + given, source, target), moved(starts, source, target)
    except CrsError as error:
        raise records[0].place.error(
            f"{error}. Transform the measurement, or take it as it is with --ignore frames"
        ) from error
    is_vector = np.concatenate([np.full(len(record.members), record.code != "Y") for record in records])
    found = ends - np.where(is_vector[:, None], origins, 0.0)
    ends_of = np.cumsum([len(record.members) for record in records])
    for record, part in zip(records, np.split(found, ends_of[:-1]), strict=True):
        values[id(record)] = part


def _starts(stations: Stations, record: MeasurementRecord) -> FloatArray:
    """(n, 3) where the vectors of a record begin; the centre of the Earth for positions."""
    if record.code == "Y":
        return np.zeros((len(record.members), 3))
    return stations.geocentric[[_index(stations, member) for member in record.members]]
