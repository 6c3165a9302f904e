"""One table with named columns (.csv): its rows, and what their cells hold."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from obseq.formats.columns import Measure
from obseq.formats.default_sigmas import ANGLES
from obseq.formats.tables.clusters import Clusters, Member
from obseq.reading.tables import DECIMAL_COMMA, Rows
from obseq.reading.text import LEAST_SIGMA, TextFile, quoted
from obseq.records.shown_units import METRES, ShownUnits
from obseq.survey.kinds.kind import ObservationKind

LENGTHS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3} | METRES
"""Units of lengths, as PROJ names them; `us-ft` is the foot of the United States' surveys."""
OFF = {"": True, "1": True, "yes": True, "true": True, "0": False, "no": False, "false": False}
DEGREES = frozenset({"deg", "sec", "arcsec"})
OF_POINTS, OF_OBSERVATIONS = ("name", "x", "y", "z"), ("type", "from", "to", "value", "sigma")
CORRELATING = ("covariances", "correlations")
CLUSTERED = ("cluster", *CORRELATING)
"""Columns of correlated rows: what they have in common, and the covariances with the rows before."""


def shown_in(names: frozenset[str]) -> ShownUnits:
    """Units of reports for those that tables name: feet, degrees where there are no others."""
    lengths, angles = names & set(LENGTHS), names & set(ANGLES)
    length = next(iter(lengths)) if len(lengths) == 1 else "m"
    degrees = bool(angles) and angles <= DEGREES
    return ShownUnits(length if length in METRES else "m", "degree" if degrees else "gon")


class RowsOfCells(Protocol):
    """Names of columns, and rows of cells under them, as `reading.tables.Rows` has them."""

    head: int
    separator: str
    names: tuple[str, ...]

    def __iter__(self) -> Iterator[tuple[int, list[str]]]:
        """Line (from 0) and cells of each row."""


class Table:
    """A table, row by row.

    Attributes:
        file: Its lines.
        columns: Position of each column, by name in small letters.
        units: Those that its rows name.
    """

    def __init__(self, file: TextFile, rows: RowsOfCells | None = None, angle: str = "gon") -> None:
        """A table of a file, or of rows that something else gives.

        Args:
            file: What messages name.
            rows: Those of a table in memory; None for the lines of the file.
            angle: Unit of angles where a row says none.
        """
        self.file, self.units = file, set[str]()
        self._rows = Rows(file.lines, file.error) if rows is None else rows
        self._units = {True: angle, False: "m"}
        self.columns = {name: place for place, name in enumerate(self._rows.names)}

    def check(self, wanted: tuple[str, ...], more: tuple[str, ...]) -> None:
        """Refuses columns that are missing or unknown."""
        missing = [name for name in wanted if name not in self.columns]
        unknown = [name for name in self.columns if name not in (*wanted, *more)]
        if missing:
            raise self.file.error(
                self._rows.head,
                f"column {missing[0]} is missing; points have the columns {' '.join(OF_POINTS)}, "
                f"observations {' '.join(OF_OBSERVATIONS)}",
            )
        if unknown:
            known = ", ".join((*wanted, *more))
            raise self.file.error(
                self._rows.head, f"column {quoted(unknown[0])} is unknown; there are {known}"
            )

    def check_rows(self) -> None:
        """Refuses a table of which there are only the names of columns."""
        if next(iter(self._rows), None) is None:
            raise self.file.error(
                self._rows.head, "the table holds no row below the names of its columns; add its rows"
            )

    def rows(self) -> Iterator[tuple[int, dict[str, str]]]:
        """Line (from 0) and cells by column of each row."""
        for index, cells in self._rows:
            yield index, dict(zip(self.columns, cells, strict=True))

    def number(self, index: int, cells: dict[str, str], column: str, default: float | None = None) -> float:
        """The number in a cell; the default when it is empty or the column is not there."""
        text = cells.get(column, "")
        if not text:
            if default is None:
                raise self.file.error(index, f"column {column} is empty")
            return default
        if self._rows.separator != "," and DECIMAL_COMMA.fullmatch(text):
            text = text.replace(",", ".")
        return self.file.number(index, text, f"column {column}: {{}}")

    def numbers(self, index: int, cells: dict[str, str], column: str) -> list[float]:
        """The numbers in a cell, with blanks between them."""
        return [self.number(index, {column: text}, column) for text in cells.get(column, "").split()]

    def unit(self, index: int, cells: dict[str, str], kind: ObservationKind) -> float:
        """What value and sigma of a row are multiplied by."""
        units = ANGLES if kind.is_angle else LENGTHS
        name = cells.get("unit", "") or self._units[kind.is_angle]
        self.units.add(name)
        if name not in units:
            raise self.file.error(
                index, f"unit {quoted(name)!r} is none of {', '.join(units)}, in which {kind.words} is"
            )
        return units[name]

    def length_unit(self, index: int, cells: dict[str, str]) -> float:
        """Metres in the unit of the coordinates and sigmas of a point."""
        name = cells.get("unit", "") or "m"
        self.units.add(name)
        if name not in LENGTHS:
            raise self.file.error(index, f"unit {quoted(name)!r} is none of {', '.join(LENGTHS)}")
        return LENGTHS[name]

    def is_active(self, index: int, cells: dict[str, str]) -> bool:
        """Whether a row is not switched off."""
        text = cells.get("active", "").lower()
        if text not in OFF:
            raise self.file.error(index, f"active is {quoted(text)!r}; 1 or 0 is needed")
        return OFF[text]

    def check_measure(
        self, index: int, kind: ObservationKind, value: float, sigma: float, relative: float = 0.0
    ) -> None:
        """Refuses a value that its kind cannot have, and a sigma that would be an infinite weight."""
        if not (sigma >= LEAST_SIGMA or (sigma == 0.0 and relative > 0.0)):
            raise self.file.error(index, "column sigma: it is not positive; the weight would be infinite")
        problem = kind.problem(value)
        if problem is not None:
            raise self.file.error(index, f"the {kind.words} {problem}; correct it, or active 0")

    def correlate(
        self, index: int, cells: dict[str, str], clusters: Clusters, row: int, measure: Measure
    ) -> None:
        """Adds a row of the field book to its cluster, if it is in one."""
        name, place = cells.get("cluster", ""), self.file.place(index)
        given = [column for column in CORRELATING if cells.get(column)]
        if len(given) > 1 or (given and not name):
            raise self.file.error(index, "a row has covariances or correlations, and the name of its cluster")
        if name and measure.relative:
            raise self.file.error(index, "a row of a cluster has no relative_sigma: give it its whole sigma")
        if name:
            member = Member(row, measure.sigma, self.unit(index, cells, measure.kind), place)
            numbers = self.numbers(index, cells, given[0]) if given else []
            clusters.add(name, member, numbers, given == ["correlations"])
