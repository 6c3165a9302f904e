"""What the page of an adjustment begins with: whether it may be used, what is wrong, how good it is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from obseq.arguments import expecting, instance
from obseq.printable import listed
from obseq.records.adjustment import AdjustmentRecord, PointRecord
from obseq.records.quality import StatisticsRecord
from obseq.report.basis import basis, kinds
from obseq.report.findings import NOT_JUDGED, POOR, findings, is_known, of_height, sight, spreads, weakest
from obseq.report.head import (
    UNCHECKED,
    UNEXPLAINED,
    WORDS,
    Card,
    Head,
    Level,
    Place,
    Section,
    Verdict,
    about,
    convergence,
    counted,
    joined,
    misfit,
    redundancy_card,
    share,
    sigma0_card,
    strip,
    to_check,
)
from obseq.report.part import part_of
from obseq.report.said import name, small
from obseq.report.summary import Outcome
from obseq.report.tables.columns import Table
from obseq.report.tables.content import TABLES, numbers_of, tables
from obseq.report.tables.named import ellipse_level
from obseq.report.tables.spared import spared
from obseq.report.tables.units import significant, units_of
from obseq.report.verdict import Verdict as Test

MOST_NAMES = 8


@expecting(record=instance(AdjustmentRecord))
def outcome(record: AdjustmentRecord) -> Outcome:
    """An adjustment as reports tell it; precisions that suspected errors spoil are not among it."""
    record = spared(record)
    rows = numbers_of(record)
    made = partial(tables, record, rows)

    def some() -> list[Table]:
        return tables(part_of(record)[0], rows, TABLES.keys() - {"points"})

    return Outcome(head(record, rows), list(rows), units_of(record), tuple(TABLES), made, some)


def head(record: AdjustmentRecord, rows: Mapping[str, int]) -> Head:
    """What the page of an adjustment begins with, and its sections."""
    lists = findings(record, rows)
    return Head(
        "adjustment",
        record.title or "Survey network",
        about("Adjustment", record.run),
        "" if record.run is None else record.run.identifier,
        {"length": record.units.length, "angle": record.units.angle},
        verdict(record),
        cards(record, rows),
        lists,
        sections(record),
        None if record.reliability is None else record.reliability.critical,
        lists[0].items[0].to if record.gross_errors else None,
    )


def verdict(record: AdjustmentRecord) -> Verdict:
    """The sentence, at the level of the exit code."""
    level, text = _judged(record)
    known = int(is_known(record).sum())
    used = int(record.observations.truths("active").sum())
    off = len(record.observations) - used
    detail = joined(
        [
            counted(len(record.points), "point") + (f", {known} known" if known else ""),
            counted(used, "observation") + (f", {off} not used" if off else ""),
            f"redundancy {record.redundancy}",
            "" if record.planned else _ended(record),
        ]
    )
    return Verdict(level, text, detail)


def _ended(record: AdjustmentRecord) -> str:
    count = counted(len(record.iterations), "iteration")
    return count if record.converged else f"NOT CONVERGED after {count}"


def _judged(record: AdjustmentRecord) -> tuple[Level, str]:
    """Level and sentence of what decides: the first of these that holds."""
    test, diagnosis, count = Test(record), record.diagnosis, len(record.gross_errors)
    if not record.converged:
        return (
            "bad",
            f"Not usable: stopped after {counted(len(record.iterations), 'iteration')}, not converged.",
        )
    if count:
        if any(not item.observations for item in record.gross_errors):
            return "bad", to_check(count)
        what = "1 observation looks wrong. Check it"
        if count > 1:
            what = f"{count} observations look wrong. Check them"
        return "bad", f"Not usable yet: {what}, then adjust again."
    status = "" if diagnosis is None else diagnosis.status
    if status == "unexplained" or (status == "undecided" and not record.failures):
        return "bad", UNEXPLAINED
    for level, text in _restricted(record):
        return level, text
    if test.test is None:
        return "warn", UNCHECKED
    if test.test.sigma0 > test.test.upper:
        return "warn", misfit(test.test)
    if types := test.types_beyond:
        return "warn", f"Usable, but {_of_type(types[0])}"
    if not test.test.passed:
        return "warn", misfit(test.test)
    return "ok", "The network is sound: residuals fit the sigmas, and no error is suspected."


def _restricted(record: AdjustmentRecord) -> Iterator[tuple[Level, str]]:
    """What is not as it was given: the reasons of exit code 1 that are no errors."""
    if record.failures:
        yield "warn", NOT_JUDGED
    if record.left_out:
        what = counted(len(record.left_out), "point or station is", "points and stations are")
        yield "warn", f"Usable, but {what} not determined and left out."
    if record.rejections:
        yield (
            "warn",
            f"Usable without the {counted(len(record.rejections), 'observation')} that snooping left out.",
        )
    if record.doubtful:
        names = listed([item.name for item in record.doubtful], MOST_NAMES)
        yield "warn", f"Usable, but not for {name(names)}: the observations say next to nothing of it."
    if record.unused:
        yield "warn", "Usable, but some observations of the files take no part."


def _of_type(row: StatisticsRecord) -> str:
    factor = row.sigma_factor or 0.0
    size = "small" if factor > (row.upper or 0.0) else "large"
    return f"the sigmas of {name(row.name)} are too {size}: residuals are {factor:.2f} of what they announce."


def cards(record: AdjustmentRecord, rows: Mapping[str, int]) -> tuple[Card, ...]:
    """Sigma0, redundancy, the largest test, the weakest point, what is unchecked."""
    made = (
        _sigma0(record),
        _redundancy(record),
        _largest(record),
        _weakest(record, rows),
        _unchecked(record),
    )
    return tuple(card for card in made if card)


def _sigma0(record: AdjustmentRecord) -> Card | None:
    test = record.global_test
    if test is None:
        value = "\u2013" if record.planned or record.sigma0 is None else significant(record.sigma0, 4)
        return Card("sigma0", value, note="nothing is measured yet" if record.planned else "not tested")
    note, rest, beside = "", record.diagnosis and record.diagnosis.sigma0, ""
    if record.sigma0 is not None and (own := significant(record.sigma0, 4)) != significant(test.sigma0, 4):
        beside = f"; {own} of observations alone"
    if record.gross_errors:
        note = ("spoilt by" if rest is None else f"{rest:.3g} without") + " the suspected errors"
    return sigma0_card(test, note, beside)


def _redundancy(record: AdjustmentRecord) -> Card:
    active = record.observations.truths("active")
    parts = record.observations.numbers("redundancy")[active].tolist() if record.reliability else None
    equations = record.n_observations + record.n_constraints
    return redundancy_card(record.redundancy, equations, parts, "observations")


def _largest(record: AdjustmentRecord) -> Card | None:
    """The largest test of a single observation."""
    level = record.reliability
    found = record.observations
    tests = found.numbers("standardised_residual" if level else "normalised_residual")
    tested = [abs(value) for value in tests.tolist()]
    active = found.truths("active").tolist()
    known = [value for value, is_active in zip(tested, active, strict=True) if is_active and value == value]
    if not known or record.planned:
        return None
    largest = max(known)
    row = max(k for k, value in enumerate(tested) if value == largest and active[k])
    one = found[row]
    limit = None if level is None else level.critical
    beyond = 0 if limit is None else sum(value > limit for value in known)
    tag = (
        ("ok", "none beyond")
        if not beyond
        else ("bad" if record.gross_errors else "warn", f"{beyond} beyond")
    )
    return Card(
        "largest w" if level else "largest residual / sigma",
        f"{largest:.{1 if largest > 10 else 2}f}",
        "" if limit is None else f"limit {limit:.2f}",
        None if limit is None else tag,
        strip(known, limit),
        sight(one),
        Place("observations", row=row),
    )


def _weakest(record: AdjustmentRecord, rows: Mapping[str, int]) -> Card | None:
    found = weakest(record)
    if found is None:
        return None
    k, size = found
    note = f"{name(record.points[k].name)}, {_of_shape(record, record.points[k])}"
    return Card(
        "weakest point",
        small(size),
        "",
        None,
        strip(spreads(record.points)),
        note,
        Place(point=rows[record.points[k].name]),
    )


def _of_shape(record: AdjustmentRecord, point: PointRecord) -> str:
    if point.ellipse:
        return f"ellipse {ellipse_level(record)}"
    return f"standard deviation{' of its height' if of_height(point.sx, point.known) else ''}"


def _unchecked(record: AdjustmentRecord) -> Card | None:
    if record.reliability is None:
        return None
    active = record.observations.numbers("redundancy")[record.observations.truths("active")]
    poor = int((active < POOR).sum())
    none = min(poor, record.reliability.uncontrolled)
    weak = poor - none
    tag = ("warn", "risk") if none else ("warn", f"{weak} weak") if weak else ("ok", "all checked")
    note = f"{weak} weakly checked, below {POOR:g}" if weak else "by other observations"
    to = Place("observations", filter=f"redundancy<{POOR:g}")
    return Card("unchecked", str(none), f"of {len(active)}", tag, share(none, weak, len(active)), note, to)


def sections(record: AdjustmentRecord) -> tuple[Section, ...]:
    """Charts, and what the result was made from."""
    charts: list[dict[str, object]] = []
    residuals = record.observations.numbers("normalised_residual")
    if not record.planned and (residuals == residuals).any():
        charts = [
            {"kind": kind, "table": "observations", "column": "w"}
            for kind in ("bands", "histogram", "normal")
        ]
    if record.iterations:
        charts.append(convergence(record.iterations))
    inside = ("by-type", "by-station", "components", "undetermined")
    quality = Section("quality", "Quality", tuple(charts), tables=inside)
    return (quality, Section("provenance", "Provenance", facts=tuple(_facts(record)), words=WORDS))


def _facts(record: AdjustmentRecord) -> Iterator[tuple[str, str]]:
    yield from ((key, name(text)) for key, text in basis(record))
    yield "observations", f"{record.n_observations} ({name(kinds(record))})"
    yield "constraints", str(record.n_constraints)
    yield "unknowns", str(record.n_unknowns)
    yield "redundancy", str(record.redundancy)
    if record.global_test and record.sigma0 is not None:
        tested, own = significant(record.global_test.sigma0), significant(record.sigma0)
        if tested != own:
            yield "sigma0", f"{own}; tested with the residuals of known points: {tested}"
    if record.stop_reason:
        yield "stopped", name(record.stop_reason)
    if record.phases:
        yield "seconds", ", ".join(f"{phase.name} {phase.seconds:.2f}" for phase in record.phases)
