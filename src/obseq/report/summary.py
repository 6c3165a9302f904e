"""What a terminal and a listing tell of a result: what its page begins with, in lines; and its tables."""

from __future__ import annotations

import textwrap
import time
from itertools import groupby
from operator import attrgetter
from typing import TYPE_CHECKING

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.printable import printable
from obseq.report.said import plain
from obseq.report.tables.units import significant
from obseq.report.writer import Writer, ordered, worst, wrapped

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

    from obseq.report.head import Card, Finding, Head
    from obseq.report.tables.columns import Table
    from obseq.report.tables.units import Units

LINES = 30
"""Lines of a summary, whatever the size of what was adjusted."""
WIDTH = 100
BRIEF = 3
"""Lines of a finding, where not all is asked for."""
WORST = 5
"""Rows of each table with -v."""
MOST_ITERATIONS = 9
RESIDUALS = ("observations", "measures", "displacements")
"""Tables that `residuals` stands for."""
SIGNS = {"\u2192": "->", "\u03c3": "sigmas", " \u00b7 ": "; ", "\u00d7": "x", "\u2013": "-"}
RANK = {"bad": 0, "warn": 1, "info": 2, "ok": 3}
"""Which findings are told first where not all can be."""
WHOLE = "\u00a0"
"""A blank at which no line ends."""
NONE = {"known": "(There are no known coordinates with a sigma here: held ones have no residual.)"}
"""What is said of tables that a result does not have."""
NOTHING = "nothing (--out and the options of each format write results)"

Line = tuple[str, str]
"""A line and its level: "bad", "warn", "ok", or "" for one that judges nothing."""


@dataclass(frozen=True)
class Outcome:
    """A result of any kind, as reports tell it.

    Attributes:
        head: What its page begins with.
        names: Of points, by the numbers that tables hold.
        units: Of lengths and angles.
        known: Names of all tables that results of its kind may have.
        tables: Makes those of some names, all without any.
        worst: Makes what a large result has of those that have an order, points apart; None: `tables` do.
    """

    head: Head
    names: Sequence[str]
    units: Units
    known: tuple[str, ...]
    tables: Callable[[Collection[str]], list[Table]]
    worst: Callable[[], list[Table]] | None = None


@dataclass(frozen=True)
class Detail:
    """How much is told.

    Attributes:
        amount: "quiet": the verdict alone; "usual": thirty lines; "verbose": all findings, facts, times.
        shown: Tables that are told as well.
        lines: How many lines are usual.
    """

    amount: str = "usual"
    shown: tuple[str, ...] = ()
    lines: int = LINES


USUAL = Detail()
QUIET = Detail("quiet")
VERBOSE = Detail("verbose")


def summary(
    outcome: Outcome,
    written: Sequence[str] | None = None,
    detail: Detail = USUAL,
    seconds: Mapping[str, float] | None = None,
) -> str:
    """The lines of `told` as text."""
    return "".join(f"{line}\n" for line, _ in told(outcome, written, detail, seconds))


def told(
    outcome: Outcome,
    written: Sequence[str] | None = None,
    detail: Detail = USUAL,
    seconds: Mapping[str, float] | None = None,
) -> Iterator[Line]:
    """What is told of a result, at most thirty lines whatever its size unless more is asked for.

    Args:
        outcome: The result.
        written: Names of the files where it was written; None: nothing is said of files.
        detail: How much is told.
        seconds: Time of each part of the work, told with "verbose".

    Raises:
        InputError: No table is called as one that is to be shown.
    """
    head, is_long, start = outcome.head, detail.amount == "verbose", time.perf_counter()
    files = [] if written is None else [(f"Written: {', '.join(written) or NOTHING}", "")]
    if detail.amount == "quiet":
        yield _text(outcome, head.verdict.text), head.verdict.level
        yield from files if written else ()
        return
    verdict = _wrapped(outcome, head.verdict.text, head.verdict.level)
    begin = [*_wrapped(outcome, f"{head.title}: {head.verdict.detail}"), *verdict]
    cards = list(_cards(outcome))
    room = None if is_long else detail.lines - len(begin) - len(cards) - len(files) - 1
    accused, others = _findings(outcome, room)
    yield from (*begin, *accused, *cards, *others)
    if is_long:
        yield from _facts(outcome, () if not seconds else ("seconds",))
        yield from _worst(outcome, {_named(outcome.known, name) for name in detail.shown})
    for name in detail.shown:
        yield from _table(outcome, name)
    if is_long and seconds:
        seconds = {**seconds, "summary": seconds.get("summary", 0.0) + time.perf_counter() - start}
        parts = ", ".join(f"{name} {value:.2f}" for name, value in seconds.items())
        yield f"Seconds: {parts}; {sum(seconds.values()):.2f} in all", ""
    yield from files


def listing(outcome: Outcome) -> str:
    """All that a page has, as text: every finding, fact and table."""
    given = Outcome(outcome.head, outcome.names, outcome.units, (), lambda _: [])
    lines = wrapped(line for line, _ in told(given, detail=VERBOSE))
    writer = Writer(outcome.names, outcome.units)
    tables = ("\n".join(writer.lines(table)) for table in outcome.tables(()))
    return printable("\n\n".join(["\n".join(lines), *tables]) + "\n")


def brief(outcome: Outcome) -> list[Line]:
    """Verdict and figures, for a prompt that shows a result."""
    verdict = outcome.head.verdict
    return [(_text(outcome, verdict.detail), ""), (_text(outcome, verdict.text), verdict.level)] + [
        (line.strip(), level) for line, level in _cards(outcome)
    ]


def check_shown(outcome_tables: Collection[str], names: Collection[str]) -> None:
    """Refuses names of tables that results of a kind never have.

    Raises:
        InputError: There is such a name.
    """
    for name in names:
        if _named(outcome_tables, name) is None:
            known = ", ".join(("residuals", *outcome_tables))
            raise InputError(f"--show {name}: there is no such table; there are {known}")


def _named(known: Collection[str], name: str) -> str | None:
    """The table that is called so."""
    names = RESIDUALS if name == "residuals" else (name,)
    return next((one for one in names if one in known), None)


def _text(outcome: Outcome, sentence: str) -> str:
    """A sentence of the page in letters that every terminal has."""
    text = plain(sentence, outcome.units)
    for sign, letters in SIGNS.items():
        text = text.replace(sign, letters)
    return printable(text)


def _wrapped(
    outcome: Outcome,
    sentence: str,
    level: str = "",
    indent: str = "",
    most: int | None = None,
    whole: str = "",
) -> list[Line]:
    """The sentence in lines; what is whole, such as a command, stays in one."""
    lines = textwrap.wrap(
        _text(outcome, sentence).replace(whole, whole.replace(" ", WHOLE)),
        WIDTH,
        initial_indent=indent,
        subsequent_indent=f"{indent}  ",
        break_long_words=False,
        break_on_hyphens=False,
        max_lines=most,
        placeholder=" ...",
    )
    return [(line.replace(WHOLE, " "), level if level in ("bad", "warn", "ok") else "") for line in lines]


def _cards(outcome: Outcome) -> Iterator[Line]:
    """Figures beside what they are compared with."""
    found = outcome.head.cards
    rows = [[_text(outcome, part) for part in _parts(card)] for card in found]
    widths = [max(len(row[k]) for row in rows) for k in range(4)] if rows else []
    for card, (label, value, expected, tag, note) in zip(found, rows, strict=True):
        level = card.tag[0] if card.tag and card.tag[0] in ("bad", "warn") else ""
        first = f"  {label:<{widths[0]}}  {value:>{widths[1]}}"
        yield f"{first}  {expected:<{widths[2]}}  {tag:<{widths[3]}}  {note}".rstrip(), level


def _parts(card: Card) -> tuple[str, ...]:
    expected = card.unit
    if card.figure and card.figure["kind"] == "gauge" and card.unit == "expected 1":
        expected = f"expected {card.figure['lower']:.2f} to {card.figure['upper']:.2f}"
    return card.label, card.value, expected, "" if card.tag is None else card.tag[1], card.note


def _findings(outcome: Outcome, room: int | None) -> tuple[list[Line], list[Line]]:
    """Suspected errors, then what else is found, in at most so many lines; and how many have no room."""
    parts: tuple[list[Line], list[Line]] = [], []
    left = 0
    for part in outcome.head.lists:
        lines = parts[part.title != "Suspected errors"]
        head = [(f"{part.title} ({len(part.items)}):", "")]
        for step, group in groupby(sorted(part.items, key=lambda item: RANK[item.level]), attrgetter("step")):
            items = list(group)
            copies = "; ".join(dict.fromkeys(item.copy for item in items if item.copy))
            told = f"Next: {step} {copies}".rstrip()
            end = _wrapped(outcome, told, "", "    ", whole=copies) if step else []
            for k, item in enumerate(items):
                block = [*head, *_finding(outcome, item, BRIEF if room is not None else None)]
                if room is not None and (left or len(block) + len(end) > room):
                    left += len(items) - k
                    break
                lines += block
                room, head = None if room is None else room - len(block), []
            if not head and lines and not lines[-1][0].startswith("    Next"):
                lines += end
                room = None if room is None else room - len(end)
    if left:
        parts[1].append((f"and {left} more (-v tells all)", ""))
    return parts


def _finding(outcome: Outcome, item: Finding, most: int | None) -> list[Line]:
    size = f" ({item.size})" if item.size else ""
    place = f" {item.where}" if item.where else ""
    return _wrapped(outcome, f"{item.title}{place}{size}: {item.text}", item.level, "  ", most)


def _facts(outcome: Outcome, but: Collection[str]) -> Iterator[Line]:
    """How the iterations went, what the result was made from, but for some."""
    for section in outcome.head.sections:
        for chart in section.charts:
            if chart["kind"] == "convergence":
                steps = chart["iterations"]
                half = MOST_ITERATIONS // 2
                kept = range(len(steps))
                for k in kept:
                    if k < half or k >= len(steps) - half - 1:
                        sigma0, step = significant(steps[k]["sigma0"]), significant(steps[k]["step"])
                        yield f"  iteration {k + 1}: sigma0 {sigma0} at its start, largest step {step}", ""
                    elif k == half:
                        yield f"  ... {len(steps) - 2 * half - 1} more iterations", ""
        for name, text in section.facts:
            if name not in but:
                yield from _wrapped(outcome, f"{name}: {text}", "", "  ")


def _worst(outcome: Outcome, others: Collection[str | None]) -> Iterator[Line]:
    """The first rows of the tables that have an order, but for those that are told whole."""
    for table in outcome.worst() if outcome.worst else outcome.tables(()):
        if table.get("order") and table["id"] not in {"points", *others}:
            yield from _lines(outcome, table, worst(table, table["order"])[:WORST])


def _table(outcome: Outcome, name: str) -> Iterator[Line]:
    """A table that is asked for, the worst first; points as they were read."""
    check_shown(outcome.known, [name])
    wanted = _named(outcome.known, name) or name
    found = [table for table in outcome.tables([wanted]) if table["id"] == wanted]
    if not found:
        yield NONE.get(name, f"(There are no {name} here.)"), ""
    for table in found:
        order = table.get("order")
        rows = worst(table, order) if order and table.get("rows") != "point" else ordered(table)
        yield from _lines(outcome, table, rows)


def _lines(outcome: Outcome, table: Table, rows: Sequence[int]) -> Iterator[Line]:
    """Rows of the columns that the page shows unless all are asked for."""
    writer = Writer(outcome.names, outcome.units)
    keys = [item["key"] for item in table["columns"] if not item.get("rare")]
    yield "", ""
    yield from ((printable(line), "") for line in writer.lines(table, rows, keys))
    yield "", ""
