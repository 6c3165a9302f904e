"""Tables as text and as CSV, in the units of a report: the cells are those of the page, to the digit."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace

from obseq.dataclass import dataclass
from obseq.report.said import plain
from obseq.report.tables.columns import TEXTS, Column, Table
from obseq.report.tables.units import ABSENT, MIXED, Scale, Units
from obseq.spreadsheets import csv_text

WIDTH = 120
"""Columns of a listing; only names of many letters make a table wider."""
LONGEST = 16
"""Letters of a name of a file where lines are short."""


@dataclass(frozen=True)
class Printed:
    """A column as text: its title, the unit below that, its cells."""

    title: str
    unit: str
    cells: list[str]
    is_text: bool = False

    @property
    def width(self) -> int:
        """Letters of the longest."""
        return max(len(self.title), len(self.unit), max(map(len, self.cells), default=0))


@dataclass(frozen=True)
class Writer:
    """Writes tables.

    Attributes:
        names: Of points, by the numbers that tables hold.
        units: Of lengths and angles.
    """

    names: Sequence[str]
    units: Units

    def scale(self, column: Column) -> Scale:
        """How the numbers of a column are shown that holds one quantity."""
        scale = self.units.scale(column["quantity"])
        if "unit" in column:
            scale = replace(scale, name=column["unit"], factor=1.0)
        return replace(scale, decimals=column.get("decimals", scale.decimals))

    def cells(self, table: Table, column: Column, *, with_units: bool = True) -> list[str]:
        """The cells of a column; those of different units have their unit behind them."""
        quantity, values = column["quantity"], column["values"]
        if quantity in TEXTS:
            texts = self.names if quantity == "point" else column.get("choices")
            return [ABSENT if value is None else texts[value] if texts else value for value in values]
        if quantity not in MIXED:
            return self.scale(column).numbers(values)
        return self._mixed(table, column, with_units=with_units)

    def _mixed(self, table: Table, column: Column, *, with_units: bool) -> list[str]:
        """The cells of a column of lengths and angles."""
        values, cells = column["values"], [ABSENT] * len(column["values"])
        for is_angular in (False, True):
            scale = self.units.scale(column["quantity"], is_angular=is_angular)
            rows = [row for row, angular in enumerate(table["angular"]) if angular == is_angular]
            end = f" {scale.name}" if with_units else ""
            for row, text in zip(rows, scale.numbers([values[row] for row in rows]), strict=True):
                cells[row] = text if text == ABSENT else text + end
        return cells

    def _units(self, table: Table, column: Column) -> list[str]:
        """The unit of each cell of a column of lengths and angles."""
        return [
            self.units.scale(column["quantity"], is_angular=bool(angular)).name
            for angular in table["angular"]
        ]

    def unit(self, column: Column) -> str:
        """The unit that the title of a column has: none where each cell has its own."""
        quantity = column["quantity"]
        return "" if quantity in TEXTS or quantity in MIXED else self.scale(column).name

    def csv(self, table: Table) -> str:
        """The table as CSV: every column, units beside the titles, or in a column where rows differ."""
        columns: list[list[str]] = []
        told = set()
        for column in table["columns"]:
            unit, quantity = self.unit(column), column["quantity"]
            title = f"{column['title']} ({unit})" if unit else column["title"]
            cells = self.cells(table, column, with_units=False)
            columns.append([title, *("" if cell == ABSENT else cell for cell in cells)])
            if quantity in MIXED and quantity not in told:
                columns.append([f"unit of {column['title']}", *self._units(table, column)])
                told.add(quantity)
        return csv_text(list(zip(*columns, strict=True)))

    def lines(
        self, table: Table, rows: Sequence[int] | None = None, keys: Collection[str] = (), title: str = ""
    ) -> Iterator[str]:
        """The table as lines of text, in parts of which each has the names again where it is wide.

        Args:
            table: What to write.
            rows: Of it, in this order; None: all, in the order of the page.
            keys: Of the columns to write; all without any.
            title: In place of its own.
        """
        about = plain(table.get("about", ""), self.units)
        told = title or ". ".join(filter(None, (table["title"], about)))
        yield from textwrap.wrap(told, WIDTH, break_long_words=False)
        for k, part in enumerate(_parts(list(self.printed(table, rows, keys)))):
            yield from ("",) * (k > 0)
            yield from _block(part)

    def printed(
        self, table: Table, rows: Sequence[int] | None = None, keys: Collection[str] = ()
    ) -> Iterator[Printed]:
        """Columns as text; a number that is joined stands behind the text before it."""
        rows, before = ordered(table) if rows is None else rows, None
        for column in table["columns"]:
            if keys and column["key"] not in keys:
                continue
            found = self.cells(table, column)
            cells = [found[row] for row in rows]
            if column.get("joined") and before is not None:
                names = _brief(before.cells)
                pairs = zip(before.cells, cells, strict=True)
                cells = [name if name == ABSENT else f"{names[name]}:{text}" for name, text in pairs]
                before = replace(before, cells=cells)
                continue
            if before is not None:
                yield before
            before = Printed(column["title"], self.unit(column), cells, column["quantity"] in TEXTS)
        if before is not None:
            yield before


def ordered(table: Table) -> list[int]:
    """The rows, the worst first as the page opens the table; observations and points as they were read."""
    column = next((item for item in table["columns"] if item["key"] == table.get("order")), None)
    values = table["columns"][0]["values"]
    if column is None or table.get("rows"):
        return list(range(len(values)))
    return worst(table, column["key"])


def worst(table: Table, key: str) -> list[int]:
    """The rows, those of the largest values of a column first, those without any and unused ones last."""
    values = next((item["values"] for item in table["columns"] if item["key"] == key), ())
    unused = table.get("unused") or [0] * len(values)
    sizes = [
        -1.0 if value is None or gone else abs(value) for value, gone in zip(values, unused, strict=True)
    ]
    return sorted(range(len(values)), key=lambda row: -sizes[row])


def wrapped(lines: Iterable[str]) -> Iterator[str]:
    """The lines, those too long for a listing continued on the next, indented."""
    for line in lines:
        indent = " " * (len(line) - len(line.lstrip()) + 4)
        yield from textwrap.wrap(
            line, WIDTH, subsequent_indent=indent, break_long_words=False, drop_whitespace=True
        ) or [line]


def _parts(columns: list[Printed]) -> Iterator[list[Printed]]:
    """The columns in parts as wide as a line, each with the texts that name its rows."""
    n = next((k for k, column in enumerate(columns) if not column.is_text), len(columns))
    names, part = columns[:n], columns[:n]
    width = start = 2 + sum(column.width + 2 for column in names)
    for column in columns[n:]:
        if len(part) > n and width + column.width > WIDTH:
            yield part
            part, width = names, start
        part, width = [*part, column], width + column.width + 2
    yield part


def _block(columns: Sequence[Printed]) -> Iterator[str]:
    widths = [column.width for column in columns]
    heads: list[Sequence[str]] = [[column.title for column in columns]]
    if any(column.unit for column in columns):
        heads.append([column.unit for column in columns])
    aligned = zip(columns, widths, strict=True)
    line = "  " + "  ".join(f"%{'-' if column.is_text else ''}{width}s" for column, width in aligned)
    for cells in (*map(tuple, heads), *zip(*(column.cells for column in columns), strict=True)):
        yield (line % cells).rstrip()


def _brief(names: Iterable[str]) -> dict[str, str]:
    """Of long names their beginning and their end, where that tells them apart."""
    brief = {name: _elided(name) for name in set(names)}
    count = Counter(brief.values())
    return {name: short if count[short] == 1 else name for name, short in brief.items()}


def _elided(name: str) -> str:
    if len(name) <= LONGEST:
        return name
    end = (LONGEST - 3) // 2
    return f"{name[: LONGEST - 3 - end]}...{name[-end:]}"
