"""Plain text tables: columns as wide as what is in them."""

from collections.abc import Iterator

from obseq.printable import printable_line
from obseq.report.rows import Table


def lines_of(table: Table, indent: str = "  ") -> Iterator[str]:
    """The lines of a table: its title, its header, its rows; names on the left, numbers on the right."""
    grid = [table.header, *(tuple(map(printable_line, row)) for row in table.rows)]
    widths = [max(len(row[k]) for row in grid) for k in range(len(table.header))]
    yield table.title
    for row in grid:
        cells = (
            text.ljust(width) if k < table.left else text.rjust(width)
            for k, (text, width) in enumerate(zip(row, widths, strict=True))
        )
        yield (indent + "  ".join(cells)).rstrip()
