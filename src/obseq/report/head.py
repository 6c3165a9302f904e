"""What every page begins with, and in which form: verdict, cards, findings, sections."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from obseq.records.record import Record
from obseq.report.units import Plain  # noqa: TC001  # fields are read at run time

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

Level = Literal["bad", "warn", "ok", "info"]
MOST_TICKS = 150
BINS = 10


class Verdict(Record, frozen=True, omit_defaults=False):
    """What the reader may do with the result, in one sentence.

    Attributes:
        level: "ok" where the command ends with 0.
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


class Page(Record, frozen=True, omit_defaults=False):
    """All that a page shows.

    Attributes:
        kind: "adjustment", "plan", "comparison" or "block".
        title: What the user calls it.
        about: What it is, and when it was made.
        run: Identifier of the run.
        units: Of lengths and angles, to begin with.
        limit: Of standardised residuals.
        verdict: In one sentence.
        cards: At most five.
        lists: Findings, the worst first.
        names: Of points.
        plan: See `report.plan`.
        tables: See `report.columns`.
        sections: What else there is.
        first: What is selected when the page opens.
        scales: How quantities are shown, see `report.units`.
    """

    kind: str
    title: str
    about: str
    run: str
    units: dict[str, str]
    verdict: Verdict
    cards: tuple[Card, ...]
    lists: tuple[Findings, ...]
    names: list[str]
    plan: Plain | None
    tables: list[Plain]
    sections: tuple[Section, ...]
    limit: float | None = None
    first: Place | None = None
    scales: Plain | None = None


def gauge(value: float, lower: float, upper: float, level: str) -> Plain:
    """A value beside the interval where it is expected."""
    return {"kind": "gauge", "value": value, "lower": lower, "upper": upper, "level": level}


def strip(values: Iterable[float | None], limit: float | None = None) -> Plain | None:
    """Every value as a tick, the largest of many; None without any."""
    found = sorted((abs(value) for value in values if value is not None and value == value), reverse=True)
    if not found:
        return None
    ticks = [float(f"{value:.4g}") for value in found[:MOST_TICKS]]
    return {"kind": "strip", "values": ticks, "limit": limit, "more": max(0, len(found) - MOST_TICKS)}


def shares(values: Iterable[float | None]) -> Plain:
    """How many of some shares, from 0 to 1, lie in each tenth."""
    counts = [0] * BINS
    for value in values:
        if value is not None and value == value:
            counts[max(0, min(BINS - 1, int(value * BINS)))] += 1
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
