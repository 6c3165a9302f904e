"""The page of a result: one file that needs nothing else, one script for every kind."""

from __future__ import annotations

from importlib.resources import files
from string import Template
from typing import TYPE_CHECKING, Any

from obseq.arguments import expecting, instance
from obseq.records.adjustment import AdjustmentRecord
from obseq.records.record import encoded
from obseq.report import adjusted, findings, spared
from obseq.report.content import numbers_of, tables
from obseq.report.head import Page
from obseq.report.html import escaped
from obseq.report.packed import packed
from obseq.report.plan import plan

if TYPE_CHECKING:
    from collections.abc import Iterable

    from obseq.records.adjustment import RunRecord

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
    record = spared.spared(given)
    rows = numbers_of(record)
    lists = findings.findings(record, rows)
    return Page(
        "adjustment",
        record.title or f"Network of {len(record.points)} points",
        about("Adjustment", record.run),
        "" if record.run is None else record.run.identifier,
        {"length": record.units.length, "angle": record.units.angle},
        adjusted.verdict(record),
        adjusted.cards(record, rows),
        lists,
        printed(rows),
        plan(record, rows) if record.points else None,
        tables(record, rows),
        adjusted.sections(record),
        None if record.reliability is None else record.reliability.critical,
        lists[0].items[0].to if record.gross_errors else None,
    )


def about(what: str, run: RunRecord | None) -> str:
    """What a page shows, and when that was made."""
    return what if run is None else f"{what} \u00b7 {run.created[:16].replace('T', ' ')} UTC"


def printed(names: Iterable[str]) -> list[str]:
    """Names of points as a page shows them."""
    from obseq.printable import printable_line

    return [printable_line(name) for name in names]


def document(shown: Page) -> str:
    """The HTML document."""
    return Template(_part("page.html")).substitute(
        title=escaped(shown.title),
        style=_bare(_part("page.css")),
        content=_embedded(encoded(_packed(shown))),
        script="\n".join(_bare(_part(f"{name}.js")) for name in SCRIPTS),
    )


def _packed(shown: Page) -> Page:
    """The page whose long columns are bytes."""
    from msgspec import structs

    return structs.replace(shown, tables=[_shorter(table) for table in shown.tables])


def _shorter(table: dict[str, Any]) -> dict[str, Any]:
    columns = [item | {"values": packed(item["values"], item["quantity"])} for item in table["columns"]]
    marks = {name: packed(table[name], "choice") for name in ("angular", "unused") if name in table}
    return table | marks | {"columns": columns, "size": len(table["columns"][0]["values"])}


def _part(name: str) -> str:
    return files("obseq.report").joinpath("web", name).read_text(encoding="utf-8")


def _bare(source: str) -> str:
    """Source text without its indents and its comments, which stand on lines of their own."""
    lines = (line.strip() for line in source.splitlines())
    return "\n".join(line for line in lines if line and not line.startswith(("//", "/**", "*")))


def _embedded(text: str) -> str:
    """JSON inside an element of HTML: nothing in it ends the element."""
    return text.replace("<", "\\u003c")
