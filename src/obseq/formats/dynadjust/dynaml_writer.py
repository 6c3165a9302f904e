"""DynaML files of a network: stations and measurements for DynAdjust."""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.sax.saxutils import escape

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.reading.angles import SECOND
from obseq.survey.kinds.directions import ANGLE, AZIM, HZ, ZEN
from obseq.survey.kinds.geodetic import CHORD, GEO_X, HEIGHT, LATITUDE, LONGITUDE
from obseq.survey.kinds.lengths import DIST
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.kinds.vectors import VECTOR
from obseq.survey.model import FieldBook, Points

LONGEST = 20
"""Letters of the name of a station."""
SINGLE = {DIST: "S", CHORD: "C", ZEN: "V", AZIM: "B", ANGLE: "A", HEIGHT: "R", LATITUDE: "P", LONGITUDE: "Q"}
"""Types of single measurements."""
CLUSTERED = {
    VECTOR.group: ("X", "GPSBaseline", "GPSCovariance"),
    GEO_X.group: ("Y", "Clusterpoint", "PointCovariance"),
}


@dataclass(frozen=True, eq=False)
class DynamlNetwork:
    """A network as DynAdjust sees it.

    Attributes:
        points: Longitude and latitude in degrees, heights above the ellipsoid; held or free components.
        book: The observations.
        frame: Name of the reference frame.
        epoch: dd.mm.yyyy; empty for none.
    """

    points: Points
    book: FieldBook
    frame: str
    epoch: str = ""


def dynaml_text(network: DynamlNetwork) -> str:
    """Stations and measurements in one DynaML file.

    Raises:
        InputError: Something in the network cannot be said there; the message names it.
    """
    head = f'referenceframe="{escape(network.frame)}" epoch="{network.epoch}"'
    lines = ['<?xml version="1.0"?>', f'<DnaXmlFormat type="Combined File" {head}>']
    lines += _stations(network.points)
    lines += _measurements(network)
    return "\n".join([*lines, "</DnaXmlFormat>"]) + "\n"


def packed(radians: float, decimals: int = 9) -> str:
    """Degrees, minutes and seconds as ddd.mmssss."""
    seconds = round(abs(math.degrees(radians)) * 3600.0, decimals)
    degrees, rest = divmod(seconds, 3600.0)
    minutes, seconds = divmod(rest, 60.0)
    digits = f"{seconds:0{decimals + 3}.{decimals}f}".replace(".", "")
    return f"{'-' if radians < 0.0 else ''}{int(degrees)}.{int(minutes):02d}{digits}"


def _stations(points: Points) -> Iterator[str]:
    soft = np.flatnonzero((points.sigmas > 0.0).any(axis=1))
    if soft.size or points.covariance is not None or points.in_datum.any():
        row = int(soft[0]) if soft.size else 0
        raise InputError(
            f"point {points.names[row]} ({points.place(row)}): DynaML holds known coordinates exactly or "
            "frees them; a sigma of coordinates, or a datum, needs a measurement of the position"
        )
    for name, (longitude, latitude, height), held in zip(
        points.names, np.nan_to_num(points.coordinates).tolist(), points.is_held.tolist(), strict=True
    ):
        if len(name) > LONGEST:
            raise InputError(f"point {name}: DynAdjust takes names of {LONGEST} letters at most; shorten it")
        letters = "".join("C" if held[axis] else "F" for axis in (1, 0, 2))
        angles = (packed(math.radians(value)) for value in (latitude, longitude))
        axes = "".join(f"<{tag}>{text}</{tag}>" for tag, text in zip(("XAxis", "YAxis"), angles, strict=True))
        label = escape(name)
        yield f"<DnaStation><Name>{label}</Name><Constraints>{letters}</Constraints><Type>LLh</Type>"
        place = f"<Name>{label}</Name>{axes}<Height>{height!r}</Height>"
        yield f"<StationCoord>{place}</StationCoord></DnaStation>"


def _measurements(network: DynamlNetwork) -> Iterator[str]:
    book, rows = network.book, network.book.observations
    in_cluster = np.zeros(len(rows), np.bool_)
    for cluster in book.clusters:
        in_cluster[cluster.rows] = True
        yield from _cluster(book, cluster.rows.tolist(), cluster.covariance)
    done = np.zeros(len(book.stations), np.bool_)
    for row in np.flatnonzero(~in_cluster).tolist():
        kind, station = BY_CODE[int(rows.types[row])], int(rows.stations[row])
        if kind is HZ:
            if station >= 0 and not done[station]:
                done[station] = True
                members = [
                    int(k) for k in book.stations.observations(station) if BY_CODE[int(rows.types[k])] is HZ
                ]
                yield from _directions(book, members)
        elif kind in SINGLE:
            yield _single(book, row, SINGLE[kind])
        else:
            raise InputError(
                f"{book.label(row)}: DynaML has no {kind.words} that means the same; leave it out"
            )


def _begin(book: FieldBook, row: int, code: str, is_on: bool) -> str:
    _refuse_relative(book, row)
    ignore = "" if is_on else "*"
    return f"<DnaMeasurement><Type>{code}</Type><Ignore>{ignore}</Ignore>"


def _refuse_relative(book: FieldBook, row: int) -> None:
    if book.observations.relative_sigmas[row]:
        raise InputError(f"{book.label(row)}: DynaML has no sigma that depends on the distance")


def _names(book: FieldBook, *rows: int) -> str:
    tags = ("First", "Second", "Third")[: len(rows)]
    names = (escape(book.point_names[row]) for row in rows)
    return "".join(f"<{tag}>{name}</{tag}>" for tag, name in zip(tags, names, strict=True))


def _single(book: FieldBook, row: int, code: str) -> str:
    rows = book.observations
    ends = [int(rows.from_points[row]), int(rows.to_points[row])]
    if code == "A":
        ends.insert(1, int(rows.backsights[row]))
    elif ends[0] == ends[1]:
        ends.pop()
    is_angle = BY_CODE[int(rows.types[row])].is_angle
    value = float(rows.values[row])
    if code == "A":
        value %= 2.0 * math.pi
    text = packed(value) if is_angle else repr(value)
    sigma = float(rows.sigmas[row]) / (SECOND if is_angle else 1.0)
    heights = "".join(
        f"<{tag}>{float(height[row])!r}</{tag}>"
        for tag, height in (("InstHeight", rows.from_heights), ("TargHeight", rows.to_heights))
    )
    head = _begin(book, row, code, bool(rows.active[row])) + _names(book, *ends)
    return f"{head}<Value>{text}</Value><StdDev>{sigma!r}</StdDev>{heights}</DnaMeasurement>"


def _directions(book: FieldBook, members: list[int]) -> Iterator[str]:
    rows = book.observations
    first, *others = members
    if not others:
        raise InputError(
            f"{book.label(first)}: a set of one direction tells nothing; DynaML takes two or more"
        )
    yield _begin(book, first, "D", True) + _names(
        book, int(rows.from_points[first]), int(rows.to_points[first])
    )
    yield _reading(book, first) + f"<Total>{len(others)}</Total>"
    for row in others:
        _refuse_relative(book, row)
        name = escape(book.point_names[int(rows.to_points[row])])
        ignore = "" if rows.active[row] else "*"
        target = f"<Ignore>{ignore}</Ignore><Target>{name}</Target>"
        yield f"<Directions>{target}{_reading(book, row)}</Directions>"
    yield "</DnaMeasurement>"


def _reading(book: FieldBook, row: int) -> str:
    rows = book.observations
    value = float(rows.values[row]) % (2.0 * math.pi)
    return f"<Value>{packed(value)}</Value><StdDev>{float(rows.sigmas[row]) / SECOND!r}</StdDev>"


def _cluster(book: FieldBook, members: list[int], covariance: FloatArray) -> Iterator[str]:
    """A cluster of vectors or positions; of one vector too, which is the same."""
    rows, first = book.observations, members[0]
    family = BY_CODE[int(rows.types[first])].group
    if family not in CLUSTERED or len(members) % 3:
        raise InputError(f"{book.label(first)}: DynaML has no covariance of such observations")
    code, part, crossed = CLUSTERED[family]
    count = len(members) // 3
    blocks = covariance.reshape(count, 3, count, 3)
    yield _begin(book, first, code, bool(rows.active[first])) + f"<Total>{count}</Total>"
    for k in range(count):
        row = members[3 * k]
        ends = [int(rows.from_points[row]), int(rows.to_points[row])]
        yield _names(book, *(ends[:1] if code == "Y" else ends))
        values = "".join(f"<{axis}>{float(rows.values[row + n])!r}</{axis}>" for n, axis in enumerate("XYZ"))
        upper = "".join(
            f"<Sigma{'XYZ'[i]}{'XYZ'[j]}>{float(blocks[k, i, k, j])!r}</Sigma{'XYZ'[i]}{'XYZ'[j]}>"
            for i in range(3)
            for j in range(i, 3)
        )
        later = "".join(_crossed(crossed, blocks[k, :, other]) for other in range(k + 1, count))
        yield f"<{part}>{values}{upper}{later}</{part}>"
    yield ("<Coords>XYZ</Coords>" if code == "Y" else "") + "</DnaMeasurement>"


def _crossed(tag: str, block: FloatArray) -> str:
    entries = "".join(
        f"<m{i + 1}{j + 1}>{float(block[i, j])!r}</m{i + 1}{j + 1}>" for i in range(3) for j in range(3)
    )
    return f"<{tag}>{entries}</{tag}>"
