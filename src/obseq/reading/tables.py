"""Tables in text files: a line of column names, then one row a line; separated by commas, or blanks."""

from __future__ import annotations

import csv
import math
import re
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError, RowError
from obseq.reading.origin import Origin
from obseq.reading.text import read_bytes
from obseq.spreadsheets import csv_text, text_in

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from obseq.arrays import FloatArray

DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+")
SEPARATORS = ";\t,"


def text_of(path: str | Path) -> str:
    """The text of a file in UTF-8, a byte-order mark left out.

    Raises:
        InputError: the file cannot be read, is too large, or is not text; it is named.
    """
    data = read_bytes(Path(path))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text in UTF-8 (byte {error.start}); convert it") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def number_in(text: str, said: str) -> float:
    """A finite number; `said` begins the sentence when it is none.

    Raises:
        InputError: it is no number, or not finite.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        hint = "; decimals are written with a point" if DECIMAL_COMMA.fullmatch(text) else ""
        raise InputError(f"{said} {text[:40]!r}, which is no finite number{hint}")
    return value


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
        """Reads a file; empty lines, and lines that begin with #, are left out.

        Raises:
            InputError: a row has more or fewer fields than there are columns, or a column comes twice.
        """
        kept = [
            (number, line)
            for number, line in enumerate(text_of(path).splitlines(), 1)
            if line.strip() and not line.lstrip().startswith("#")
        ]
        if not kept:
            raise InputError(f"{path}: the file has no line of column names")
        separator = _separator(kept[0][1])
        numbered = [(number, _fields(line, separator)) for number, line in kept]
        columns = tuple(field.lower() for field in numbered[0][1])
        if len(set(columns)) < len(columns):
            raise InputError(f"{path}:{numbered[0][0]}: a column name comes twice: {', '.join(columns)}")
        for number, fields in numbered[1:]:
            if len(fields) != len(columns):
                raise InputError(
                    f"{path}:{number}: {len(fields)} fields for {len(columns)} columns ({', '.join(columns)})"
                )
        body = numbered[1:]
        return cls(str(path), columns, tuple(row for _, row in body), tuple(number for number, _ in body))

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


def _separator(line: str) -> str:
    """What separates the fields of a line, the most frequent first; nothing for blanks."""
    return max(SEPARATORS, key=line.count) if any(character in line for character in SEPARATORS) else ""


def _fields(line: str, usual: str) -> tuple[str, ...]:
    """The fields of a line; what separates the column names does so here, where it is found."""
    separator = usual if usual and usual in line else _separator(line)
    if not separator:
        return tuple(line.split())
    row = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    return tuple(text_in(field.strip()) for field in row)


def table_text(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table as text: commas, names in quotes where they need them, numbers at full precision."""
    lines = ([f"{value:.17g}" if isinstance(value, float) else value for value in row] for row in rows)
    return csv_text([columns, *lines])
