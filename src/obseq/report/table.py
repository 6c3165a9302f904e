"""Plain text tables: columns as wide as what is in them."""

import textwrap
from collections.abc import Iterable, Iterator

from obseq.printable import printable_line
from obseq.report.rows import Table

WIDTH = 120
"""Columns of a listing; only names of many letters make a table wider."""


def lines_of(table: Table, indent: str = "  ") -> Iterator[str]:
    """The lines of a table: title, header, rows; names left, numbers right; columns closer if it is wide."""
    grid = [table.header, *(tuple(map(printable_line, row)) for row in table.rows)]
    widths = [max(len(row[k]) for row in grid) for k in range(len(table.header))]
    gap = "  " if len(indent) + sum(widths) + 2 * (len(widths) - 1) <= WIDTH else " "
    indent = indent if len(gap) == 2 else ""
    yield from textwrap.wrap(table.title, WIDTH, break_long_words=False)
    for row in grid:
        cells = (
            text.ljust(width) if k < table.left else text.rjust(width)
            for k, (text, width) in enumerate(zip(row, widths, strict=True))
        )
        yield (indent + gap.join(cells)).rstrip()


def wrapped(lines: Iterable[str]) -> Iterator[str]:
    """The lines, those too long for a listing continued on the next, indented."""
    for line in lines:
        indent = " " * (len(line) - len(line.lstrip()) + 4)
        yield from textwrap.wrap(
            line, WIDTH, subsequent_indent=indent, break_long_words=False, drop_whitespace=True
        ) or [line]
