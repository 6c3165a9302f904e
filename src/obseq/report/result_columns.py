"""A result as columns: one file of arrays that `numpy.load` opens, written column by column.

`NAME.npz` is a zip archive. `record.json` is the result file (`obseq.report.result_file`), but that each long
list says of which columns it is; these are members of their own, `LIST.FIELD.npy`. Codes of texts lead into
a list of texts, `texts.NUMBER.json`. What a column holds: `obseq.records.columns`.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from hashlib import sha256
from pathlib import Path
from typing import IO, TYPE_CHECKING, TypeVar

import msgspec
from msgspec import structs

from obseq.errors import InputError
from obseq.reading.json_text import parsed_json
from obseq.reading.text import start_of
from obseq.records.columns import Lazy, Texts
from obseq.records.record import Record, encoded
from obseq.records.rows import AnyRows, Rows, Stored

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from zipfile import ZipFile

    from obseq.arrays import Array
    from obseq.records.columns import Column

Found = TypeVar("Found")
RECORD = "record.json"
LAYOUT = 1
"""Version of what this module writes; another one is refused."""
LEVEL = 1
"""Of compression: numbers of measurements hardly get smaller by the others, which take five times as long."""
MAGIC = b"PK\x03\x04"


def write_columns(file: IO[bytes], record: Record) -> None:
    """Writes a result; memory is that of a column.

    Args:
        file: Open for writing.
        record: Of an adjustment or of a block.
    """
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=LEVEL) as archive:
        writer = _Writer(archive)
        values = {field.name: getattr(record, field.name) for field in structs.fields(record)}
        lists = {name: writer.lists(name, value) for name, value in values.items() if isinstance(value, Rows)}
        writer.record({name: lists.get(name) or encoded(value) for name, value in values.items()})


def is_columns(path: Path) -> bool:
    """Whether a file begins as one of columns does.

    Raises:
        InputError: It cannot be read, or is no file.
    """
    return start_of(path, len(MAGIC)) == MAGIC


def read_columns(path: str | Path) -> dict[str, object]:
    """The plain form of a result, in which long lists are columns that are read when they are asked for.

    Raises:
        InputError: The file cannot be read, is damaged, or is of another layout.
    """
    archive = _Archive(Path(path))
    plain = archive.plain(RECORD)
    layout = plain.pop("layout", None) if isinstance(plain, dict) else None
    if not isinstance(plain, dict) or layout != LAYOUT:
        raise InputError(
            f"{path}: its layout is {layout}, and this version of obseq reads {LAYOUT}: "
            "adjust again, or use the version that wrote it"
        )
    return {name: archive.stored(name, _told(value)) or value for name, value in plain.items()}


class Told(msgspec.Struct):
    """What the record says of a list.

    Attributes:
        rows: How many records it has.
        columns: The names of its columns.
        texts: The tables of those that are texts.
    """

    rows: int
    columns: list[str]
    texts: dict[str, str]


def _told(value: object) -> Told | None:
    """What is said of a list; None where a value is none of columns."""
    is_list = isinstance(value, dict) and value.keys() == set(Told.__struct_fields__)
    return msgspec.convert(value, Told) if is_list else None


class _Writer:
    """Writes lists into an archive, and each table of texts once."""

    def __init__(self, archive: ZipFile) -> None:
        self._archive = archive
        self._tables: dict[bytes, str] = {}

    def lists(self, name: str, rows: AnyRows) -> str:
        """Writes the columns of a list; what the record says of it."""
        texts = {}
        for column in rows.columns:
            found = rows.columns[column]
            if isinstance(found, Texts):
                texts[column] = self._table(list(found.names))
                found = found.codes
            with self._open(f"{name}.{column}.npy") as file:
                _write_array(file, found)
        return encoded(Told(len(rows), list(rows.columns), texts))

    def record(self, parts: Mapping[str, str]) -> None:
        """Writes what is no column."""
        lines = ",\n".join(f'"{name}": {text}' for name, text in {**parts, "layout": str(LAYOUT)}.items())
        with self._open(RECORD) as file:
            file.write(f"{{\n{lines}\n}}\n".encode())

    def _table(self, names: list[str]) -> str:
        """The member that holds some texts."""
        content = encoded(names).encode()
        digest = sha256(content).digest()
        if digest not in self._tables:
            self._tables[digest] = f"texts.{len(self._tables)}.json"
            with self._open(self._tables[digest]) as file:
                file.write(content)
        return self._tables[digest]

    def _open(self, name: str) -> IO[bytes]:
        return self._archive.open(name, "w", force_zip64=True)


def _write_array(file: IO[bytes], values: Array) -> None:
    """An array as `.npy`: truths as bytes, integers as small as they may be by their kind."""
    import numpy as np

    values = np.ascontiguousarray(values.astype(np.int8) if values.dtype == bool else values)
    np.lib.format.write_array(file, values, allow_pickle=False)


class _Archive:
    """An archive that is read.

    Attributes:
        path: Of the file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._archive = zipfile.ZipFile(path)
        except OSError as error:
            raise InputError(f"{path}: it cannot be read ({error.strerror})") from error
        except zipfile.BadZipFile as error:
            raise self._damaged(error) from error
        self._members = frozenset(self._archive.namelist())
        self._tables: dict[str, list[str]] = {}

    def stored(self, name: str, told: Told | None) -> Stored | None:
        """A list that is columns."""
        if told is None:
            return None
        for key in told.columns:
            self._there(f"{name}.{key}.npy")
        texts, size = told.texts, told.rows
        kept: dict[str, Column] = {}

        def column(key: str) -> Column:
            if key not in kept:
                kept[key] = self._column(f"{name}.{key}.npy", size, texts.get(key))
            return kept[key]

        return Stored(Lazy(told.columns, column), size, str(self.path))

    def plain(self, member: str) -> object:
        """What a member of JSON says."""
        return self._read(member, lambda file: parsed_json(file.read()))

    def _column(self, member: str, size: int, table: str | None) -> Column:
        values = self._read(member, _array)
        if len(values) != size:
            raise self._damaged(f"{member} has {len(values)} rows, not {size}")
        if table is None:
            return values
        if table not in self._tables:
            self._tables[table] = self._read(table, _texts)
        names = self._tables[table]
        if values.dtype.kind != "i" or not (
            values.min(initial=0) >= -1 and values.max(initial=-1) < len(names)
        ):
            raise self._damaged(f"{member} leads to texts that are not in {table}")
        return Texts(values, names)

    def _there(self, member: str) -> None:
        if member not in self._members:
            raise self._damaged(f"{member} is missing")

    def _read(self, member: str, how: Callable[[IO[bytes]], Found]) -> Found:
        self._there(member)
        try:
            with self._archive.open(member) as file:
                return how(file)
        except (zipfile.BadZipFile, zlib.error, ValueError, EOFError, OSError, RecursionError) as error:
            raise self._damaged(f"{member}: {error}") from error

    def _damaged(self, why: object) -> InputError:
        return InputError(f"{self.path}: the result is damaged: {why}; copy it again, or adjust again")


def _texts(file: IO[bytes]) -> list[str]:
    return [str(text) for text in json.loads(file.read())]


def _array(file: IO[bytes]) -> Array:
    import numpy as np

    return np.asarray(np.lib.format.read_array(file, allow_pickle=False))
