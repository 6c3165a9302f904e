"""Columns of tables: titles, quantities and numbers in metres and radians.

A table is declared once, with what is here. The page, texts and CSV are written from that (`report.writer`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from operator import attrgetter
from typing import cast

from obseq.printable import printable_line
from obseq.records.adjustment import EllipseRecord
from obseq.report.tables.units import MANY, Plain

Column = Plain
Table = Plain

PLACES = {"m": 5, "rad": 9}
"""Decimals of coordinates and observed values on the page: more than it shows in any unit."""
DIGITS = 6
"""Significant digits of residuals, precisions and what judges them: as many as a page holds of them."""
EXACT = frozenset({"length", "angle", "observed", "count", "fine", "value"})
"""Quantities that are kept to all their digits."""
TEXTS = frozenset({"text", "choice", "point"})
"""Quantities that are no numbers."""
_SMALL = f"%.{DIGITS}g"
_POWERS = [float(f"1e{k}") for k in range(23)]
_EXACT = 1e12
"""Products below it are exact to a thousandth: ties of the last digit apart, rounded as decimals are."""


def rounded(value: float | None, places: int = PLACES["m"]) -> float | None:
    """A number without the digits that the page does not show."""
    return None if value is None or not math.isfinite(value) else round(value, places)


def small(value: float | None) -> float | None:
    """A number with the significant digits that the page can show."""
    return None if value is None or not math.isfinite(value) else float(_SMALL % value)


def all_rounded(
    values: Sequence[float | None], places: int | Sequence[int] = PLACES["m"]
) -> list[float | None]:
    """The same of many numbers, each to the digits of its own or all to the same."""
    import numpy as np

    power = 10.0 ** np.asarray(places)
    with np.errstate(over="ignore"):
        whole = np.rint(np.array(values, np.float64) * power)  # None is NaN
    found: list[float | None] = (whole / power).tolist()
    for k in np.flatnonzero(~(np.abs(whole) < _EXACT)).tolist():
        found[k] = rounded(values[k], places if isinstance(places, int) else places[k])
    return found


def all_small(values: Sequence[float | None]) -> list[float | None]:
    """The same of many numbers; ties of the last digit may go either way."""
    if len(values) < MANY:
        return list(map(small, values))
    import numpy as np

    numbers = np.array(values, np.float64)  # None is NaN
    with np.errstate(divide="ignore", invalid="ignore"):
        places = DIGITS - 1 - np.floor(np.log10(np.abs(numbers)))
    is_usual = np.abs(places) < len(_POWERS)  # of which the powers are exact, and numbers other than 0
    power = np.array(_POWERS)[np.where(is_usual, np.abs(places), 0.0).astype(np.intp)]
    found: list[float | None] = np.where(
        places < 0, np.rint(numbers / power) * power, np.rint(numbers * power) / power
    ).tolist()
    for k in np.flatnonzero(~is_usual).tolist():
        found[k] = small(values[k])
    return found


def column(title: str, quantity: str, values: Iterable[object], **more: object) -> Column:
    """A column of a table; its key is its title unless another is given.

    Numbers are kept to the digits of a page, those of `EXACT` quantities to all that they have.
    `rare` ones are shown on request, `paper` is False for those that are not printed, `bar` draws the values
    of `w` or `redundancy` beside them, `joined` ones follow the text before them where lines are short.
    """
    found = list(values)
    if quantity not in EXACT and quantity not in TEXTS:
        found = list(all_small(cast("list[float | None]", found)))
    return {"key": title, "title": title, "quantity": quantity, "values": found, **more}


def choice(title: str, texts: Sequence[str], **more: object) -> Column:
    """A column of few different texts."""
    found: dict[str, int] = {}
    values = [found.setdefault(text, len(found)) for text in texts]
    return column(title, "choice", values, choices=[printable_line(text) for text in found], **more)


def table(name: str, title: str, columns: Sequence[Column], **more: object) -> Table:
    """A table; columns without any value are left out, and so is an order by one of them.

    `rows` says what its rows are for the selection: "observation" or "point"; `order` is the key of the
    column whose largest values come first.
    """
    kept = [item for item in columns if any(value is not None for value in item["values"])]
    if more.get("order") not in {item["key"] for item in kept}:
        more.pop("order", None)
    return {"id": name, "title": printable_line(title), "columns": kept, **more}


def filled(tables: Iterable[Table | None]) -> list[Table]:
    """The tables that have something to show."""
    return [item for item in tables if item and item["columns"]]


def field(title: str, quantity: str, rows: Iterable[object], name: str, **more: object) -> Column:
    """A column of one field of records; dots lead inside."""
    return column(title, quantity, map(attrgetter(name), rows), **more)


def inside(title: str, quantity: str, parts: Iterable[object], name: str, **more: object) -> Column:
    """The same of records of which some may be missing."""
    value = attrgetter(name)
    found = [None if row is None else value(row) for row in parts]
    return column(title, quantity, found, **more)


def element(
    title: str, quantity: str, parts: Iterable[Sequence[float | None] | None], k: int, **more: object
) -> Column:
    """A column of one element of tuples of which some may be missing."""
    return column(title, quantity, [None if row is None else row[k] for row in parts], **more)


def elements(
    titles: Sequence[str], quantity: str, parts: Iterable[Sequence[float | None] | None], **more: object
) -> list[Column]:
    """Columns of the elements of tuples of which some may be missing."""
    rows = list(parts)
    return [element(title, quantity, rows, k, **more) for k, title in enumerate(titles)]


def ellipse_columns(ellipses: Iterable[EllipseRecord | None]) -> Iterator[Column]:
    """Axes and bearings of ellipses of which some may be missing."""
    found = list(ellipses)
    yield inside("major", "small_length", found, "semi_major")
    yield inside("minor", "small_length", found, "semi_minor")
    yield inside("bearing", "bearing", found, "bearing")
