"""A result as columns: one file of arrays that `numpy.load` opens, written column by column.

`NAME.npz` is a zip archive. `record.json` is the result file (`obseq.report.result_file`), but that each long
list says of which columns it is; these are members of their own, `LIST.FIELD.npy`. Codes of texts lead into
a list of texts, `texts.NUMBER.json`. What a column holds: `obseq.records.columns`.
"""

from __future__ import annotations

import hashlib
import zipfile
import zlib
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, TypeVar

from msgspec import structs

from obseq.errors import InputError
from obseq.reading.json_text import parsed_json
from obseq.records.columns import Lazy, Texts
from obseq.records.record import Record, encoded
from obseq.records.rows import Rows, Stored
from obseq.writing import write_all

if TYPE_CHECKING:
    from collections.abc import Mapping
    from zipfile import ZipFile

    from obseq.arrays import Array
    from obseq.records.columns import Column

Row = TypeVar("Row", bound=Record)
RECORD = "record.json"
LAYOUT = 1
"""Version of what this module writes; another one is refused."""
LEVEL = 1
"""Of compression: numbers of measurements hardly get smaller by the others, which take five times as long."""
EPOCH = (1980, 1, 1, 0, 0, 0)
"""Date of all members: equal results are equal files."""
SUFFIX = ".npz"
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


def write_lists(path: str | Path, lists: Mapping[str, Rows[Any]]) -> None:
    """Writes parts of a result, such as those of a leaf, as one file.

    Raises:
        InputError: The file cannot be written.
    """

    def write(file: IO[bytes]) -> None:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=LEVEL) as archive:
            writer = _Writer(archive)
            writer.record({name: writer.lists(name, rows) for name, rows in lists.items()})

    write_all({Path(path): write})


def read_lists(path: str | Path, kinds: Mapping[str, type[Any]]) -> dict[str, Rows[Any]]:
    """The lists that `write_lists` wrote, each column read when it is asked for.

    Args:
        path: Of the file.
        kinds: The class of the records of each list.

    Raises:
        InputError: The file cannot be read, is damaged, or lacks a list.
    """
    plain = read_columns(path)
    if missing := [name for name in kinds if name not in plain]:
        raise InputError(f"{path}: the list {missing[0]} is missing")
    return {name: Rows.from_plain(plain[name], kind) for name, kind in kinds.items()}


def is_columns(path: Path) -> bool:
    """Whether a file begins as one of columns does."""
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def read_columns(path: str | Path) -> dict[str, Any]:
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
    return {name: archive.stored(name, value) if _is_list(value) else value for name, value in plain.items()}


def _is_list(value: object) -> bool:
    return isinstance(value, dict) and value.keys() == {"rows", "columns", "texts"}


class _Writer:
    """Writes lists into an archive, and each table of texts once."""

    def __init__(self, archive: ZipFile) -> None:
        self._archive = archive
        self._tables: dict[bytes, str] = {}

    def lists(self, name: str, rows: Rows[Any]) -> str:
        """Writes the columns of a list; what the record says of it."""
        texts = {}
        for column in rows.columns:
            found = rows.columns[column]
            if isinstance(found, Texts):
                texts[column] = self._table(list(found.names))
                found = found.codes
            with self._open(f"{name}.{column}.npy") as file:
                _write_array(file, found)
        return encoded({"rows": len(rows), "columns": list(rows.columns), "texts": texts})

    def record(self, parts: Mapping[str, str]) -> None:
        """Writes what is no column."""
        lines = ",\n".join(f'"{name}": {text}' for name, text in {**parts, "layout": str(LAYOUT)}.items())
        with self._open(RECORD) as file:
            file.write(f"{{\n{lines}\n}}\n".encode())

    def _table(self, names: list[str]) -> str:
        """The member that holds some texts."""
        content = encoded(names).encode()
        digest = hashlib.sha256(content).digest()
        if digest not in self._tables:
            self._tables[digest] = f"texts.{len(self._tables)}.json"
            with self._open(self._tables[digest]) as file:
                file.write(content)
        return self._tables[digest]

    def _open(self, name: str) -> IO[bytes]:
        member = zipfile.ZipInfo(name, EPOCH)
        member.compress_type, member._compresslevel = zipfile.ZIP_DEFLATED, LEVEL  # type: ignore[attr-defined]
        return self._archive.open(member, "w", force_zip64=True)


def _write_array(file: IO[bytes], values: Any) -> None:
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

    def stored(self, name: str, said: Mapping[str, Any]) -> Stored:
        """What the record says to be columns."""
        for key in said["columns"]:
            self._there(f"{name}.{key}.npy")
        texts, size = said["texts"], said["rows"]
        kept: dict[str, Column] = {}

        def column(key: str) -> Column:
            if key not in kept:
                kept[key] = self._column(f"{name}.{key}.npy", size, texts.get(key))
            return kept[key]

        return Stored(Lazy(said["columns"], column), size, str(self.path))

    def plain(self, member: str) -> Any:
        """What a member of JSON says."""
        return self._read(member, lambda file: parsed_json(file.read()))

    def _column(self, member: str, size: int, table: str | None) -> Column:
        values: Array = self._read(member, _array)
        if len(values) != size:
            raise self._damaged(f"{member} has {len(values)} rows, not {size}")
        if table is None:
            return values
        if table not in self._tables:
            self._tables[table] = self.plain(table)
        names = self._tables[table]
        if values.dtype.kind != "i" or not (
            values.min(initial=0) >= -1 and values.max(initial=-1) < len(names)
        ):
            raise self._damaged(f"{member} leads to texts that are not in {table}")
        return Texts(values, names)

    def _there(self, member: str) -> None:
        if member not in self._members:
            raise self._damaged(f"{member} is missing")

    def _read(self, member: str, how: Any) -> Any:
        self._there(member)
        try:
            with self._archive.open(member) as file:
                return how(file)
        except (zipfile.BadZipFile, zlib.error, ValueError, EOFError, OSError, RecursionError) as error:
            raise self._damaged(f"{member}: {error}") from error

    def _damaged(self, why: object) -> InputError:
        return InputError(f"{self.path}: the result is damaged: {why}; copy it again, or adjust again")


def _array(file: IO[bytes]) -> Any:
    import numpy as np

    return np.lib.format.read_array(file, allow_pickle=False)
