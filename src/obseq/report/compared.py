"""The page of a comparison: what has moved, all points judged together, and how sure that is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.report.columns import all_rounded
from obseq.report.comparison import DATUMS, movements
from obseq.report.content_comparison import displacements
from obseq.report.head import (
    WORDS,
    Card,
    Finding,
    Findings,
    Level,
    Page,
    Place,
    Section,
    Verdict,
    counted,
    gauge,
    joined,
    strip,
)
from obseq.report.page import about, document, printed
from obseq.report.said import name, small

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.records.comparison import ComparisonRecord
    from obseq.report.units import Plain

KNOWN = 1


def comparison_page(record: ComparisonRecord) -> str:
    """The report of a comparison as an HTML document that loads nothing."""
    return document(shown(record))


def shown(record: ComparisonRecord) -> Page:
    """All that the page of a comparison shows; no displacements where there is no verdict."""
    rows = {item.point: k for k, item in enumerate(record.displacements)}
    has_verdict = not record.obstacles
    return Page(
        "comparison",
        f"Two epochs of {counted(len(record.displacements), 'point')}",
        about("Comparison", record.runs[1]),
        record.runs[1].identifier,
        {"length": record.units.length, "angle": record.units.angle},
        _verdict(record),
        tuple(_cards(record, rows)) if has_verdict else (),
        tuple(part for part in _lists(record, rows) if part.items),
        printed(rows),
        _plan(record) if has_verdict and rows else None,
        [displacements(record)] if has_verdict and rows else [],
        (Section("provenance", "Provenance", facts=tuple(_facts(record)), words=WORDS),),
    )


def _verdict(record: ComparisonRecord) -> Verdict:
    detail = joined(
        [
            f"{counted(len(record.displacements), 'common point')}",
            f"datum: {DATUMS.get(record.datum, record.datum)}",
            f"level {100 * record.level:g} %",
        ]
    )
    if record.obstacles:
        return Verdict("bad", f"No verdict on movements: {name(record.obstacles[0])}.", detail)
    told = [f"{text[:1].upper()}{text[1:]}." for text in movements(record)]
    if record.moved:
        told.insert(0, f"Reference points have moved: {', '.join(record.moved)}.")
    if record.undecided:
        told.insert(0, f"One or more of {', '.join(record.undecided)} moved, and nothing tells which.")
    has_moved = bool(
        record.moved or record.undecided or any(row.is_significant for row in record.displacements)
    )
    if not has_moved and not record.congruence.passed:
        return Verdict("warn", "The points together have moved, and no single one is clear.", detail)
    return Verdict("warn" if has_moved else "ok", name(" ".join(told)), detail)


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
