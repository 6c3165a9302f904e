"""DynaML files: the XML of DynAdjust, with stations, measurements, or both."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.formats.dynadjust.dna import SECOND
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
from obseq.reading.text import LONGEST_NAME, quoted

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from obseq.arrays import FloatArray
    from obseq.errors import InputError
    from obseq.reading.xml import Element

_MEMBERS = {"G": "GPSBaseline", "X": "GPSBaseline", "Y": "Clusterpoint"}
_CROSSED = {"GPSBaseline": "GPSCovariance", "Clusterpoint": "PointCovariance"}


class DynamlFile:
    """One file, of which the root has been read."""

    def __init__(self, root: Element) -> None:
        self._root = root
        self.header = Header(
            root.attributes.get("referenceframe", "").strip(),
            _epoch(root, root.attributes.get("epoch", "")),
        )

    def stations(self) -> Iterator[StationRecord]:
        """The stations."""
        for element in self._root.children:
            if element.name == "DnaStation":
                yield _station(element)

    def measurements(self) -> Iterator[MeasurementRecord]:
        """The measurements, those that are switched off as well."""
        for element in self._root.children:
            if element.name == "DnaMeasurement":
                yield self._measurement(element)

    def _measurement(self, element: Element) -> MeasurementRecord:
        code = _content(element, "Type")
        if code not in TYPES or len(code) != 1:
            raise element.error(f"{quoted(code)!r} is not a type of measurement ({', '.join(sorted(TYPES))})")
        epoch = _epoch(element, _content(element, "Epoch", ""))
        header = Header(
            _content(element, "ReferenceFrame", "") or self.header.frame,
            self.header.epoch if math.isnan(epoch) else epoch,
        )
        make = _cluster if code in _MEMBERS else _directions if code == "D" else _single
        return make(element, code, header)


def _station(element: Element) -> StationRecord:
    coordinates = element.first("StationCoord")
    if coordinates is None:
        raise _missing(element, "StationCoord")
    return StationRecord(
        _name(element, "Name"),
        _content(element, "Constraints"),
        _content(element, "Type"),
        (_number(coordinates, "XAxis"), _number(coordinates, "YAxis"), _number(coordinates, "Height")),
        _content(coordinates, "HemisphereZone", ""),
        _content(element, "Description", ""),
        _place(element),
    )


def _single(element: Element, code: str, header: Header) -> MeasurementRecord:
    is_angle = code in ANGLES + GEOGRAPHIC
    tags = ("First", "Second", "Third")[: 3 if code in THREE_POINTS else 1 if code in ONE_POINT else 2]
    return MeasurementRecord(
        code,
        _is_on(element),
        tuple(_name(element, tag) for tag in tags),
        _packed(element) if is_angle else _number(element, "Value"),
        _number(element, "StdDev") * (SECOND if is_angle else 1.0),
        (_number(element, "InstHeight", 0.0), _number(element, "TargHeight", 0.0)),
        header=header,
        place=_place(element),
    )


def _directions(element: Element, code: str, header: Header) -> MeasurementRecord:
    station = _name(element, "First")
    parts = [(element, "Second"), *((child, "Target") for child in _all(element, "Directions"))]
    members = tuple(
        Member(
            (station, _name(part, tag)),
            (_packed(part),),
            _number(part, "StdDev") * SECOND,
            None,
            (),
            _is_on(part),
            _place(part),
        )
        for part, tag in parts
    )
    _check_total(element, len(members) - 1)
    return MeasurementRecord(
        code, _is_on(element), (station,), members=members, header=header, place=_place(element)
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
    scales = [_number(element, f"{letter}scale", 1.0) for letter in "VPLH"]
    return MeasurementRecord(
        code,
        _is_on(element),
        members[0].names,
        members=tuple(members),
        scales=(scales[0], scales[1], scales[2], scales[3]),
        system=_content(element, "Coords", "XYZ"),
        header=header,
        place=_place(element),
    )


def _parts(element: Element, code: str) -> Iterator[tuple[tuple[str, ...], Element]]:
    """The members of a cluster, with the points named before each."""
    names: dict[str, str] = {}
    wanted = ("First",) if code == "Y" else ("First", "Second")
    for child in element.children:
        if child.name in wanted:
            names[child.name] = _checked_name(child)
        elif child.name == _MEMBERS[code]:
            missing = [tag for tag in wanted if tag not in names]
            if missing:
                raise child.error(f"an element <{missing[0]}> is missing before it")
            yield tuple(names[tag] for tag in wanted), child


def _member(names: tuple[str, ...], part: Element, is_on: bool) -> Member:
    values = tuple(_number(part, tag) for tag in "XYZ")
    xx, xy, xz, yy, yz, zz = (_number(part, f"Sigma{tag}") for tag in ("XX", "XY", "XZ", "YY", "YZ", "ZZ"))
    covariance = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    crossed = tuple(_block(child) for child in _all(part, _CROSSED[part.name]))
    return Member(names, values, math.nan, covariance, crossed, is_on, _place(part))


def _block(element: Element) -> FloatArray:
    return np.array([[_number(element, f"m{row}{column}") for column in "123"] for row in "123"])


def _content(element: Element, tag: str, default: str | None = None) -> str:
    """The text of the first element inside with a name.

    Raises:
        InputError: there is none, and no default.
    """
    child = element.first(tag)
    if child is None and default is None:
        raise _missing(element, tag)
    return ("" if child is None else child.text.strip()) or default or ""


def _missing(element: Element, tag: str) -> InputError:
    return element.error(f"an element <{tag}> is missing in it")


def _number(element: Element, tag: str, default: float | None = None) -> float:
    """The number in the first element inside with a name."""
    text = _content(element, tag, "" if default is not None else None)
    if not text and default is not None:
        return default
    return element.parsed(text, tag)


def _all(element: Element, tag: str) -> Sequence[Element]:
    return list(element.named(tag))


def _is_on(element: Element) -> bool:
    return _content(element, "Ignore", "") != "*"


def _packed(element: Element) -> float:
    """The angle of <Value>."""
    try:
        return radians_of_packed(_number(element, "Value"))
    except ValueError as error:
        raise element.error(str(error)) from error


def _check_total(element: Element, count: int) -> None:
    total = _content(element, "Total", "")
    if total and total != str(count):
        raise element.error(f"<Total> is {quoted(total)}, and {count} members are in it")


def _name(element: Element, tag: str) -> str:
    child = element.first(tag)
    if child is None:
        raise _missing(element, tag)
    return _checked_name(child)


def _checked_name(element: Element) -> str:
    name = element.text.strip()
    if not name or len(name) > LONGEST_NAME:
        raise element.error(f"a name of 1 to {LONGEST_NAME} characters is needed")
    return name


def _epoch(element: Element, text: str) -> float:
    try:
        return decimal_year(text)
    except ValueError as error:
        raise element.error(f"epoch: {error}") from error


def _place(element: Element) -> Place:
    return Place(element.file.name, element.line)
