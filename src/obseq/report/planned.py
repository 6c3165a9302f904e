"""The page of a plan: how well every point will be known, what stays unseen, what more would bring."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgspec import structs

from obseq.report import adjusted, findings
from obseq.report.content_plan import plan_tables
from obseq.report.head import Card, Finding, Findings, Page, Place, Verdict, counted, share, strip
from obseq.report.named import short_names
from obseq.report.page import adjustment_page, document
from obseq.report.planning import DATUM_STEP, draws_told, is_known, limited
from obseq.report.said import bearing, name, small

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.records.plan import PlanRecord

MOST = 3


def plan_page(record: PlanRecord) -> str:
    """The report of a plan as an HTML document that loads nothing."""
    return document(shown(record))


def shown(record: PlanRecord) -> Page:
    """All that the page of a plan shows."""
    base = adjustment_page(record.adjustment)
    rows = {point.name: k for k, point in enumerate(record.adjustment.points)}
    kept = tuple(card for card in base.cards if card.label in ("redundancy", "unchecked"))
    return structs.replace(
        base,
        kind="plan",
        title=record.adjustment.title or f"Plan of {len(record.adjustment.points)} points",
        about=base.about.replace("Adjustment", "Plan", 1),
        verdict=_verdict(record),
        cards=(*_weakest(record, rows), *kept, *_best(record), *_drawn(record)),
        lists=tuple(
            part
            for part in (Findings("Look at first", tuple(_findings(record, rows))), *base.lists[-1:])
            if part.items
        ),
        tables=[*base.tables[:1], *plan_tables(record, rows), *base.tables[1:]],
        limit=None,
        first=None,
    )


def _verdict(record: PlanRecord) -> Verdict:
    planned = record.adjustment
    detail = adjusted.verdict(planned).detail
    if planned.left_out:
        what = counted(len(planned.left_out), "point or station", "points and stations")
        return Verdict("warn", f"The plan does not determine {what}.", detail)
    if is_known(record):
        return Verdict("warn", "Every point is known already: the plan determines nothing.", detail)
    worst = record.weakest_points[0].sigma if record.weakest_points else None
    text = (
        "Every point will be determined"
        if worst is None
        else f"Every point will be known to {small(worst, digits=1)} or better"
    )
    if limited(record):
        text += ", limited by the known points and not by the sights"
    weak = len([item for item in record.weakest_observations if item.redundancy < findings.POOR])
    if weak:
        return Verdict("warn", f"{text}; {counted(weak, 'observation')} would be weakly checked.", detail)
    return Verdict("ok", f"{text}, and every observation will be checked.", detail)


def _weakest(record: PlanRecord, rows: dict[str, int]) -> Iterator[Card]:
    if record.weakest_points:
        worst = record.weakest_points[0]
        sizes = strip(findings.spreads(record.adjustment.points))
        note = f"{name(worst.point)}, in its weakest direction"
        yield Card("weakest point", small(worst.sigma), "", None, sizes, note, Place(point=rows[worst.point]))


def _best(record: PlanRecord) -> Iterator[Card]:
    if record.gains:
        best = record.gains[0]
        note = f"{name(f'{best.type} {best.origin} → {best.target}')} more"
        figure = strip(item.after for item in record.gains)
        yield Card(
            "best gain", small(best.after), f"of {small(best.before)}", None, figure, note, Place("gains")
        )


def _drawn(record: PlanRecord) -> Iterator[Card]:
    draws = record.draws
    if draws is not None:
        tag = ("ok", "agree") if draws.agrees else ("bad", "do not agree")
        yield Card(
            "draws",
            f"{draws.ratio:.3f}",
            "expected 1",
            tag,
            share(draws.failed, 0, draws.draws),
            f"{draws.draws} adjustments of drawn errors",
        )


def _findings(record: PlanRecord, rows: dict[str, int]) -> Iterator[Finding]:
    if (found := limited(record)) and not is_known(record):
        point, full, alone = found
        text = f"{name(point)} is known to {small(full)} in space; the sights alone leave {small(alone)}."
        step = DATUM_STEP.removeprefix("Next: ")
        yield Finding("warn", "The datum limits the precision", text, step=step, to=Place(point=rows[point]))
    for weak in record.weakest_points[:MOST]:
        size = small(weak.sigma)
        direction = f"along azimuth {bearing(weak.azimuth)}, elevation {bearing(weak.elevation)}"
        yield Finding(
            "info",
            name(f"{weak.point} is weak"),
            f"Known to {size} {direction}.",
            size,
            to=Place(point=rows[weak.point]),
        )
    observations = record.adjustment.observations
    files = short_names(observations.distinct("file"))
    places = {
        f"{row.type} {row.origin} -> {row.target} ({row.file}:{row.line})": k
        for k, row in enumerate(observations)
    }
    for item in record.weakest_observations[:MOST]:
        least = (
            "no error at all"
            if item.detectable is None
            else f"an error below {small(item.detectable, item.unit)}"
        )
        seen = "would be seen" if item.detectable is None else "stays unseen"
        effect = (
            "without limit" if item.external is None else f"up to {item.external:.1f} standard deviations"
        )
        row = places.get(item.observation)
        sighted = None if row is None else observations[row]
        yield Finding(
            "warn",
            name(item.observation) if sighted is None else findings.sight(sighted),
            f"{least[:1].upper()}{least[1:]} {seen}; it moves a coordinate {effect}.",
            f"r {item.redundancy:.2f}",
            "" if sighted is None else f"{name(files[sighted.file])}:{sighted.line}",
            step="another observation to this point.",
            to=None if row is None else Place("observations", row=row),
        )
    for gain in record.gains[:MOST]:
        whole = f"The network would be known to {small(gain.after)} instead of {small(gain.before)}"
        one = f"{name(gain.point)} to {small(gain.point_after)} instead of {small(gain.point_before)}"
        text = f"{whole}; {one}."
        yield Finding(
            "info",
            name(f"One more {gain.type} {gain.origin} → {gain.target}"),
            text,
            to=Place(point=rows[gain.point]),
        )
    for line in draws_told(record.draws):
        yield Finding("info", "Draws", name(line))
