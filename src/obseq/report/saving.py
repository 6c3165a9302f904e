"""Results in files by their suffix, and back from them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from obseq.errors import InputError
from obseq.report.formats import FORMATS
from obseq.report.result_file import read_json
from obseq.writing import write_all

if TYPE_CHECKING:
    from obseq.records.adjustment import AdjustmentRecord


def save(record: AdjustmentRecord, path: str | Path) -> None:
    """Writes a result in the format that the suffix says.

    Raises:
        InputError: The suffix is that of no format, or the file cannot be written.
    """
    by_suffix = {form.suffix: form for form in FORMATS}
    form = by_suffix.get(Path(path).suffix.lower())
    if form is None:
        raise InputError(f"{path}: a result is saved as {', '.join(by_suffix)}; end the name so")
    write_all({Path(path): form.write(record)})


def load(path: str | Path) -> AdjustmentRecord:
    """The result that a `.json` file holds: of `Adjustment.save`, or of `obseq adjust`.

    Raises:
        InputError: The file cannot be read, or is no result of an adjustment.
    """
    return read_json(path)
