"""Tables as text (CSV), in which no cell is a formula to a spreadsheet, and none holds control characters."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence

from obseq.printable import printable_line

FORMULA = frozenset("=+-@")
"""What a cell begins with that a spreadsheet computes."""
TEXT = "'"
"""What a spreadsheet puts before a cell that is text whatever it looks like."""


def csv_text(rows: Iterable[Sequence[object]]) -> str:
    """Rows of cells as text, one line each; texts are written as `cell_of` has them."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerows([cell_of(cell) if isinstance(cell, str) else cell for cell in row] for row in rows)
    return stream.getvalue()


def cell_of(text: str) -> str:
    r"""A text as a cell that shows it: a formula gets an apostrophe, what cannot be printed an escape.

    Example:
        >>> [cell_of(text) for text in ("A1", "=1+1", "-12.5", "a\tb")]
        ['A1', "'=1+1", '-12.5', 'a\\tb']
    """
    shown = printable_line(text)
    return TEXT + shown if _is_taken_for_more(shown) else shown


def text_in(cell: str) -> str:
    """The text that `cell_of` has written as that cell."""
    return cell[1:] if cell.startswith(TEXT) and _is_taken_for_more(cell[1:]) else cell


def _is_taken_for_more(text: str) -> bool:
    """Whether it begins as a formula and is no number, or as the cell of such a text."""
    if text.lstrip(TEXT + " ")[:1] not in FORMULA:
        return False
    try:
        float(text)
    except ValueError:
        return True
    return False
