"""What every page begins with, and in which form: verdict, cards, findings, sections."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from heapq import nlargest
from typing import Literal

from obseq.printable import printable_line
from obseq.records.adjustment import IterationRecord, RunRecord
from obseq.records.quality import GlobalTestRecord
from obseq.records.record import Record
from obseq.report.tables.units import Plain, significant

Level = Literal["bad", "warn", "ok", "info"]
MOST_TICKS = 150
BINS = 10
MOST_FINDINGS = 100
"""Findings of a list that a page shows; it is no longer read beyond."""


class Verdict(Record, frozen=True, omit_defaults=False):
    """What the reader may do with the result, in one sentence.

    Attributes:
        level: "ok" only where the command ends with 0, "bad" only where it ends with 1.
        text: The sentence.
        detail: How much of what there is.
    """

    level: Level
    text: str
    detail: str


class Place(Record, frozen=True):
    """What a card or a finding leads to: a row of a table, a point, a filter; nothing by default.

    Attributes:
        table: The table of the row, or that is filtered.
        row: In that table.
        point: Number of a point.
        filter: What the table shows.
    """

    table: str = ""
    row: int | None = None
    point: int | None = None
    filter: str | None = None


class Card(Record, frozen=True):
    """One number beside what it is compared with.

    Attributes:
        label: What it is.
        value: The number, as a sentence has it.
        unit: What stands behind it.
        tag: Level and a word or two.
        figure: Its drawing: `gauge`, `strip`, `bins` or `share`.
        note: One line below.
        to: Where it leads.
    """

    label: str
    value: str
    unit: str = ""
    tag: tuple[str, str] | None = None
    figure: Plain | None = None
    note: str = ""
    to: Place | None = None


class Finding(Record, frozen=True):
    """Something to look at.

    Attributes:
        level: How bad it is.
        title: What it is about.
        text: What is found.
        size: How large it is, in a word.
        where: File and line.
        step: What to do next.
        copy: What to type for that.
        to: Where it is.
    """

    level: Level
    title: str
    text: str
    size: str = ""
    where: str = ""
    step: str = ""
    copy: str = ""
    to: Place | None = None


class Findings(Record, frozen=True):
    """Findings of one kind."""

    title: str
    items: tuple[Finding, ...]


class Section(Record, frozen=True):
    """A tab that is no single table.

    Attributes:
        key: Its name in the address.
        title: Of the tab.
        charts: What its charts show, by kind.
        facts: Names and texts.
        tables: Names of tables that stand in it.
        words: What is explained, folded.
        note: Above all that.
    """

    key: str
    title: str
    charts: tuple[Plain, ...] = ()
    facts: tuple[tuple[str, str], ...] = ()
    tables: tuple[str, ...] = ()
    words: tuple[tuple[str, str], ...] = ()
    note: str = ""


class Head(Record, frozen=True, omit_defaults=False):
    """What a page begins with, and its sections: all that a terminal is told as well.

    Attributes:
        kind: "adjustment", "plan", "comparison" or "block".
        title: What the user calls it.
        about: What it is, and when it was made.
        run: Identifier of the run.
        units: Of lengths and angles, to begin with.
        verdict: In one sentence.
        cards: At most five.
        lists: Findings, the worst first.
        sections: What else there is.
        limit: Of standardised residuals.
        first: What is selected when the page opens.
    """

    kind: str
    title: str
    about: str
    run: str
    units: dict[str, str]
    verdict: Verdict
    cards: tuple[Card, ...]
    lists: tuple[Findings, ...]
    sections: tuple[Section, ...]
    limit: float | None = None
    first: Place | None = None


class Page(Head, frozen=True, omit_defaults=False, kw_only=True):
    """All that a page shows.

    Attributes:
        names: Of points.
        plan: See `report.plan`.
        tables: See `report.columns`.
        scales: How quantities are shown, see `report.units`.
    """

    names: list[str]
    plan: Plain | None
    tables: list[Plain]
    scales: Plain | None = None


def page_of(head: Head, names: list[str], plan: Plain | None, tables: list[Plain]) -> Page:
    """The page that begins so; of very long lists of findings its begin, which it says."""
    whole = {field: getattr(head, field) for field in head.__struct_fields__}
    whole["lists"] = tuple(_cut(part) for part in head.lists)
    return Page(**whole, names=names, plan=plan, tables=tables)


def _cut(part: Findings) -> Findings:
    more = len(part.items) - MOST_FINDINGS
    if more <= 0:
        return part
    rest = Finding("info", f"And {more} more", "The listing and the result file have them.")
    return Findings(part.title, (*part.items[:MOST_FINDINGS], rest))


def gauge(value: float, lower: float, upper: float, level: str) -> Plain:
    """A value beside the interval where it is expected."""
    return {"kind": "gauge", "value": value, "lower": lower, "upper": upper, "level": level}


def strip(values: Iterable[float | None], limit: float | None = None) -> Plain | None:
    """Every value as a tick, the largest of many; None without any."""
    found = [abs(value) for value in values if value is not None and value == value]
    if not found:
        return None
    ticks = [float(f"{value:.4g}") for value in nlargest(MOST_TICKS, found)]
    return {"kind": "strip", "values": ticks, "limit": limit, "more": max(0, len(found) - MOST_TICKS)}


def shares(values: Iterable[float | None]) -> Plain:
    """How many of some shares, from 0 to 1, lie in each tenth."""
    tenths = (int(value * BINS) for value in values if value is not None and value == value)
    found = Counter(max(0, min(BINS - 1, tenth)) for tenth in tenths)
    counts = [found[tenth] for tenth in range(BINS)]
    return {"kind": "bins", "values": counts, "low": 1, "first": "0", "last": "1"}


def share(part: int, second: int, whole: int) -> Plain:
    """How many of a whole are bad, and how many are weak."""
    return {"kind": "share", "part": part, "second": second, "whole": whole}


def counted(number: int, what: str, many: str | None = None) -> str:
    """A number with its noun."""
    return f"{number} {what if number == 1 else many or what + 's'}"


def joined(parts: Sequence[str]) -> str:
    """What there is, in a line."""
    return " \u00b7 ".join(part for part in parts if part)


UNEXPLAINED = "Not usable yet: something is wrong, and no single cause explains it."
UNCHECKED = "Adjusted, but nothing is checked: there is no redundancy."


def to_check(count: int) -> str:
    """The sentence that sends to suspected errors."""
    what = "1 error is suspected. Check it" if count == 1 else f"{count} errors are suspected. Check them"
    return f"Not usable yet: {what}, then adjust again."


def misfit(test: GlobalTestRecord) -> str:
    """The sentence of a test of sigma0 that fails."""
    size = "large" if test.sigma0 > test.upper else "small"
    told = f"sigma0 is {significant(test.sigma0, 3)}, {test.lower:.2f} to {test.upper:.2f} is expected"
    return f"The residuals are too {size} for their sigmas: {told}."


def sigma0_card(test: GlobalTestRecord, note: str, beside: str = "") -> Card:
    """Sigma0 beside the interval of its test."""
    is_large, is_small = test.sigma0 > test.upper, test.sigma0 < test.lower
    tag = ("bad", "too large") if is_large else ("warn", "too small") if is_small else ("ok", "as expected")
    drawn = gauge(test.sigma0, test.lower, test.upper, "bad" if is_large else "warn")
    note = note or f"{100 * (1 - test.level):g} % chi-square interval{beside}"
    return Card("sigma0", significant(test.sigma0, 4), "expected 1", tag, drawn, note, Place("quality"))


def redundancy_card(redundancy: int, equations: int, parts: Iterable[float | None] | None, to: str) -> Card:
    """The redundancy, and how it is shared by the rows of a table; None: that is not known."""
    each = f"{redundancy / equations:.2f} per equation" if equations else ""
    if parts is None:
        return Card("redundancy", str(redundancy), each)
    place = Place(to, filter="redundancy<0.3")
    told = "share of an error that shows"
    return Card("redundancy", str(redundancy), each, None, shares(parts), told, place)


def convergence(iterations: Iterable[IterationRecord]) -> Plain:
    """The chart of how the iterations went."""
    steps = [{"sigma0": row.sigma0, "step": row.max_step} for row in iterations]
    return {"kind": "convergence", "iterations": steps}


def about(what: str, run: RunRecord | None) -> str:
    """What a page shows, and when that was made."""
    return what if run is None else f"{what} \u00b7 {run.created[:16].replace('T', ' ')} UTC"


def printed(names: Iterable[str]) -> list[str]:
    """Names of points as a page shows them."""
    return [printable_line(name) for name in names]


WORDS = (
    ("sigma0", "How large the residuals are beside the sigmas that were given. 1 when the sigmas are right."),
    ("residual", "Computed minus observed."),
    ("w", "Residual over its own standard deviation. Beyond the limit once in a thousand by chance."),
    ("redundancy", "Share of an error that shows in its own residual. 0: unchecked; 1: fully checked."),
    ("detectable", "Smallest error that the test finds 8 times in 10, unless said otherwise."),
    ("effect", "How far an error of that size can move the result unseen, in standard deviations."),
    ("ellipse", "Region that holds the point with the stated probability."),
)
"""What the words of the page mean."""
