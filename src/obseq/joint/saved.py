"""Results read again, of a network or of a block."""

from __future__ import annotations

from pathlib import Path

from obseq.images.output.block_record import BundleRecord, block_record_of, is_block
from obseq.records.adjustment import AdjustmentRecord
from obseq.report.result_file import read_plain


def load(path: str | Path) -> AdjustmentRecord | BundleRecord:
    """The result that a `.json` file holds: of `save`, of `obseq adjust` or `obseq bundle`.

    Raises:
        InputError: The file cannot be read, or is no such result.
    """
    plain = read_plain(path)
    if is_block(plain):
        return block_record_of(plain, str(path))
    return AdjustmentRecord.from_dict(plain, str(path))
