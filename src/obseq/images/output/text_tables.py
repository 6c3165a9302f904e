"""Tables of a screenful of text."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

MOST = 12
"""Rows of a table before it is cut."""


def sigma_text(value: float | None) -> str:
    """A standard deviation: `fixed` for 0, a dash where none was asked for."""
    if value is None:
        return "-"
    return "fixed" if value == 0.0 else f"{value:.3g}"


def text_table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Rows under titles, the first ones of many."""
    shown = [titles, *rows[:MOST]]
    widths = [max(len(row[k]) for row in shown) for k in range(len(titles))]
    text = "".join("  " + _line(row, widths) + "\n" for row in shown)
    return text + (f"  ... and {len(rows) - MOST} more\n" if len(rows) > MOST else "")


def _line(row: Sequence[str], widths: Sequence[int]) -> str:
    return "  ".join(_cells(row, widths)).rstrip()


def _cells(row: Sequence[str], widths: Sequence[int]) -> Iterator[str]:
    for k, (cell, width) in enumerate(zip(row, widths, strict=True)):
        yield cell.ljust(width) if k == 0 else cell.rjust(width)
