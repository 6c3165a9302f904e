"""Networks as files of gama-local: `read_gama` gives them back, Gama adjusts them to the same coordinates."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np

from obseq.errors import InputError
from obseq.survey.files.gama_values import MILLIMETRE, RADIANS_PER_CC, RADIANS_PER_GON
from obseq.survey.kinds.coordinates import POINT_X, POINT_Y, POINT_Z
from obseq.survey.kinds.directions import ANGLE, AZIM, HZ, ZEN
from obseq.survey.kinds.lengths import DH, DIST, DIST_HZ
from obseq.survey.kinds.registry import BY_CODE, codes
from obseq.survey.kinds.vectors import LOCAL_X, LOCAL_Y, LOCAL_Z
from obseq.survey.model import Orientation, automatic_fix

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from obseq.arrays import BoolArray, FloatArray
    from obseq.survey.kinds.kind import ObservationKind
    from obseq.survey.model import FieldBook, Points

NAMESPACE = "http://www.gnu.org/software/gama/gama-local"
ELEMENTS = {
    HZ.code: "direction",
    AZIM.code: "azimuth",
    ANGLE.code: "angle",
    ZEN.code: "z-angle",
    DIST.code: "s-distance",
    DIST_HZ.code: "distance",
}
VECTORS = codes(LOCAL_X, LOCAL_Y, LOCAL_Z)
COORDINATES = codes(POINT_X, POINT_Y, POINT_Z)
WRITTEN = (*ELEMENTS, DH.code, *VECTORS, *COORDINATES)
WITH_HEIGHTS = codes(DIST, ZEN)
LARGEST_PART = 300
"""Uncorrelated values from which a new set begins: its matrix stays small."""
IN_HEIGHT = (*codes(DIST, ZEN, DH, POINT_Z), *VECTORS)
ONLY_IN_HEIGHT = codes(DH, POINT_Z)


@dataclass(frozen=True, eq=False)
class GamaNetwork:
    """What is written.

    Attributes:
        points: Their coordinates in the axes of the file.
        book: The observations, numbered like the points.
        axes: Where x and y point to, such as `en`.
        turn: (3, 3) from east, north, up to the axes of the file.
        sigmas: (n,) standard deviations of the observations, with their relative parts (m, rad).
        unit_sigma: Standard deviation of unit weight.
        description: Text of the file.
    """

    points: Points
    book: FieldBook
    axes: str
    turn: FloatArray
    sigmas: FloatArray
    unit_sigma: float
    description: str = ""


def gama_text(network: GamaNetwork) -> str:
    """The network as the text of a file.

    Raises:
        InputError: Gama cannot adjust something in it; the observation or the point is named.
    """
    return "\n".join(_lines(network)) + "\n"


def _lines(network: GamaNetwork) -> Iterator[str]:
    writer = _Writer(network)
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield f'<gama-local xmlns="{NAMESPACE}">'
    yield f'<network axes-xy="{network.axes}" angles="left-handed">'
    yield f"<description>{_text(network.description)}</description>"
    yield f'<parameters sigma-apr="{network.unit_sigma:.15g}" sigma-act="aposteriori" />'
    yield "<points-observations>"
    yield from writer.points()
    yield from writer.stations()
    yield from writer.others()
    yield from writer.vectors()
    yield from writer.coordinates()
    yield from writer.switched_off()
    yield "</points-observations>"
    yield "</network>"
    yield "</gama-local>"


def _text(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


@dataclass
class _Set:
    """Elements that one covariance matrix belongs to.

    Attributes:
        head: Opening tag.
        elements: The elements, without standard deviations where they can have some.
        rows: Observation of each scalar.
        units: Metres or radians in one unit of the matrix, of each scalar.
    """

    head: str
    elements: list[str] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)
    units: list[float] = field(default_factory=list)


class _Writer:
    def __init__(self, network: GamaNetwork) -> None:
        self._network, self._book = network, network.book
        self._rows = network.book.observations
        self._cluster = np.full(len(self._rows), -1, np.int64)
        for number, cluster in enumerate(self._book.clusters):
            self._cluster[cluster.rows] = number
        self._check()

    def _check(self) -> None:
        """Refuses what Gama has no element for."""
        rows, book = self._rows, self._book
        unknown = np.flatnonzero(rows.active & ~np.isin(rows.types, WRITTEN))
        if unknown.size:
            kind = BY_CODE[int(rows.types[unknown[0]])]
            raise InputError(
                f"{book.label(int(unknown[0]))}: Gama has no observation like this ({kind.words})"
            )
        self._orientations = automatic_fix(book)
        free = np.isin(self._orientations, (Orientation.BASC, Orientation.GRID))
        if free.any():
            first = int(book.stations.observations(int(np.flatnonzero(free)[0]))[0])
            raise InputError(f"{book.label(first)}: Gama has no station that is not plumb (#BASC)")

    # Points

    def points(self) -> Iterator[str]:
        """All points, with the components that take part."""
        points = self._network.points
        plan, height = self._used()
        plan |= points.is_free[:, :2].any(axis=1)
        height |= points.is_free[:, 2]
        unused = ~(plan | height)
        plan, height = plan | unused, height | unused
        for row, name in enumerate(points.names):
            yield self._point(row, name, bool(plan[row]), bool(height[row]))

    def _used(self) -> tuple[BoolArray, BoolArray]:
        """(n,) of the points, whether observations concern the plan, and the height."""
        rows, n = self._rows, len(self._network.points)
        in_height = rows.active & np.isin(rows.types, IN_HEIGHT)
        in_plan = rows.active & ~np.isin(rows.types, ONLY_IN_HEIGHT)
        return rows.counts(in_plan, n) > 0, rows.counts(in_height, n) > 0

    def _point(self, row: int, name: str, plan: bool, height: bool) -> str:
        points = self._network.points
        sigmas, datum = points.sigmas[row], points.in_datum[row]
        if (sigmas[0] == 0.0) != (sigmas[1] == 0.0) or np.isnan(sigmas[0]) != np.isnan(sigmas[1]):
            raise InputError(
                f"point {name} ({points.place(row)}): one of x and y is known, and Gama knows both or none"
            )
        fix, adj = "", ""
        for axes, used, first in (("xy", plan, 0), ("z", height, 2)):
            if used and sigmas[first] == 0.0:
                fix += axes
            elif used:
                adj += axes.upper() if datum[first] else axes
        xyz = points.coordinates[row]
        parts = [f"id={quoteattr(name)}"]
        if plan and np.isfinite(xyz[:2]).all():
            parts.append(f'x="{float(xyz[0])!r}" y="{float(xyz[1])!r}"')
        if height and np.isfinite(xyz[2]):
            parts.append(f'z="{float(xyz[2])!r}"')
        parts += [f'fix="{fix}"'] if fix else []
        parts += [f'adj="{adj}"'] if adj else []
        return f"<point {' '.join(parts)} />"

    # Sights

    def stations(self) -> Iterator[str]:
        """The set-ups: directions with what else was read there."""
        for station in range(len(self._book.stations)):
            members = self._book.stations.observations(station)
            active = [int(row) for row in members if self._rows.active[row]]
            name = self._book.point_names[self._book.stations.origins[station]]
            if active:
                sights = _Set(f"<obs from={quoteattr(name)}>")
                for row in active:
                    self._add_sight(sights, row, self._orientations[station] == Orientation.FIX)
                yield from self._set(sights, "</obs>")

    def others(self) -> Iterator[str]:
        """Angles, distances and height differences; those of a cluster are a set of their own."""
        rows = self._rows
        for chosen, head, tail in (
            ((ANGLE, DIST, DIST_HZ), "<obs>", "</obs>"),
            ((DH,), "<height-differences>", "</height-differences>"),
        ):
            mine = np.flatnonzero(rows.active & np.isin(rows.types, codes(*chosen)))
            for members in self._by_cluster(mine):
                whole = _Set(head)
                for row in members:
                    if chosen == (DH,):
                        self._add_rise(whole, row)
                    else:
                        self._add_sight(whole, row, is_fixed=False)
                yield from self._set(whole, tail)

    def _by_cluster(self, rows: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Iterator[list[int]]:
        """The rows of no cluster together, then those of each cluster."""
        numbers = self._cluster[rows]
        order = np.argsort(numbers, kind="stable")
        starts = np.flatnonzero(np.diff(numbers[order])) + 1
        yield from (part.tolist() for part in np.split(rows[order], starts) if part.size)

    def _parts(self, rows: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Iterator[list[int]]:
        """The same, in parts of which a matrix is not too large: those of one point stay together."""
        for members in self._by_cluster(rows):
            if self._cluster[members[0]] >= 0:
                yield members
                continue
            part: list[int] = []
            for row in members:
                if (
                    len(part) >= LARGEST_PART
                    and self._rows.from_points[row] != self._rows.from_points[part[-1]]
                ):
                    yield part
                    part = []
                part.append(row)
            yield part

    def _add_sight(self, sights: _Set, row: int, is_fixed: bool) -> None:
        rows, kind = self._rows, BY_CODE[int(self._rows.types[row])]
        name = "azimuth" if kind is HZ and is_fixed else ELEMENTS[kind.code]
        origin, target, back = (
            quoteattr(self._book.point_names[ends[row]]) if ends[row] >= 0 else ""
            for ends in (rows.from_points, rows.to_points, rows.backsights)
        )
        ends = f"bs={back} fs={target}" if kind is ANGLE else f"to={target}"
        start = "" if kind is HZ and not is_fixed else f"from={origin} "
        unit = RADIANS_PER_GON if kind.is_angle else 1.0
        number = float(rows.values[row]) / unit
        value = number % 400.0 if kind.is_angle and kind is not ZEN else number
        heights = self._heights(row) if kind.code in WITH_HEIGHTS else ""
        sights.elements.append(f"{name} {start}{ends} val={_number(value)}{heights}{self._extern(row)}")
        self._add_row(sights, row, kind)

    def _add_rise(self, whole: _Set, row: int) -> None:
        rows = self._rows
        value = float(rows.values[row] + rows.from_heights[row] - rows.to_heights[row])
        origin, target = (
            quoteattr(self._book.point_names[ends[row]]) for ends in (rows.from_points, rows.to_points)
        )
        whole.elements.append(f"dh from={origin} to={target} val={_number(value)}{self._extern(row)}")
        self._add_row(whole, row, DH)

    def _add_row(self, whole: _Set, row: int, kind: ObservationKind) -> None:
        whole.rows.append(row)
        whole.units.append(RADIANS_PER_CC if kind.is_angle else MILLIMETRE)

    def _heights(self, row: int) -> str:
        low, high = float(self._rows.from_heights[row]), float(self._rows.to_heights[row])
        return f" from_dh={_number(low)} to_dh={_number(high)}" if low or high else ""

    def _extern(self, row: int) -> str:
        file = Path(self._book.files[self._rows.file_indices[row]]).name
        return f" extern={quoteattr(f'{file}:{self._rows.lines[row]}')}"

    def _set(self, whole: _Set, tail: str) -> Iterator[str]:
        """A set: each element with its standard deviation, or all with a matrix."""
        yield whole.head
        if (self._cluster[whole.rows] < 0).all():
            for element, row, unit in zip(whole.elements, whole.rows, whole.units, strict=True):
                yield f"  <{element} stdev={_number(float(self._network.sigmas[row]) / unit)} />"
        else:
            yield from (f"  <{element} />" for element in whole.elements)
            yield from _matrix(self._covariance(whole.rows), np.array(whole.units))
        yield tail

    def _covariance(self, rows: Sequence[int]) -> FloatArray:
        """(k, k) of some observations: all of their clusters must be among them."""
        place = {row: k for k, row in enumerate(rows)}
        matrix = np.diag(np.square(self._network.sigmas[list(rows)]))
        for number in sorted({int(self._cluster[row]) for row in rows} - {-1}):
            cluster = self._book.clusters[number].among(self._rows.active)
            outside = [int(row) for row in cluster.rows if int(row) not in place]
            if outside:
                raise InputError(
                    f"{self._book.label(outside[0])}: it is correlated with observations of another set, "
                    "which Gama's matrices do not join"
                )
            chosen = [place[int(row)] for row in cluster.rows]
            matrix[np.ix_(chosen, chosen)] = cluster.covariance
        return matrix

    # Vectors and coordinates

    def vectors(self) -> Iterator[str]:
        """Vectors, whose three components follow each other."""
        rows = self._rows
        mine = np.flatnonzero(rows.active & np.isin(rows.types, VECTORS))
        for members in self._parts(mine):
            triples = [
                sorted(members[k : k + 3], key=lambda row: int(rows.types[row]))
                for k in range(0, len(members), 3)
            ]
            for triple in triples:
                if len(triple) < 3 or rows.types[triple].tolist() != VECTORS:
                    raise InputError(f"{self._book.label(triple[0])}: Gama takes vectors of three components")
            yield "<vectors>"
            yield from (self._vector(triple) for triple in triples)
            yield from self._turned([row for triple in triples for row in triple])
            yield "</vectors>"

    def _vector(self, triple: list[int]) -> str:
        rows = self._rows
        lift = np.array([0.0, 0.0, float(rows.from_heights[triple[0]] - rows.to_heights[triple[0]])])
        numbers = self._network.turn @ (rows.values[triple] + lift)
        parts = (f"d{axis}={_number(float(value))}" for axis, value in zip("xyz", numbers, strict=True))
        origin, target = (
            quoteattr(self._book.point_names[ends[triple[0]]]) for ends in (rows.from_points, rows.to_points)
        )
        return f"  <vec from={origin} to={target} {' '.join(parts)}{self._extern(triple[0])} />"

    def _turned(self, members: list[int]) -> Iterator[str]:
        """The matrix of vectors, in the axes of the file."""
        turn = np.kron(np.eye(len(members) // 3), self._network.turn)
        covariance = turn @ self._covariance(members) @ turn.T
        yield from _matrix(covariance, np.full(len(members), MILLIMETRE))

    def coordinates(self) -> Iterator[str]:
        """Observed coordinates, and known ones with a standard deviation."""
        rows = self._rows
        mine = np.flatnonzero(rows.active & np.isin(rows.types, COORDINATES))
        for members in self._parts(mine):
            axes = [COORDINATES.index(int(rows.types[row])) for row in members]
            named = [
                (int(rows.from_points[row]), *self._along(axis), float(rows.values[row]), row)
                for row, axis in zip(members, axes, strict=True)
            ]
            signs = np.array([sign for _, _, sign, _, _ in named])
            covariance = self._covariance(members) * np.outer(signs, signs)
            yield from self._observed([(p, a, s * v) for p, a, s, v, _ in named], covariance)
        yield from self._known()

    def _along(self, axis: int) -> tuple[int, float]:
        """Axis of the file that is an axis of the frame, and its sense."""
        column = self._network.turn[:, axis]
        other = int(np.abs(column).argmax())
        return other, float(column[other])

    def _known(self) -> Iterator[str]:
        points = self._network.points
        rows = np.flatnonzero((points.sigmas > 0.0).any(axis=1))
        size = max(len(rows), 1) if points.covariance is not None else LARGEST_PART
        for first in range(0, len(rows), size):
            chosen = rows[first : first + size]
            places = [
                (row, axis) for row in chosen.tolist() for axis in range(3) if points.sigmas[row, axis] > 0.0
            ]
            yield from self._known_part(places)

    def _known_part(self, places: list[tuple[int, int]]) -> Iterator[str]:
        points = self._network.points
        covariance = np.diag([float(points.sigmas[row, axis]) ** 2 for row, axis in places])
        if points.covariance is not None:
            order = {(points.names[row], axis): k for k, (row, axis) in enumerate(places)}
            chosen = [order[key] for key in points.covariance.coordinates]
            covariance[np.ix_(chosen, chosen)] = points.covariance.matrix
        values = [(row, axis, float(points.coordinates[row, axis])) for row, axis in places]
        yield from self._observed(values, covariance)

    def _observed(self, values: list[tuple[int, int, float]], covariance: FloatArray) -> Iterator[str]:
        """A set of coordinates (point, axis, value), sorted by point and axis as Gama wants them."""
        order = sorted(range(len(values)), key=lambda k: values[k][:2])
        by_point: dict[int, dict[str, float]] = {}
        for k in order:
            point, axis, value = values[k]
            if "xyz"[axis] in by_point.setdefault(point, {}):
                raise InputError(
                    f"point {self._book.point_names[point]}: a coordinate is observed twice in one cluster, "
                    "which Gama does not take"
                )
            by_point[point]["xyz"[axis]] = value
        yield "<coordinates>"
        for point, given in by_point.items():
            name = self._book.point_names[point]
            if ("x" in given) != ("y" in given):
                raise InputError(f"point {name}: one of x and y is observed, and Gama takes both or none")
            parts = (f"{axis}={_number(value)}" for axis, value in given.items())
            yield f"  <point id={quoteattr(name)} {' '.join(parts)} />"
        yield from _matrix(covariance[np.ix_(order, order)], np.full(len(order), MILLIMETRE))
        yield "</coordinates>"

    def switched_off(self) -> Iterator[str]:
        """What is not active, as remarks."""
        for row in np.flatnonzero(~self._rows.active).tolist():
            yield f"<!-- switched off: {self._book.label(row).replace('--', '- -')} -->"


def _number(value: float) -> str:
    return f'"{value:.15g}"'


def _matrix(covariance: FloatArray, units: FloatArray) -> Iterator[str]:
    """A covariance (k, k) in squares of m and rad, as the narrowest band that holds it."""
    scaled = covariance / np.outer(units, units)
    rows, columns = np.nonzero(scaled)
    band = int(np.max(columns - rows, initial=0))
    dim = len(scaled)
    yield f'  <cov-mat dim="{dim}" band="{band}">'
    for row in range(dim):
        yield "    " + " ".join(f"{value:.16g}" for value in scaled[row, row : min(row + band + 1, dim)])
    yield "  </cov-mat>"
