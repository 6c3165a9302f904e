"""DynaML files: the XML of DynAdjust, with stations, measurements, or both."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.formats.dynadjust.records import (
    ANGLES,
    GEOGRAPHIC,
    ONE_POINT,
    THREE_POINTS,
    TYPES,
    Header,
    MeasurementRecord,
    Member,
    Place,
    StationRecord,
    decimal_year,
    radians_of_packed,
)
from obseq.reading.angles import SECOND
from obseq.reading.text import quoted
from obseq.reading.xml import Element, children_of

_MEMBERS = {"G": "GPSBaseline", "X": "GPSBaseline", "Y": "Clusterpoint"}
_CROSSED = {"GPSBaseline": "GPSCovariance", "Clusterpoint": "PointCovariance"}


def read_records(path: Path) -> tuple[Header, list[StationRecord], list[MeasurementRecord]]:
    """The header of a file, its stations, and its measurements, those that are switched off as well."""
    header = Header()
    stations: list[StationRecord] = []
    measurements: list[MeasurementRecord] = []
    for root, element in children_of(path):
        if not (stations or measurements):
            header = _header(root)
        if element.name == "DnaStation":
            stations.append(_station(element))
        elif element.name == "DnaMeasurement":
            measurements.append(_measurement(element, header))
    return header, stations, measurements


def _header(root: Element) -> Header:
    frame, epoch = (root.attributes.get(name, "") for name in ("referenceframe", "epoch"))
    return Header(frame.strip(), _epoch(root, epoch))


def _measurement(element: Element, header: Header) -> MeasurementRecord:
    code = element.content("Type")
    if code not in TYPES or len(code) != 1:
        raise element.error(f"{quoted(code)!r} is not a type of measurement ({', '.join(sorted(TYPES))})")
    frame, epoch = element.content("ReferenceFrame", ""), _epoch(element, element.content("Epoch", ""))
    own = Header(frame or header.frame, header.epoch if math.isnan(epoch) else epoch)
    make = _cluster if code in _MEMBERS else _directions if code == "D" else _single
    return make(element, code, own)


def _station(element: Element) -> StationRecord:
    coordinates = element.inside("StationCoord")
    return StationRecord(
        _name(element, "Name"),
        element.content("Constraints"),
        element.content("Type"),
        (coordinates.numeric("XAxis"), coordinates.numeric("YAxis"), coordinates.numeric("Height")),
        coordinates.content("HemisphereZone", ""),
        element.content("Description", ""),
        Place.of(element),
    )


def _single(element: Element, code: str, header: Header) -> MeasurementRecord:
    is_angle = code in ANGLES + GEOGRAPHIC
    tags = ("First", "Second", "Third")[: 3 if code in THREE_POINTS else 1 if code in ONE_POINT else 2]
    return MeasurementRecord(
        code,
        _is_on(element),
        tuple(_name(element, tag) for tag in tags),
        _packed(element) if is_angle else element.numeric("Value"),
        element.numeric("StdDev") * (SECOND if is_angle else 1.0),
        (element.numeric("InstHeight", 0.0), element.numeric("TargHeight", 0.0)),
        header=header,
        place=Place.of(element),
    )


def _directions(element: Element, code: str, header: Header) -> MeasurementRecord:
    station = _name(element, "First")
    parts = [(element, "Second"), *((child, "Target") for child in element.named("Directions"))]
    members = tuple(
        Member(
            (station, _name(part, tag)),
            (_packed(part),),
            part.numeric("StdDev") * SECOND,
            None,
            (),
            _is_on(part),
            Place.of(part),
        )
        for part, tag in parts
    )
    _check_total(element, len(members) - 1)
    return MeasurementRecord(
        code, _is_on(element), (station,), members=members, header=header, place=Place.of(element)
    )


def _cluster(element: Element, code: str, header: Header) -> MeasurementRecord:
    members = []
    for names, part in _parts(element, code):
        members.append(_member(names, part, _is_on(element)))
    if not members:
        raise element.error(f"no <{_MEMBERS[code]}> is in it")
    _check_total(element, len(members))
    for number, member in enumerate(members):
        if len(member.crossed) != len(members) - 1 - number:
            raise member.place.error(
                f"{len(member.crossed)} covariances with later members, where {len(members) - 1 - number} "
                "are needed"
            )
    scales = [element.numeric(f"{letter}scale", 1.0) for letter in "VPLH"]
    return MeasurementRecord(
        code,
        _is_on(element),
        members[0].names,
        members=tuple(members),
        scales=(scales[0], scales[1], scales[2], scales[3]),
        system=element.content("Coords", "XYZ"),
        header=header,
        place=Place.of(element),
    )


def _parts(element: Element, code: str) -> Iterator[tuple[tuple[str, ...], Element]]:
    """The members of a cluster, with the points named before each."""
    names: dict[str, str] = {}
    wanted = ("First",) if code == "Y" else ("First", "Second")
    for child in element.children:
        if child.name in wanted:
            child.file.check_name(child.line - 1, child.plain)
            names[child.name] = child.plain
        elif child.name == _MEMBERS[code]:
            missing = [tag for tag in wanted if not names.get(tag)]
            if missing:
                raise child.error(f"an element <{missing[0]}> is missing before it, or empty")
            yield tuple(names[tag] for tag in wanted), child


def _member(names: tuple[str, ...], part: Element, is_on: bool) -> Member:
    values = tuple(part.numeric(tag) for tag in "XYZ")
    xx, xy, xz, yy, yz, zz = (part.numeric(f"Sigma{tag}") for tag in ("XX", "XY", "XZ", "YY", "YZ", "ZZ"))
    covariance = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    crossed = tuple(_block(child) for child in part.named(_CROSSED[part.name]))
    return Member(names, values, math.nan, covariance, crossed, is_on, Place.of(part))


def _block(element: Element) -> FloatArray:
    return np.array([[element.numeric(f"m{row}{column}") for column in "123"] for row in "123"])


def _is_on(element: Element) -> bool:
    return element.content("Ignore", "") != "*"


def _packed(element: Element) -> float:
    """The angle of <Value>."""
    try:
        return radians_of_packed(element.numeric("Value"))
    except ValueError as error:
        raise element.error(str(error)) from error


def _check_total(element: Element, count: int) -> None:
    total = element.content("Total", "")
    if total and total != str(count):
        raise element.error(f"<Total> is {quoted(total)}, and {count} members are in it")


def _name(element: Element, tag: str) -> str:
    name = element.content(tag)
    element.file.check_name(element.line - 1, name)
    return name


def _epoch(element: Element, text: str) -> float:
    try:
        return decimal_year(text)
    except ValueError as error:
        raise element.error(f"epoch: {error}") from error
