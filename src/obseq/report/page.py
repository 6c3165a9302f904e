"""The page of a result: one file that needs nothing else, one script for every kind."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from string import Template
from typing import TYPE_CHECKING

from msgspec import structs

from obseq.arguments import expecting, instance
from obseq.records.adjustment import AdjustmentRecord
from obseq.records.record import encoded
from obseq.report.adjusted import head
from obseq.report.content import numbers_of, tables
from obseq.report.findings import POOR
from obseq.report.head import Page, Place, page_of, printed
from obseq.report.html import escaped
from obseq.report.packed import packed, squeezed
from obseq.report.plan import plan
from obseq.report.spared import spared
from obseq.report.units import scales

if TYPE_CHECKING:
    from obseq.report.units import Plain

MOST_OBSERVATIONS = 20_000
"""Rows that a page of a large network has; the result file has all."""
SCRIPTS = (
    "elements",
    "numbers",
    "drawing",
    "figures",
    "sights",
    "motions",
    "plan",
    "table",
    "charts",
    "paper",
    "main",
)


@expecting(record=instance(AdjustmentRecord))
def page(record: AdjustmentRecord) -> str:
    """The report of an adjustment as an HTML document that loads nothing: script and numbers are inside."""
    return document(adjustment_page(record))


def adjustment_page(given: AdjustmentRecord) -> Page:
    """All that the page of an adjustment shows; precisions that suspected errors spoil are not among it."""
    record = spared(given)
    rows = numbers_of(record)
    made = tables(record, rows)
    kept = _worst(record)
    if kept is not None:
        made = [_cut(table, kept) if table["id"] == "observations" else table for table in made]
    shown = page_of(head(record, rows), printed(rows), plan(record, rows) if record.points else None, made)
    return shown if kept is None else _moved(shown, {row: k for k, row in enumerate(kept)})


def _worst(record: AdjustmentRecord) -> list[int] | None:
    """The observations of a large network that its page has: the accused and the worst; None for all."""
    found = record.observations
    if len(found) <= MOST_OBSERVATIONS:
        return None
    accused = {place.row for item in record.gross_errors for place in item.observations}
    weak = {k for k, row in enumerate(found) if row.redundancy is not None and row.redundancy < POOR}
    size = [abs(row.standardised_residual or row.normalised_residual or 0.0) * row.active for row in found]
    order = sorted(range(len(found)), key=lambda k: (k not in accused, -size[k]))
    poor = sorted(weak)[: MOST_OBSERVATIONS // 2]
    return sorted({*poor, *order[: MOST_OBSERVATIONS - len(poor)]})


def _cut(table: Plain, kept: list[int]) -> Plain:
    """The table with some of its rows, which it says."""
    whole = len(table["columns"][0]["values"])
    columns = [item | {"values": [item["values"][k] for k in kept]} for item in table["columns"]]
    marks = {name: [table[name][k] for k in kept] for name in ("angular", "unused")}
    some = f"The worst and the weakest {len(kept)} of {whole} observations; the result file has all. "
    return table | marks | {"columns": columns, "about": some + table["about"]}


def _moved(shown: Page, places: dict[int, int]) -> Page:
    """The page whose cards and findings lead to the rows that it has."""

    def of(to: Place | None) -> Place | None:
        if to is None or to.row is None or to.table != "observations":
            return to
        return Place("observations", row=places[to.row]) if to.row in places else Place("observations")

    cards = tuple(structs.replace(card, to=of(card.to)) for card in shown.cards)
    lists = tuple(
        structs.replace(part, items=tuple(structs.replace(item, to=of(item.to)) for item in part.items))
        for part in shown.lists
    )
    return structs.replace(shown, cards=cards, lists=lists, first=of(shown.first))


def document(shown: Page) -> str:
    """The HTML document."""
    return Template(_part("page.html")).substitute(
        title=escaped(shown.title),
        style=_part("page.css"),
        content=_embedded(encoded(_packed(shown))),
        script=_script(),
    )


def _packed(shown: Page) -> Page:
    """The page whose long columns are bytes."""
    return structs.replace(shown, tables=[_shorter(table) for table in shown.tables], scales=scales())


def _shorter(table: Plain) -> Plain:
    columns = [item | {"values": packed(item["values"], item["quantity"])} for item in table["columns"]]
    marks = {name: packed(table[name], "choice") for name in ("angular", "unused") if name in table}
    return table | marks | {"columns": columns, "size": len(table["columns"][0]["values"])}


def _part(name: str) -> str:
    return files("obseq.report").joinpath("web", name).read_text(encoding="utf-8")


@cache
def _script() -> str:
    """The sources of the script as they are read, compressed."""
    sources = ('"use strict";', *(_part(f"{name}.js") for name in SCRIPTS), "//# sourceURL=obseq.js")
    return squeezed("\n".join(sources).encode())


def _embedded(text: str) -> str:
    """JSON inside an element of HTML: nothing in it ends the element."""
    return text.replace("<", "\\u003c")
