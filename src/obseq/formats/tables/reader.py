"""Tables with named columns (.csv): of points and of observations, told apart by their columns."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from obseq.errors import InputError, ObseqError
from obseq.formats.columns import Columns, Measure
from obseq.formats.levelled_points import hold_plans, with_heights
from obseq.formats.project import Project, Reading
from obseq.formats.tables.clusters import Clusters
from obseq.formats.tables.table import CLUSTERED, OF_OBSERVATIONS, OF_POINTS, Table, shown_in
from obseq.printable import printable
from obseq.reading.text import LEAST_SIGMA, quoted, read_text
from obseq.survey.kinds.coordinates import BARY_X, BARY_Y, BARY_Z, POINT_X, POINT_Y, POINT_Z
from obseq.survey.kinds.directions import ANGLE, AZIM
from obseq.survey.kinds.formulas import FormulaKind
from obseq.survey.kinds.geodetic import CHORD, GEO_X, GEO_Y, GEO_Z, HEIGHT, LATITUDE, LONGITUDE
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.kinds.lengths import DIST_HZ
from obseq.survey.kinds.registry import KINDS, kind_of_formula
from obseq.survey.kinds.vectors import LOCAL_X, LOCAL_Y, LOCAL_Z, VECTOR, VECTOR_Y, VECTOR_Z
from obseq.survey.model import Orientation, Points, make_points, merge_points

MORE_OF_POINTS = ("sx", "sy", "sz", "unit", "remark")
MORE_OF_OBSERVATIONS = (
    *("unit", "backsight", "set", "orientation", "instrument", "relative_sigma", "from_height", "to_height"),
    *("weights", *CLUSTERED, "active", "remark"),
)
OF_FORMULAS, MORE_OF_FORMULAS = ("formula", "sigma"), ("unit", *CLUSTERED, "active", "remark")
OWN_OF_FORMULAS = (*OF_FORMULAS, *MORE_OF_FORMULAS)
BARYCENTRES, ALL_OF_BARYCENTRE = (BARY_X, BARY_Y, BARY_Z), "barycentre"
"""The conditions of a barycentre, and what calls for all of them."""
LEAST_SUM = 1e-6
"""Sum of the weights of a barycentre: some may be negative, all together not nothing."""
VECTORS = (VECTOR, VECTOR_Y, VECTOR_Z, LOCAL_X, LOCAL_Y, LOCAL_Z)
POSITIONS = (GEO_X, GEO_Y, GEO_Z, POINT_X, POINT_Y, POINT_Z)
ALONE = (ANGLE, DIST_HZ, HEIGHT, LATITUDE, LONGITUDE, CHORD, *VECTORS, *POSITIONS, *BARYCENTRES)
"""Kinds that a row can hold, and no line of an OBS file."""
TYPES = {kind.name.lower(): kind for kind in KINDS if kind.is_line or kind in ALONE}
"""Kinds that a row can hold, by name in small letters."""


def read_tables(paths: tuple[Path, ...], reading: Reading) -> Project:
    """Reads tables of points and of observations that belong together.

    Raises:
        InputError: Naming file and line, what is wrong and what to do.
    """
    columns, clusters, points, named = Columns(), Clusters(), [], set[str]()
    units: list[float] = []
    for path in paths:
        table = Table(read_text(path, reading.encoding))
        table.check_rows()
        if {"type", "formula"} & table.columns.keys():
            add_observations(table, columns, clusters)
        else:
            points.append(points_in(table, units))
        named |= table.units
    clusters.give(columns)
    if not len(columns) or not (points or reading.has_points):
        raise InputError(_only_of(paths, "observations" if points else "points"))
    points.append(make_points([], np.zeros((0, 3))))
    shown = shown_in(frozenset(named))
    book = columns.field_book()
    given = with_heights(hold_plans(merge_points(points), book), book)
    return Project(given, book, shown=shown, units=np.array(units))


def read_point_table(path: str | Path, encoding: str) -> tuple[Points, list[float]]:
    """Reads a table of points: them in metres, and the unit of each (m; NaN for that of its system)."""
    table, units = Table(read_text(path, encoding)), list[float]()
    table.check_rows()
    return points_in(table, units), units


def _only_of(paths: tuple[Path, ...], lacking: str) -> str:
    """What to do where no table of the other kind is given."""
    given, wanted = ("points", OF_OBSERVATIONS) if lacking == "observations" else ("observations", OF_POINTS)
    listed = ", ".join(map(str, paths))
    return (
        f"{listed}: only {given}; name the table of {lacking} too (its columns: {' '.join(wanted)}), for "
        "instance: obseq adjust points.csv observations.csv"
    )


def add_observations(table: Table, columns: Columns, clusters: Clusters) -> None:
    """Adds the rows of a table of observations, or of formulas."""
    is_of_formulas = "formula" in table.columns and "type" not in table.columns
    (_Formulas if is_of_formulas else _Observations)(table, columns, clusters).read()


def points_in(table: Table, units: list[float]) -> Points:
    """The points: free where a sigma is empty, held where it is 0.

    Args:
        table: Their rows.
        units: Takes the unit of each in metres; NaN for coordinates without, in the units of their system.
    """
    table.check(OF_POINTS, MORE_OF_POINTS)
    names, coordinates, sigmas, infos, lines = [], [], [], [], []
    for index, cells in table.rows():
        name = cells["name"]
        table.file.check_name(index, name)
        if not name:
            raise table.file.error(index, "a point has no name")
        names.append(name)
        unit = table.length_unit(index, cells)
        units.append(unit if cells.get("unit") else math.nan)
        coordinates.append([unit * table.number(index, cells, axis, math.nan) for axis in "xyz"])
        sigmas.append([unit * table.number(index, cells, f"s{axis}", math.nan) for axis in "xyz"])
        if any(sigma < 0.0 or 0.0 < sigma < LEAST_SIGMA for sigma in sigmas[-1]):
            raise table.file.error(index, "a sigma is empty (free), 0 (held) or positive")
        if any(math.isnan(x) and not math.isnan(s) for x, s in zip(coordinates[-1], sigmas[-1], strict=True)):
            raise table.file.error(index, "a coordinate that is not given has a sigma")
        infos.append(cells.get("remark", ""))
        lines.append(index + 1)
    n = len(names)
    return Points(
        tuple(names),
        np.reshape(coordinates, (n, 3)).astype(np.float64),
        np.reshape(sigmas, (n, 3)).astype(np.float64),
        np.full((n, 2), np.nan),
        tuple(infos),
        (table.file.name,),
        np.zeros(n, np.int32),
        np.array(lines, np.int32),
    )


class _Observations:
    """Reads a table of observations into columns."""

    def __init__(self, table: Table, columns: Columns, clusters: Clusters) -> None:
        table.check(OF_OBSERVATIONS, MORE_OF_OBSERVATIONS)
        self._table, self._columns, self._clusters = table, columns, clusters
        self._number = columns.open_file(table.file)
        self._stations: dict[tuple[int, str, Orientation, bool], int] = {}

    def read(self) -> None:
        """Adds all rows."""
        for index, cells in self._table.rows():
            for kind in self._kinds(index, cells):
                measure = self._measure(index, cells, kind)
                self._table.correlate(index, cells, self._clusters, len(self._columns), measure)
                self._columns.append(measure, self._number, index)

    def _measure(self, index: int, cells: dict[str, str], kind: ObservationKind) -> Measure:
        table = self._table
        unit = table.unit(index, cells, kind)
        value = table.number(index, cells, "value") * unit
        sigma = table.number(index, cells, "sigma") * unit
        relative = table.number(index, cells, "relative_sigma", 0.0)
        is_active = table.is_active(index, cells)
        if is_active:
            table.check_measure(index, kind, value, sigma, relative)
        if kind in BARYCENTRES:
            return self._barycentre(index, cells, Measure(kind, -1, -1, value, sigma, is_active))
        if cells.get("weights"):
            raise table.file.error(index, f"{kind.words}: only barycentres have weights")
        ends = self._ends(index, cells, kind)
        return Measure(
            kind,
            *ends[:2],
            value,
            sigma,
            is_active,
            relative,
            table.number(index, cells, "from_height", 0.0),
            table.number(index, cells, "to_height", 0.0),
            self._station(index, cells, kind, ends[0]),
            self._instrument(index, cells),
            backsight=ends[2],
        )

    def _barycentre(self, index: int, cells: dict[str, str], measure: Measure) -> Measure:
        """The condition of a barycentre: its members stand in `to`, with blanks between them."""
        names = [cells["from"], *cells["to"].split()]
        if len(names) < 3 or len(set(names)) < len(names) or not cells["from"]:
            raise self._table.file.error(
                index,
                f"{measure.kind.words}: from is a point, to two or more others with blanks between them",
            )
        centre, *members = (self._columns.point(self._table.file, index, name) for name in names)
        weights = self._table.numbers(index, cells, "weights") or [1.0] * len(members)
        if len(weights) != len(members) or not sum(weights) > LEAST_SUM:
            raise self._table.file.error(
                index,
                f"{measure.kind.words}: {len(weights)} weights of sum {sum(weights):g} for "
                f"{len(members)} points; give one for each, with blanks between them and a positive sum",
            )
        group = self._columns.open_barycentre(tuple(members), tuple(weights))
        return measure._replace(origin=centre, target=members[0], group=group)

    def _kinds(self, index: int, cells: dict[str, str]) -> tuple[ObservationKind, ...]:
        name = cells["type"].lower()
        if name == ALL_OF_BARYCENTRE and cells.get("cluster"):
            raise self._table.file.error(
                index, "a barycentre in a cluster: write rows BaryX, BaryY and BaryZ"
            )
        return BARYCENTRES if name == ALL_OF_BARYCENTRE else (self._kind(index, cells),)

    def _kind(self, index: int, cells: dict[str, str]) -> ObservationKind:
        kind = TYPES.get(cells["type"].lower())
        if kind is None:
            listed = ", ".join([*(found.name for found in TYPES.values()), ALL_OF_BARYCENTRE.capitalize()])
            raise self._table.file.error(
                index, f"type {quoted(cells['type'])!r} is unknown; there are {listed}"
            )
        return kind

    def _ends(self, index: int, cells: dict[str, str], kind: ObservationKind) -> tuple[int, int, int]:
        names = [cells["from"], cells["to"] or (cells["from"] if kind.is_absolute else "")]
        if kind is ANGLE:
            names.append(cells.get("backsight", ""))
        if not all(names) or (len(set(names)) < len(names) and not kind.is_absolute):
            raise self._table.file.error(index, f"{kind.words}: it needs {len(names)} different points")
        rows = [self._columns.point(self._table.file, index, name) for name in names]
        return rows[0], rows[1], rows[2] if len(rows) > 2 else -1

    def _instrument(self, index: int, cells: dict[str, str]) -> int:
        name = cells.get("instrument", "")
        self._table.file.check_name(index, name)
        return self._columns.instrument(name)

    def _station(self, index: int, cells: dict[str, str], kind: ObservationKind, origin: int) -> int:
        """Rows of one point and one set are of one set-up; azimuths have their own."""
        if not kind.needs_station:
            return -1
        orientation = self._orientation(index, cells, kind)
        key = (origin, cells.get("set", ""), orientation, kind is AZIM)
        if key not in self._stations:
            self._stations[key] = self._columns.open_station(origin, orientation)
        return self._stations[key]

    def _orientation(self, index: int, cells: dict[str, str], kind: ObservationKind) -> Orientation:
        word = cells.get("orientation", "").removeprefix("#").upper()
        if not word:
            return Orientation.FIX if kind is AZIM else Orientation.VERT
        if word not in Orientation.__members__:
            known = ", ".join(Orientation.__members__)
            raise self._table.file.error(index, f"orientation {quoted(word)!r} is none of {known}")
        return Orientation[word]


class _Formulas:
    """Reads a table of observations of formulas: a column for each point and each number that these name."""

    def __init__(self, table: Table, columns: Columns, clusters: Clusters) -> None:
        table.check(OF_FORMULAS, tuple(table.columns))
        self._table, self._columns, self._clusters = table, columns, clusters
        self._number = columns.open_file(table.file)

    def read(self) -> None:
        """Adds all rows."""
        for index, cells in self._table.rows():
            kind = self._kind(index, cells)
            self._check(index, cells, kind)
            measure = self._measure(index, cells, kind)
            self._table.correlate(index, cells, self._clusters, len(self._columns), measure)
            self._columns.append(measure, self._number, index)

    def _kind(self, index: int, cells: dict[str, str]) -> FormulaKind:
        try:
            return kind_of_formula(cells["formula"])
        except ObseqError as error:
            raise self._table.file.error(index, printable(str(error))) from error

    def _check(self, index: int, cells: dict[str, str], kind: FormulaKind) -> None:
        """Refuses cells that the formula does not take, and those that it lacks."""
        taken = [name.lower() for name in (*kind.roles, *kind.numbers)]
        if len({*OWN_OF_FORMULAS, *taken}) < len(OWN_OF_FORMULAS) + len(taken):
            raise self._table.file.error(
                index,
                f"{kind.name}: its names {', '.join(taken)} repeat each other, or columns of all formulas "
                f"({', '.join(OWN_OF_FORMULAS)}); rename them in the formula",
            )
        lacking = [name for name in taken if not cells.get(name)]
        surplus = [name for name in cells if cells[name] and name not in (*OWN_OF_FORMULAS, *taken)]
        if lacking or surplus:
            what = f"column {lacking[0]} is missing or empty" if lacking else f"{surplus[0]} is none of them"
            raise self._table.file.error(
                index,
                f"{kind.name} takes the points {', '.join(kind.roles)} and the numbers "
                f"{', '.join(kind.numbers) or '(none)'}; {quoted(what)}",
            )

    def _measure(self, index: int, cells: dict[str, str], kind: FormulaKind) -> Measure:
        table = self._table
        unit = table.unit(index, cells, kind)
        numbers = [table.number(index, cells, name.lower()) for name in kind.numbers]
        value, sigma = (numbers[-1] * unit if numbers else 0.0), table.number(index, cells, "sigma") * unit
        is_active = table.is_active(index, cells)
        if is_active:
            table.check_measure(index, kind, value, sigma)
        group = self._columns.open_group(kind.name, numbers=tuple(numbers[:-1])) if numbers[1:] else -1
        origin, target, third = self._points(index, cells, kind)
        return Measure(kind, origin, target, value, sigma, is_active, group=group, backsight=third)

    def _points(self, index: int, cells: dict[str, str], kind: FormulaKind) -> tuple[int, int, int]:
        names = [cells[role.lower()] for role in kind.roles]
        if len(set(names)) < len(names):
            raise self._table.file.error(index, f"{kind.name}: it needs {len(names)} different points")
        rows = [self._columns.point(self._table.file, index, name) for name in names]
        return rows[0], rows[min(1, len(rows) - 1)], rows[2] if len(rows) > 2 else -1
