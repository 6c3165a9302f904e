"""Columns of the tables of the interactive page: titles, quantities and numbers in metres and radians."""

from __future__ import annotations

import math
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from obseq.printable import printable_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from obseq.record import EllipseRecord

Column = dict[str, Any]
Table = Column

PLACES = {"m": 5, "rad": 9}
"""Decimals of coordinates and observed values on the page: more than it shows in any unit."""
DIGITS = 5
"""Significant digits of residuals, precisions and what judges them."""
_SMALL = f"%.{DIGITS}g"


def rounded(value: float | None, places: int = PLACES["m"]) -> float | None:
    """A number without the digits that the page does not show."""
    return None if value is None or not math.isfinite(value) else round(value, places)


def small(value: float | None) -> float | None:
    """A number with the significant digits that the page can show."""
    return None if value is None or not math.isfinite(value) else float(_SMALL % value)


def column(title: str, quantity: str, values: Iterable[object], **more: object) -> Column:
    """A column of a table."""
    return {"title": title, "quantity": quantity, "values": list(values), **more}


def choice(title: str, texts: Sequence[str], **more: object) -> Column:
    """A column of few different texts."""
    found: dict[str, int] = {}
    values = [found.setdefault(text, len(found)) for text in texts]
    return column(title, "choice", values, choices=[printable_line(text) for text in found], **more)


def table(name: str, short: str, title: str, columns: Sequence[Column], **more: object) -> Table:
    """A table; columns without any value are left out."""
    kept = [item for item in columns if any(value is not None for value in item["values"])]
    return {"id": name, "short": short, "title": printable_line(title), "columns": kept, **more}


def field(title: str, quantity: str, rows: Iterable[object], name: str, **more: object) -> Column:
    """A column of one field of records, to the digits of residuals and precisions; dots lead inside."""
    return column(title, quantity, map(small, map(attrgetter(name), rows)), **more)


def inside(title: str, quantity: str, parts: Iterable[object], name: str, **more: object) -> Column:
    """The same of records of which some may be missing."""
    value = attrgetter(name)
    return column(title, quantity, (None if row is None else small(value(row)) for row in parts), **more)


def element(
    title: str, quantity: str, parts: Iterable[Sequence[float] | None], k: int, **more: object
) -> Column:
    """A column of one element of tuples of which some may be missing."""
    return column(title, quantity, (None if row is None else small(row[k]) for row in parts), **more)


def ellipse_columns(ellipses: Iterable[EllipseRecord | None]) -> Iterator[Column]:
    """Axes and bearings of ellipses of which some may be missing."""
    found = list(ellipses)
    yield inside("major", "small_length", found, "semi_major")
    yield inside("minor", "small_length", found, "semi_minor")
    yield inside("bearing", "bearing", found, "bearing")
