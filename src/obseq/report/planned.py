"""The page of a plan: how well every point will be known, what stays unseen, what more would bring."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import replace

from obseq.arguments import expecting, instance
from obseq.records.plan import DrawsRecord, PlanRecord
from obseq.report import adjusted, findings
from obseq.report.head import (
    Card,
    Finding,
    Findings,
    Head,
    Page,
    Place,
    Verdict,
    counted,
    page_of,
    share,
    strip,
)
from obseq.report.page import adjustment_page, document
from obseq.report.said import bearing, name, small
from obseq.report.summary import Outcome
from obseq.report.tables.columns import Table
from obseq.report.tables.content import TABLES, numbers_of
from obseq.report.tables.content_plan import PLAN_TABLES, plan_tables
from obseq.report.tables.named import short_names

MOST = 3
DATUM = 0.5
"""Share of the variance of a point below which sights do not limit it: most comes from the datum."""


@expecting(record=instance(PlanRecord))
def outcome(record: PlanRecord) -> Outcome:
    """A plan as reports tell it."""
    base = adjusted.outcome(record.adjustment)
    rows = numbers_of(record.adjustment)

    def made(names: Collection[str]) -> list[Table]:
        return [*plan_tables(record, rows, names), *base.tables(names or TABLES)]

    return replace(
        base, head=_head(record, base.head), known=(*PLAN_TABLES, *base.known), tables=made, worst=None
    )


def plan_page(record: PlanRecord) -> str:
    """The report of a plan as an HTML document that loads nothing."""
    return document(shown(record))


def shown(record: PlanRecord) -> Page:
    """All that the page of a plan shows."""
    base = adjustment_page(record.adjustment)
    more = plan_tables(record, numbers_of(record.adjustment))
    return page_of(_head(record, base), base.names, base.plan, [*base.tables[:1], *more, *base.tables[1:]])


def _head(record: PlanRecord, base: Head) -> Head:
    """What the page of the planned adjustment begins with, and what the plan has beside it."""
    rows = numbers_of(record.adjustment)
    kept = tuple(card for card in base.cards if card.label in ("redundancy", "unchecked"))
    found = Findings("Look at first", tuple(_findings(record, rows)))
    return Head(
        "plan",
        record.adjustment.title or "Plan",
        base.about.replace("Adjustment", "Plan", 1),
        base.run,
        base.units,
        _verdict(record),
        (*_weakest(record, rows), *kept, *_best(record), *_drawn(record)),
        tuple(part for part in (found, *(_others(part) for part in base.lists[-1:])) if part.items),
        base.sections,
    )


def _others(part: Findings) -> Findings:
    """What is worth knowing of the planned adjustment, without what the plan says of its own."""
    own = ("weakly checked", "weakest point")
    return Findings("Worth knowing", tuple(item for item in part.items if not item.title.endswith(own)))


def _verdict(record: PlanRecord) -> Verdict:
    planned = record.adjustment
    detail = adjusted.verdict(planned).detail
    if planned.left_out:
        what = counted(len(planned.left_out), "point or station", "points and stations")
        return Verdict("warn", f"The plan does not determine {what}.", detail)
    if is_known(record):
        return Verdict("warn", "Every point is known already: the plan determines nothing.", detail)
    if record.draws is not None and not record.draws.agrees:
        return Verdict("bad", "Adjustments of drawn errors do not agree with the prediction.", detail)
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
        step = "known points that are better, or that lie around it; more sights bring little."
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
    yield from _of_draws(record.draws)


def _of_draws(draws: DrawsRecord | None) -> Iterator[Finding]:
    """What adjustments of drawn observations say of the prediction."""
    if draws is None:
        return
    verdict = "agree with the prediction" if draws.agrees else "DO NOT AGREE with the prediction"
    ratio = f"Squared errors are {draws.ratio:.4f} of the predicted ones, 1 is expected"
    chance = f"{draws.worst_ratio:.4f}, by chance {draws.p_value:.3g} among all points"
    sigma0 = "" if draws.sigma0 is None else f" sigma0 is {draws.sigma0:.4f}, 1 is expected."
    failed = f" {draws.failed} did not converge and do not count." if draws.failed else ""
    yield Finding(
        "info" if draws.agrees else "bad",
        f"{draws.draws} adjustments of drawn observations {verdict}",
        f"{ratio}; worst point {name(draws.worst_point)}: {chance}.{sigma0}{failed}",
    )


def limited(record: PlanRecord) -> tuple[str, float, float] | None:
    """The weakest point that the datum and not the sights limits: name, precision, that of the sights alone.

    Precisions with inner constraints are those of the sights. The datum limits a point where more than half
    of its variance is not theirs; None where it does not limit the weakest one, or where one more sight
    takes that half away.
    """
    if any(gain.after**2 < DATUM * gain.before**2 for gain in record.gains):
        return None
    names = {item.point for item in record.weakest_points[:1]}
    for point in record.adjustment.points:
        if point.name in names and point.inner:
            whole = math.hypot(*(value or 0.0 for value in (point.sx, point.sy, point.sz)))
            own = math.hypot(*point.inner)
            return (point.name, whole, own) if own**2 < DATUM * whole**2 else None
    return None


def is_known(record: PlanRecord) -> bool:
    """Whether every point is known already, so that the plan determines nothing."""
    return all((point.known or "").lower() == "xyz" for point in record.adjustment.points)
