"""Tables in text files: a line of column names, then one row a line; separated by commas, or blanks."""

from __future__ import annotations

import csv
import logging
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError, RowError
from obseq.reading.origin import Origin
from obseq.reading.text import counted, invisible, quoted, read_bytes
from obseq.spreadsheets import csv_text, text_in

DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?")
"""A number as many countries write it, where commas do not separate cells."""
SEPARATORS = ",;\t"
REMARK = "#"
_TOLD = re.compile(r"sep=(.)", re.IGNORECASE)
"""First line of spreadsheets that says what separates cells."""
LOGGER = logging.getLogger(__name__)


def text_of(path: str | Path, other: str = "") -> str:
    """The text of a file in UTF-8, a byte-order mark left out.

    Args:
        path: the file.
        other: encoding of a file that is not in UTF-8; none by default.

    Raises:
        InputError: the file cannot be read, is too large, or is not text; it is named.
    """
    data = read_bytes(Path(path))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if not other:
            raise InputError(f"{path}: not a text in UTF-8 (byte {error.start}); convert it") from None
        text = data.decode(other, "replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def number_in(text: str, said: str) -> float:
    """A finite number; `said` begins the sentence when it is none.

    Raises:
        InputError: it is no number, or not finite.
    """
    try:
        value = float(text) if text.isascii() and "_" not in text else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        hint = "; decimals are written with a point" if DECIMAL_COMMA.fullmatch(text) else ""
        raise InputError(f"{said} {text[:40]!r}, which is no finite number{hint}")
    return value


class Rows:
    """Rows of cells under a line of names, as files of text have them.

    Cells are separated by what the first line says (`sep=;`), or by what it has most of: commas, semicolons,
    tabs; by blanks where it has none. Empty rows are left out, as are empty cells beyond the last column.

    Attributes:
        head: Line (from 0) of the names.
        separator: Of cells; empty for blanks.
        names: Of the columns, in small letters.
        remarks: Lines (from 0) that begin with #, where these are remarks.
    """

    def __init__(
        self, lines: Sequence[str], error: Callable[[int, str], InputError], *, has_remarks: bool = False
    ) -> None:
        """Reads the names.

        Args:
            lines: Of the file; one holds something.
            error: What is raised about a line (from 0), with its problem.
            has_remarks: Whether lines that begin with # are remarks.

        Raises:
            InputError: Two columns have the same name, or nothing is in the file.
        """
        self._lines, self._error, self._has_remarks = lines, error, has_remarks
        self.remarks = [k for k, line in enumerate(lines) if has_remarks and line.lstrip().startswith(REMARK)]
        hidden = set(self.remarks)
        held = (k for k, line in enumerate(lines) if line.strip() and k not in hidden)
        self.head = next(held, -1)
        if self.head < 0:
            raise error(0, "the file has no line of column names")
        told = _TOLD.fullmatch(lines[self.head].strip())
        if told:
            self.head = next(held, self.head)
        line = lines[self.head]
        most = max(SEPARATORS, key=line.count)
        self.separator = told[1] if told else most if line.count(most) else ""
        names = [name.lower() for name in self._split(self.head)]
        self._width = len(names)
        while names and not names[-1]:  # as spreadsheets write columns that were emptied
            names.pop()
        self.names = tuple(names)
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise error(self.head, f"two columns have the name {quoted(twice)} (capitals make no difference)")

    def __iter__(self) -> Iterator[tuple[int, list[str]]]:
        """Line (from 0) and cells of each row, as many as there are columns.

        Raises:
            InputError: There are more or fewer.
        """
        blank, hidden, count = f"{self.separator} \t", set(self.remarks), len(self.names)
        for index in range(self.head + 1, len(self._lines)):
            if index in hidden or not self._lines[index].strip(blank):
                continue
            cells = self._split(index)
            if unseen := invisible("".join(cells)):
                raise self._error(index, f"a cell holds {unseen!a}, which nobody sees; type it again")
            if len(cells) != count and not self._is_padded(cells):
                raise self._error(index, self._miscounted(cells, index))
            yield index, cells[:count]

    def rows_in_remarks(self) -> list[int]:
        """Lines (from 0) that begin with # and have as many cells as a row."""
        below = (k for k in self.remarks if k > self.head and self.separator in self._lines[k])
        return [k for k in below if len(self._split(k)) == len(self.names)]

    def _split(self, index: int) -> list[str]:
        line = self._lines[index]
        if not self.separator or (self._has_remarks and self.separator not in line and len(line.split()) > 1):
            return line.split()
        try:
            cells = next(csv.reader([line], delimiter=self.separator, skipinitialspace=self._has_remarks))
        except csv.Error as error:
            raise self._error(index, f"this is no row of a table: {error}") from error
        return [text_in(cell.strip()) for cell in cells]

    def _is_padded(self, cells: list[str]) -> bool:
        """Whether all that a row has too much are empty cells at its end, as spreadsheets write them."""
        is_surplus_empty = len(cells) > len(self.names) and not any(cells[len(self.names) :])
        return is_surplus_empty and (len(cells) == self._width or not self._has_decimal_commas(cells))

    def _has_decimal_commas(self, cells: list[str]) -> bool:
        """Whether a comma between cells may be one within a number."""
        parts = pairwise(cell.lstrip("+-") for cell in cells)
        return self.separator == "," and any(a.isdigit() and b.isdigit() for a, b in parts)

    def _miscounted(self, cells: list[str], index: int) -> str:
        """What is said of a row of too few or too many cells."""
        is_likely = len(cells) > len(self.names) and self._has_decimal_commas(cells)
        hint = "; the comma separates cells: write decimals with a point" if is_likely else ""
        if self._lines[index].count('"') % 2:
            hint = "; a quote is open at the end of the line: a row, and a name, stand on one line"
        return f"{len(cells)} cells for {len(self.names)} columns{hint}"


@dataclass(frozen=True)
class Table:
    """Rows of text fields under column names.

    Attributes:
        path: of the file, for messages.
        columns: names, in lower case.
        rows: fields of each row.
        lines: (n,) line of each row in the file, from 1.
    """

    path: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]

    @classmethod
    def read(cls, path: str | Path) -> Table:
        """Reads a file; empty lines and remarks (#) are left out, remarks that look like rows told.

        Raises:
            InputError: a row has more or fewer cells than there are columns, or a column comes twice.
        """

        def error(index: int, problem: str) -> InputError:
            return InputError(f"{path}:{index + 1}: {problem}")

        rows = Rows(counted(path, text_of(path).splitlines() or [""]), error, has_remarks=True)
        body = list(rows)
        if lost := rows.rows_in_remarks():
            LOGGER.warning(
                "%s: %d rows that begin with # are left out as remarks: line %d is the first",
                path,
                len(lost),
                lost[0] + 1,
            )
        lines = tuple(index + 1 for index, _ in body)
        return cls(str(path), rows.names, tuple(tuple(cells) for _, cells in body), lines)

    def __len__(self) -> int:
        return len(self.rows)

    def __contains__(self, column: str) -> bool:
        return column in self.columns

    def require(self, *columns: str) -> None:
        """Refuses a table that lacks columns."""
        missing = [column for column in columns if column not in self.columns]
        if missing:
            raise InputError(
                f"{self.path}: column {missing[0]!r} is missing; "
                f"the first line names {', '.join(self.columns)}"
            )

    def allow(self, columns: Sequence[str]) -> None:
        """Refuses a table that has others."""
        other = [column for column in self.columns if column not in columns]
        if other:
            raise InputError(
                f"{self.path}: column {other[0]!r} means nothing here; known: {', '.join(columns)}"
            )

    def texts(self, column: str) -> list[str]:
        """Fields of a column."""
        place = self.columns.index(column)
        return [row[place] for row in self.rows]

    def numbers(self, column: str, default: float | None = None) -> FloatArray:
        """(n,) numbers of a column; where a field is empty, the default.

        Raises:
            InputError: a field is no finite number, or empty without default; file and line are named.
        """
        if column not in self.columns and default is not None:
            return np.full(len(self), default)
        fields = self.texts(column)
        values = np.empty(len(fields))
        for row, field in enumerate(fields):
            values[row] = self._number(row, column, field, default)
        return values

    def _number(self, row: int, column: str, field: str, default: float | None) -> float:
        if not field and default is not None:
            return default
        return number_in(field, f"{self.place(row)}: {column} is")

    @contextmanager
    def located(self, rows: Sequence[int] | None = None) -> Iterator[None]:
        """Makes errors inside name the file, and the line of the row that they are about.

        Args:
            rows: which rows of the table were taken; all of them when None.
        """
        try:
            yield
        except RowError as error:
            row = error.row if rows is None else rows[error.row]
            raise InputError(f"{self.place(row)}: {error}") from None
        except InputError as error:
            raise InputError(f"{self.path}: {error}") from None

    @property
    def origin(self) -> Origin:
        """The file, and the line of each row."""
        return Origin(self.path, self.lines)

    def place(self, row: int) -> str:
        """`file:line` of a row."""
        return self.origin.place(row)


def table_text(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table as text: commas, names in quotes where they need them, numbers at full precision."""
    lines = ([f"{value:.17g}" if isinstance(value, float) else value for value in row] for row in rows)
    return csv_text([columns, *lines])
