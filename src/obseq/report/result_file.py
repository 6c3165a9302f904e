"""The result file: the record of an adjustment as JSON, written and read back."""

from pathlib import Path

from msgspec import structs

from obseq.arguments import PATH, expecting, instance
from obseq.errors import InputError
from obseq.printable import json_escaped
from obseq.reading.json_text import parsed_json
from obseq.reading.text import read_bytes
from obseq.records.adjustment import AdjustmentRecord
from obseq.records.record import Record, encoded


@expecting(record=instance(AdjustmentRecord))
def to_json(record: AdjustmentRecord) -> str:
    """The text of the result file: valid JSON, one point, station or observation per line, floats exact."""
    return text_of(record)


def text_of(record: Record) -> str:
    """The text of a file with this content: valid JSON, one item of a list per line, floats exact."""
    names = [field.name for field in structs.fields(record)]
    names.sort(key=lambda name: name not in ("format", "version"))
    parts = [f'"{name}": {_lines(getattr(record, name))}' for name in names]
    return json_escaped("{\n" + ",\n".join(parts) + "\n}\n")


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
    data = read_bytes(Path(path))
    try:
        plain = parsed_json(data)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: it is not a result file: {error}") from error
    return plain


def _lines(value: object) -> str:
    if isinstance(value, tuple) and value and isinstance(value[0], Record):
        return "[\n  " + ",\n  ".join(encoded(item) for item in value) + "\n]"
    return encoded(value)
