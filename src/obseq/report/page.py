"""The page of a result: one file that needs nothing else, one script for every kind."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from string import Template

from msgspec import structs

from obseq.arguments import expecting, instance
from obseq.records.adjustment import AdjustmentRecord
from obseq.records.record import encoded
from obseq.report.adjusted import head
from obseq.report.drawings.html import escaped
from obseq.report.drawings.map import similarity
from obseq.report.drawings.plan import plan
from obseq.report.head import Finding, Findings, Page, Place, page_of, printed
from obseq.report.part import NOUNS, density, not_shown, part_of, told
from obseq.report.tables.content import numbers_of, tables
from obseq.report.tables.packed import packed, squeezed
from obseq.report.tables.spared import spared
from obseq.report.tables.units import Plain, scales

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
    part, places = part_of(record)
    rows, counts = numbers_of(part), not_shown(record, part)
    made = [told(table, counts) for table in tables(part, rows)]
    drawn = plan(part, rows) if record.points else None
    shown = page_of(head(record, rows), printed(rows), drawn, made)
    if not counts:
        return shown
    if drawn is not None and "points" in counts:
        drawn["density"] = density(record.points, similarity(part))
    return _moved(_announced(shown, counts), places)


def _announced(shown: Page, counts: dict[str, tuple[int, int]]) -> Page:
    """The page which says first what it leaves out."""
    parts = [f"{few} of {many} {NOUNS[name]}" for name, (few, many) in counts.items()]
    text = f"The worst and the weakest: {', '.join(parts)}. The result file has all."
    told_first = Finding("info", "A part of a large network", text)
    first, *others = shown.lists or (Findings("Look at first", ()),)
    last = structs.replace(
        others[-1] if others else first, items=(*(others or [first])[-1].items, told_first)
    )
    return structs.replace(shown, lists=(first, *others[:-1], last) if others else (last,))


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
