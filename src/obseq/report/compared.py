"""The page of a comparison: what has moved, all points judged together, and how sure that is."""

from __future__ import annotations

from collections.abc import Iterator

from obseq.arguments import expecting, instance
from obseq.printable import listed
from obseq.records.comparison import ComparisonRecord
from obseq.report.head import (
    WORDS,
    Card,
    Finding,
    Findings,
    Head,
    Level,
    Page,
    Place,
    Section,
    Verdict,
    about,
    counted,
    gauge,
    joined,
    page_of,
    printed,
    strip,
)
from obseq.report.page import document
from obseq.report.said import name, small
from obseq.report.summary import Outcome
from obseq.report.tables.columns import Table, all_rounded
from obseq.report.tables.content_comparison import displacements
from obseq.report.tables.units import Plain, Units
from obseq.report.writer import Writer

MOST_NAMES = 8
KNOWN_POINTS = "known points"
DATUMS = {KNOWN_POINTS: "the known points that have stayed, by what the observations alone say"}
KNOWN = 1


@expecting(record=instance(ComparisonRecord))
def outcome(record: ComparisonRecord) -> Outcome:
    """A comparison as reports tell it."""
    return Outcome(
        _head(record),
        printed(row.point for row in record.displacements),
        Units(record.units),
        ("displacements",),
        lambda names: _tables(record) if not names or "displacements" in names else [],
    )


def comparison_page(record: ComparisonRecord) -> str:
    """The report of a comparison as an HTML document that loads nothing."""
    return document(shown(record))


def shown(record: ComparisonRecord) -> Page:
    """All that the page of a comparison shows; no displacements where there is no verdict."""
    names = printed(row.point for row in record.displacements)
    has_plan = not record.obstacles and names
    return page_of(_head(record), names, _plan(record) if has_plan else None, _tables(record))


def comparison_csv(record: ComparisonRecord) -> str:
    """The displacements as CSV, as the page writes them; no verdict where there are obstacles."""
    names = printed(row.point for row in record.displacements)
    return Writer(names, Units(record.units)).csv(displacements(record))


def _tables(record: ComparisonRecord) -> list[Table]:
    return [displacements(record)] if record.displacements and not record.obstacles else []


def _head(record: ComparisonRecord) -> Head:
    rows = {item.point: k for k, item in enumerate(record.displacements)}
    return Head(
        "comparison",
        "Two epochs",
        about("Comparison", record.runs[1]),
        record.runs[1].identifier,
        {"length": record.units.length, "angle": record.units.angle},
        _verdict(record),
        () if record.obstacles else tuple(_cards(record, rows)),
        tuple(part for part in _lists(record, rows) if part.items),
        (Section("provenance", "Provenance", facts=tuple(_facts(record)), words=WORDS),),
    )


def _verdict(record: ComparisonRecord) -> Verdict:
    detail = joined(
        [
            f"{counted(len(record.displacements), 'common point')}",
            f"datum: {DATUMS.get(record.datum, record.datum)}",
            f"level {100 * record.level:g} %",
            "given sigmas trusted" if record.sigma0 is None else "",
        ]
    )
    if record.obstacles:
        return Verdict("bad", f"No verdict on movements: {name(record.obstacles[0])}.", detail)
    told = [f"{text}." for text in movements(record)]
    if record.moved:
        kind = "Known" if record.datum == KNOWN_POINTS else "Reference"
        told.insert(0, f"{kind} points have moved: {name(listed(record.moved, MOST_NAMES))}.")
    if record.undecided:
        names = name(listed(record.undecided, MOST_NAMES))
        told.insert(0, f"One or more of {names} moved, and nothing tells which.")
    has_moved = bool(
        record.moved or record.undecided or any(row.is_significant for row in record.displacements)
    )
    if not has_moved and not record.congruence.passed:
        return Verdict("warn", "The points together have moved, and no single one is clear.", detail)
    if record.incomplete:
        told.append(f"Incomplete: {' and '.join(f'epoch {number}' for number in record.incomplete)}.")
    is_sound = not has_moved and not record.incomplete
    return Verdict("ok" if is_sound else "warn", " ".join(told), detail)


def movements(record: ComparisonRecord) -> Iterator[str]:
    """What has moved, all points judged together; and what only its own test tells."""
    tested = sum(row.overall is not None for row in record.displacements)
    moved = [row for row in record.displacements if row.is_significant]
    marginal = [row.point for row in record.displacements if row.is_marginal]
    if len(moved) == 1:
        yield f"{name(moved[0].point)} has moved by {small(moved[0].length)}"
    elif moved:
        names = listed([row.point for row in moved], MOST_NAMES)
        yield f"{len(moved)} of {tested} points have moved: {name(names)}"
    else:
        yield f"None of {tested} points has moved significantly"
    if marginal:
        expected = f"{record.level * tested:.1f} of {tested} are by chance"
        yield f"Just above the limit of its own test: {name(listed(marginal, MOST_NAMES))} ({expected})"


def _cards(record: ComparisonRecord, rows: dict[str, int]) -> Iterator[Card]:
    found = record.displacements
    if found:
        largest = max(found, key=lambda row: row.length)
        yield Card(
            "largest displacement",
            small(largest.length),
            "",
            None,
            strip(row.length for row in found),
            name(largest.point),
            Place(point=rows[largest.point]),
        )
    tested = [row for row in found if row.test and row.overall is not None]
    if tested:
        worst = min(tested, key=lambda row: row.overall or 0.0)
        ratios = [(row.test.statistic / row.test.limit) if row.test else None for row in tested]
        moved = sum(row.is_significant for row in tested)
        tag = ("warn", f"{moved} moved") if moved else ("ok", "none moved")
        yield Card(
            "probability by chance",
            f"{worst.overall:.2g}",
            "over all points",
            tag,
            strip(ratios, 1.0),
            f"{name(worst.point)}; ticks: test over its limit",
            Place(point=rows[worst.point]),
        )
    test = record.congruence
    yield Card(
        "all points together",
        f"{test.statistic:.2f}",
        f"limit {test.limit:.2f}",
        ("ok", "stayed") if test.passed else ("warn", "moved"),
        gauge(max(test.statistic, 1e-6), 1e-3, test.limit, "warn"),
        f"{test.freedom} degrees of freedom",
    )
    if record.sigma0 is not None:
        yield Card(
            "sigma0 of both", f"{record.sigma0:.3f}", "expected 1", note=f"redundancy {record.redundancy}"
        )


def _lists(record: ComparisonRecord, rows: dict[str, int]) -> Iterator[Findings]:
    if record.obstacles:
        yield Findings(
            "No verdict", tuple(Finding("bad", "Mend this first", name(text)) for text in record.obstacles)
        )
        return
    moved = [row for row in record.displacements if row.is_significant]
    yield Findings("Moved", tuple(_moved(record, row.point, rows) for row in moved))
    marginal = tuple(
        _moved(record, row.point, rows, "info") for row in record.displacements if row.is_marginal
    )
    yield Findings("Just above the limit of their own test", marginal)
    told = [Finding("warn", "What weakens the verdict", name(text)) for text in record.reservations]
    test = record.same_precision
    if test is not None and not test.passed:
        text = f"Ratio of their variance factors {test.statistic:.3f}, limit {test.limit:.3f}."
        told.append(Finding("warn", "The epochs differ in precision", text))
    for which, names in (("first", record.only_first), ("second", record.only_second)):
        if names:
            told.append(Finding("info", f"Only in the {which} epoch", name(", ".join(names))))
    yield Findings("Worth knowing", tuple(told))


def _moved(record: ComparisonRecord, point: str, rows: dict[str, int], level: Level = "bad") -> Finding:
    row = record.displacements[rows[point]]
    spreads = (row.s_east, row.s_north, row.s_up)
    spread = ", ".join(small(one) for one in spreads if one is not None)
    up = "" if row.up is None else f", up {small(row.up)}"
    moved = f"East {small(row.east)}, north {small(row.north)}{up}"
    text = f"{moved}; standard deviations {spread}."
    chance = "" if row.overall is None else f"by chance {row.overall:.2g} over all points"
    return Finding(level, name(point), text, small(row.length), chance, to=Place(point=rows[point]))


def _plan(record: ComparisonRecord) -> Plain:
    found = record.displacements
    return {
        "x": all_rounded([row.x for row in found]),
        "y": all_rounded([row.y for row in found]),
        "marks": [KNOWN if row.is_reference or row.test is None else 0 for row in found],
        "major": [row.ellipse.semi_major for row in found],
        "minor": [row.ellipse.semi_minor for row in found],
        "bearing": [row.ellipse.bearing for row in found],
        "moved": [[row.east, row.north] for row in found],
        "isMoved": True,
        "scheme": False,
        "unplaced": [],
        "rays": [],
        "loose": [],
        "known": "held or reference point",
        "ellipses": f"ellipse {100 * (1 - record.level):g} % of the displacement",
        "displacements": "displacement, second epoch minus first",
    }


def _facts(record: ComparisonRecord) -> Iterator[tuple[str, str]]:
    yield "frame", name(record.frame)
    yield "datum", name(record.datum)
    for which, run in zip(("first", "second"), record.runs, strict=True):
        versions = ", ".join(f"{package} {version}" for package, version in run.versions.items())
        yield f"{which} epoch", name(f"run {run.identifier}, {run.created}; {versions}")
    test = record.same_precision
    if test is not None:
        ratio = f"ratio of variance factors {test.statistic:.3f}, limit {test.limit:.3f}"
        yield "precision of the epochs", f"{ratio}: {'alike' if test.passed else 'they differ'}"
