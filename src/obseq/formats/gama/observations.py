"""Observations of Gama's files: sets of an instrument, height differences, vectors, coordinates."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.formats.columns import Columns, Measure
from obseq.formats.gama import values
from obseq.formats.gama.points import PointTable
from obseq.formats.gama.values import Band, Value
from obseq.graphs import parts
from obseq.reading.text import quoted
from obseq.reading.xml import Element
from obseq.records.adjustment import UnusedRecord
from obseq.survey.kinds.coordinates import POINT_X, POINT_Y, POINT_Z
from obseq.survey.kinds.directions import ANGLE, AZIM, HZ, ZEN
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.kinds.lengths import DH, DIST, DIST_HZ
from obseq.survey.kinds.vectors import LOCAL_X, LOCAL_Y, LOCAL_Z

FULL_TURN = 2.0 * math.pi
PLAN, HEIGHT, SPACE = (True, False), (False, True), (True, True)
COMMON = ("from", "to", "val", "stdev", "extern", "from_dh", "to_dh")
SIGHTS: dict[str, tuple[ObservationKind, tuple[bool, bool], str]] = {
    "direction": (HZ, PLAN, "direction-stdev"),
    "distance": (DIST_HZ, PLAN, "distance-stdev"),
    "s-distance": (DIST, SPACE, "distance-stdev"),
    "angle": (ANGLE, PLAN, "angle-stdev"),
    "z-angle": (ZEN, SPACE, "zenith-angle-stdev"),
    "azimuth": (AZIM, PLAN, "azimuth-stdev"),
}
"""Of the elements of a set: kind, whether plan and height of the points take part, default sigma."""


@dataclass(frozen=True)
class Defaults:
    """Default standard deviations of a section, as written.

    Attributes:
        section: Its element.
        unit_sigma: Standard deviation of unit weight (mm, cc).
        hand: 1 for angles that grow clockwise, -1 for the others.
        axes: (3, 3) axes of the file, by rows, in east, north and up.
    """

    section: Element
    unit_sigma: float
    hand: float
    axes: FloatArray

    def sigma(self, name: str, value: float) -> float | None:
        """The default of a name, in the unit of sigmas; that of a length depends on it."""
        if name == "distance-stdev":
            found = values.distance_sigma(self.section, name)
            return None if found is None else found.of(value)
        return self.section.positive(name)


@dataclass
class _Scalar:
    """A value of a set, before its sigma is known.

    Attributes:
        measure: With its sigma if one is written, else 0.
        element: Where it stands.
        unit: Metres or radians in one unit of the entries of a matrix.
        sign: Of the value with respect to the one written.
        problem: Why it is left out; empty when it is not.
        ends: Names of its points.
    """

    measure: Measure
    element: Element
    unit: float
    sign: float = 1.0
    problem: str = ""
    ends: Sequence[str] = ()


class ObservationReader:
    """Reads sections into columns, once all points are known."""

    def __init__(self, points: PointTable, columns: Columns, file: int) -> None:
        self._points, self._columns, self._file = points, columns, file
        self.passive: dict[str, list[str]] = {}

    def read(self, element: Element, defaults: Defaults) -> None:
        """Adds the observations of one set."""
        readers: dict[str, Callable[[Element, Defaults], list[_Scalar]]] = {
            "obs": self._sights,
            "height-differences": self._rises,
            "vectors": self._vectors,
            "coordinates": self._coordinates,
        }
        scalars = readers[element.name](element, defaults)
        matrix = element.first("cov-mat")
        if matrix is None:
            self._require_sigmas(scalars)
            self._add(scalars)
        elif element.children[-1] is not matrix or len(list(element.named("cov-mat"))) > 1:
            raise matrix.error("a cov-mat is the last element of its set, and the only one")
        else:
            self._add_correlated(scalars, values.covariance_band(matrix, len(scalars)))

    # What sets hold

    def _sights(self, element: Element, defaults: Defaults) -> list[_Scalar]:
        element.allow(("from", "orientation", "from_dh"), (*SIGHTS, "cov-mat"))
        scalars = [self._sight(child, element, defaults) for child in element.named(*SIGHTS)]
        directions = [s for s in scalars if s.measure.kind is HZ and not s.problem]
        if len({s.measure.target for s in directions}) == 1:
            for scalar in directions:
                scalar.problem = "the set has directions to one target only, which orient it and no more"
        self._open_stations(scalars)
        return scalars

    def _sight(self, child: Element, parent: Element, defaults: Defaults) -> _Scalar:
        kind, parts, default = SIGHTS[child.name]
        is_angle = kind is ANGLE
        child.allow((*COMMON, "bs", "fs", "rs", "bs_dh", "fs_dh") if is_angle else COMMON)
        start = parent.get("from") if kind is HZ else child.get("from") or parent.get("from")
        if start is None:
            raise child.error(_without_station(child, parent, kind))
        target = child.get("fs") or child.get("rs") if is_angle else child.wanted("to")
        backsight = (child.get("bs") or child.get("to")) if is_angle else None
        if target is None or (is_angle and backsight is None):
            raise child.error("<angle> needs bs and fs, the points of the backsight and of the foresight")
        ends = [start, target, *([backsight] if backsight else [])]
        if len(set(ends)) < len(ends):
            raise child.error(f"<{child.name}> names a point twice; correct one of the names")
        value, sign = _measured(child, kind, defaults.hand)
        sigma = child.positive("stdev")
        if sigma is None:
            sigma = defaults.sigma(default, value.number)
        heights = self._heights(child, parent) if kind in (DIST, ZEN) else (0.0, 0.0)
        rows = [self._row(child, name) for name in ends]
        measure = Measure(
            kind,
            rows[0],
            rows[1],
            value.number,
            (sigma or 0.0) * value.unit,
            from_height=heights[0],
            to_height=heights[1],
            backsight=rows[2] if is_angle else -1,
        )
        return self._judged(_Scalar(measure, child, value.unit, sign), ends, parts)

    @staticmethod
    def _heights(child: Element, parent: Element) -> tuple[float, float]:
        own = child.number("from_dh")
        instrument = parent.number("from_dh") if own is None else own
        return instrument or 0.0, child.number("to_dh") or 0.0

    def _open_stations(self, scalars: list[_Scalar]) -> None:
        """Directions of a set have one station; zenith angles join it, or have one of their point."""
        stations: dict[int, int] = {}
        for scalar in scalars:
            measure = scalar.measure
            station = self._columns.station_of(measure.kind, measure.origin, stations)
            scalar.measure = measure._replace(station=station)

    def _rises(self, element: Element, defaults: Defaults) -> list[_Scalar]:
        element.allow((), ("dh", "cov-mat"))
        return [self._rise(child, defaults) for child in element.named("dh")]

    def _rise(self, child: Element, defaults: Defaults) -> _Scalar:
        child.allow(("from", "to", "val", "stdev", "dist", "extern"))
        ends = [child.wanted("from"), child.wanted("to")]
        if ends[0] == ends[1]:
            raise child.error("<dh> names a point twice; correct one of the names")
        value, sigma, way = values.length(child), child.positive("stdev"), child.number("dist")
        if way is not None and way < 0.0:
            raise child.error(f"<dh> dist is {way:g}; it is a length in kilometres")
        if sigma is None and way:
            sigma = defaults.unit_sigma * math.sqrt(way)
        start, target = (self._row(child, name) for name in ends)
        measure = Measure(DH, start, target, value.number, (sigma or 0.0) * value.unit)
        return self._judged(_Scalar(measure, child, value.unit), ends, HEIGHT)

    def _vectors(self, element: Element, defaults: Defaults) -> list[_Scalar]:
        element.allow((), ("vec", "cov-mat"))
        _require_matrix(element)
        return [s for child in element.named("vec") for s in self._vector(child, defaults)]

    def _vector(self, child: Element, defaults: Defaults) -> list[_Scalar]:
        child.allow(("from", "to", "dx", "dy", "dz", "extern", "from_dh", "to_dh"))
        ends = [child.wanted("from"), child.wanted("to")]
        if ends[0] == ends[1]:
            raise child.error("<vec> names a point twice; correct one of the names")
        rows = [self._row(child, name) for name in ends]
        heights = (child.number("from_dh") or 0.0, child.number("to_dh") or 0.0)
        return [
            self._judged(self._along(child, axis, f"d{axis}", rows, defaults, heights), ends, SPACE)
            for axis in "xyz"
        ]

    def _coordinates(self, element: Element, defaults: Defaults) -> list[_Scalar]:
        element.allow(("extern",), ("point", "cov-mat"))
        _require_matrix(element)
        return [s for child in element.named("point") for s in self._coordinate(child, defaults)]

    def _coordinate(self, child: Element, defaults: Defaults) -> list[_Scalar]:
        name = child.wanted("id")
        row = self._row(child, name)
        given = [axis for axis in "xyz" if child.get(axis) is not None]
        if not given:
            raise child.error("<point> of observed coordinates has none; give x and y, or z")
        return [
            self._judged(
                self._along(child, axis, axis, [row, row], defaults), [name], HEIGHT if axis == "z" else PLAN
            )
            for axis in given
        ]

    def _along(
        self,
        child: Element,
        axis: str,
        name: str,
        rows: list[int],
        defaults: Defaults,
        heights: tuple[float, float] = (0.0, 0.0),
    ) -> _Scalar:
        """A component along an axis of the file, as that of the frame which the axis is."""
        direction = defaults.axes["xyz".index(axis)]
        component = int(np.abs(direction).argmax())
        sign = float(direction[component])
        kinds = (POINT_X, POINT_Y, POINT_Z) if name == axis else (LOCAL_X, LOCAL_Y, LOCAL_Z)
        value = values.length(child, name)
        measure = Measure(
            kinds[component],
            rows[0],
            rows[1],
            sign * value.number,
            0.0,
            from_height=heights[0],
            to_height=heights[1],
        )
        return _Scalar(measure, child, value.unit, sign)

    # What they become

    def _row(self, element: Element, name: str) -> int:
        return self._columns.point(element.file, element.line - 1, name)

    def _judged(self, scalar: _Scalar, ends: Sequence[str], parts: tuple[bool, bool]) -> _Scalar:
        """The scalar, with the reason why it is passive, if there is one."""
        scalar.ends = ends
        for name in ends:
            point = self._points.get(name)
            if point is None:
                scalar.problem = f"point {name} is not declared"
            elif not (point.has_plan or point.has_height):
                scalar.problem = f"point {name} has neither fix nor adj"
            elif parts[0] and not point.has_plan:
                scalar.problem = f"point {name} is known in height only"
            elif parts[1] and not point.has_height:
                scalar.problem = f"point {name} is known in plan only"
            if scalar.problem:
                break
        return scalar

    @staticmethod
    def _require_sigmas(scalars: list[_Scalar]) -> None:
        for scalar in scalars:
            if scalar.measure.sigma <= 0.0:
                raise scalar.element.error(
                    f"<{scalar.element.name}> has no standard deviation: give it a stdev, its section a "
                    "default (attributes of points-observations), or its set a cov-mat"
                )

    def _add(self, scalars: list[_Scalar]) -> list[int]:
        """Adds the values, those of one element by the axes of the frame; returns their rows."""
        elements = {id(scalar.element): k for k, scalar in reversed(list(enumerate(scalars)))}
        order = sorted(
            range(len(scalars)),
            key=lambda k: (elements[id(scalars[k].element)], scalars[k].measure.kind.code),
        )
        rows = [0] * len(scalars)
        for k in order:
            scalar, rows[k] = scalars[k], len(self._columns)
            measure = scalar.measure
            if scalar.problem:
                measure = replace_activity(measure)
                self.passive.setdefault(scalar.problem, []).append(self._label(scalar))
            self._columns.append(measure, self._file, scalar.element.line - 1)
        return rows

    def _add_correlated(self, scalars: list[_Scalar], band: Band) -> None:
        scaled = band.scaled(np.array([scalar.unit * scalar.sign for scalar in scalars]))
        for scalar, sigma in zip(scalars, scaled.sigmas.tolist(), strict=True):
            scalar.measure = scalar.measure._replace(sigma=sigma)
        rows = self._add(scalars)
        for first, matrix in scaled.blocks():
            self._correlate(rows[first : first + len(matrix)], matrix)

    def _correlate(self, rows: list[int], matrix: FloatArray) -> None:
        """A cluster for all that hangs together in a block of a matrix."""
        labels = _hanging_together(matrix)
        for label in np.unique(labels):
            chosen = sorted(np.flatnonzero(labels == label).tolist(), key=rows.__getitem__)
            if len(chosen) > 1:
                self._columns.correlate([rows[k] for k in chosen], matrix[np.ix_(chosen, chosen)])

    @staticmethod
    def _label(scalar: _Scalar) -> str:
        return f"{scalar.element.name} {' -> '.join(scalar.ends)} (line {scalar.element.line})"

    def unused(self) -> Iterator[UnusedRecord]:
        """The observations that are left out, by reason."""
        yield from (UnusedRecord(reason, tuple(labels)) for reason, labels in self.passive.items())

    def warnings(self, file: str) -> list[str]:
        """One sentence for each reason why observations are left out, with all of these."""
        return [
            f"{file}: left out, as gama-local does without a word, because {reason}: {', '.join(labels)}"
            for reason, labels in self.passive.items()
        ]


def _hanging_together(matrix: FloatArray) -> IntArray:
    """(n,) of rows of a covariance matrix (n, n): a number that is that of all they are correlated with."""
    if matrix.all():
        return np.zeros(len(matrix), np.int64)
    return np.asarray(parts(len(matrix), *np.nonzero(matrix)), np.int64)


def replace_activity(measure: Measure) -> Measure:
    """The measure, switched off."""
    return measure._replace(is_active=False)


def _measured(child: Element, kind: ObservationKind, hand: float) -> tuple[Value, float]:
    """The value of a sight, clockwise and within a turn, and its sign with respect to the one written."""
    if not kind.is_angle:
        value = values.length(child)
        if value.number <= 0.0:
            raise child.error(f"<{child.name}> val is {value.number:g}; a distance is above zero")
        return value, 1.0
    value = values.angle(child)
    sign = 1.0 if kind is ZEN else hand
    number = sign * value.number % FULL_TURN
    if kind is ZEN and number > math.pi:  # the instrument in its second face
        number, sign = FULL_TURN - number, -1.0
    return Value(number, value.unit), sign


def _require_matrix(element: Element) -> None:
    if element.first("cov-mat") is None:
        raise element.error(f"<{element.name}> has no cov-mat; it is the only source of their precision")


def _without_station(child: Element, parent: Element, kind: ObservationKind) -> str:
    """What is missing where nothing says from where a sight goes."""
    if kind is not HZ:
        return f"<{child.name}> has no from, nor has its <{parent.name}>; give one of them"
    station = child.get("from") or "NAME"
    return (
        f"<{parent.name}> (line {parent.line}) has no from: the directions of a set are from one station, "
        f'which the set names; write <{parent.name} from="{quoted(station)}">'
    )
