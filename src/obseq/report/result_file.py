"""The result file: the record of an adjustment as JSON, written and read back."""

from collections.abc import Iterator
from pathlib import Path
from typing import IO

from msgspec import structs

from obseq.arguments import PATH, expecting, instance
from obseq.errors import InputError
from obseq.printable import json_escaped
from obseq.reading.json_text import parsed_json
from obseq.reading.text import read_bytes
from obseq.records.adjustment import AdjustmentRecord
from obseq.records.record import Record, encoded
from obseq.records.rows import Rows
from obseq.report.result_columns import is_columns, read_columns


@expecting(record=instance(AdjustmentRecord))
def to_json(record: AdjustmentRecord) -> str:
    """The text of the result file: valid JSON, one point, station or observation per line, floats exact."""
    return text_of(record)


def text_of(record: Record) -> str:
    """The text of a file with this content: valid JSON, one item of a list per line, floats exact."""
    return "".join(lines_of(record))


def write_json(file: IO[bytes], record: Record) -> None:
    """Writes the same text, line by line."""
    for line in lines_of(record):
        file.write(line.encode())


def lines_of(record: Record) -> Iterator[str]:
    """The text in parts: an item of a list each."""
    yield "{\n"
    for k, name in enumerate(ordered_names(record)):
        yield from (",\n",) * (k > 0)
        yield f'"{name}": '
        value = getattr(record, name)
        if isinstance(value, Rows | tuple) and value and isinstance(value[0], Record):
            for row, item in enumerate(value):
                yield (",\n  " if row else "[\n  ") + json_escaped(encoded(item))
            yield "\n]"
        else:
            yield json_escaped(encoded(value))
    yield "\n}\n"


def ordered_names(record: Record) -> list[str]:
    """The names of what a file holds, what it is first."""
    names = [field.name for field in structs.fields(record)]
    return sorted(names, key=lambda name: name not in ("format", "version"))


@expecting(path=PATH)
def read_json(path: str | Path) -> AdjustmentRecord:
    """The record in a result file.

    Raises:
        InputError: The file cannot be read, or is not the result of an adjustment.
    """
    return AdjustmentRecord.from_dict(read_plain(path), str(path))


def read_plain(path: str | Path) -> object:
    """What stands in a file of results, whatever it is the result of.

    Raises:
        InputError: the file cannot be read, or is no JSON.
    """
    if is_columns(Path(path)):
        return read_columns(path)
    data = read_bytes(Path(path))
    try:
        plain = parsed_json(data)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: it is not a result file: {error}") from error
    return plain
