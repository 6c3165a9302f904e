"""What there is to look at in an adjustment: suspected errors, and what is worth knowing, the worst first."""

from __future__ import annotations

import math
from heapq import nlargest
from typing import TYPE_CHECKING

from msgspec import structs

from obseq.printable import listed
from obseq.report.head import Finding, Findings, Place, counted
from obseq.report.said import length, name, observed, small
from obseq.report.tables.named import ellipse_level, short_names, unit_of
from obseq.report.verdict import LEAST
from obseq.report.verdict import Verdict as Test

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from obseq.arrays import BoolArray
    from obseq.records.adjustment import AccusedRecord, AdjustmentRecord, ObservationRecord, PointRecord
    from obseq.records.diagnosis import DiagnosisRecord
    from obseq.records.quality import JointTestRecord
    from obseq.records.rows import Rows
    from obseq.report.head import Level

POOR = 0.1
"""Redundancy below which an observation is hardly checked: most of an error goes into the result."""
MOST_BEYOND = 3
MOST_NAMES = 8
NOT_JUDGED = "Adjusted, but not everything could be judged."
"""The verdict where what should explain a result has failed."""
BOOK = "see the field book"


def sight(row: ObservationRecord) -> str:
    """What an observation is called."""
    return name(f"{row.type} {row.origin} \u2192 {row.target}")


def weakest(record: AdjustmentRecord) -> tuple[int, float] | None:
    """The point known worst, and how well it is known (m); None where no precision is known.

    Known points that nothing observes say nothing of the network.
    """
    apart = is_known(record, is_observed=False).tolist()
    sizes = [(found, k) for k, found in enumerate(spreads(record.points)) if found > 0.0 and not apart[k]]
    return max(sizes)[::-1] if sizes else None


def spreads(points: Rows[PointRecord]) -> list[float]:
    """How well points are known (m): longer semi-axes of ellipses, or sigmas of heights; NaN: unknown."""
    import numpy as np

    sx, sy, sz = (points.numbers(f"s{axis}") for axis in "xyz")
    is_levelled = [of_height(*pair) for pair in zip(sx.tolist(), points.values("known"), strict=True)]
    alone = np.where(is_levelled, sz, np.fmax(sx, sy))
    major = points.numbers("ellipse.semi_major")
    found: list[float] = np.where(major > 0.0, major, alone).tolist()
    return found


def of_height(sx: float | None, known: str | None) -> bool:
    """Whether the height alone of a point is estimated: its plan is not there, or is held."""
    return sx is None or sx != sx or (known or "").startswith("XY")


def is_known(record: AdjustmentRecord, is_observed: bool = True) -> BoolArray:
    """(n,) the points that have no unknown coordinate, and that something observes, or that nothing does."""
    import numpy as np

    rows = record.observations
    used = rows.truths("active")
    ends = {name for end in ("from", "to", "backsight") for name in rows.distinct(end, used)}
    is_all = used.sum() == record.n_observations  # else images observe points too
    named = np.array([not is_all or name in ends for name in record.points.values("name")], bool)
    there = sum(np.isfinite(record.points.numbers(axis)).astype(int) for axis in "xyz")
    known = np.array([len(letters or "") for letters in record.points.values("known")], int)
    return np.asarray((known > 0) & (known >= there) & (named == is_observed))


def findings(record: AdjustmentRecord, rows: Mapping[str, int]) -> tuple[Findings, ...]:
    """Suspected errors, and what is worth knowing."""
    accused = (*_outside(record), *(_accused(record, item) for item in record.gross_errors))
    others = (
        *searched(record.diagnosis, record.failures),
        *_sigma0(record),
        *_types(record),
        *_snooped(record),
        *_lost(record),
        *_vectors(record),
        *_beyond(record),
        *_weak(record),
        *_worst(record, rows),
        *_replaced(record),
        *_said(record),
    )
    title = "Worth knowing" if accused else "Look at first"
    lists = (Findings("Suspected errors", accused), Findings(title, others))
    return shortened(lists, record.files or record.observations.distinct("file"))


def shortened(lists: Iterable[Findings], files: Iterable[str]) -> tuple[Findings, ...]:
    """What there is of findings, in which files have the names of the tables, without their folders."""
    short = short_names(files)
    longest = sorted((file for file in short if short[file] != file), key=len, reverse=True)

    def told(text: str) -> str:
        for file in longest:
            text = text.replace(name(file), name(short[file]))
        return text

    def brief(item: Finding) -> Finding:
        return structs.replace(item, title=told(item.title), text=told(item.text), where=told(item.where))

    return tuple(Findings(part.title, tuple(map(brief, part.items))) for part in lists if part.items)


def suspected(item: AccusedRecord, what: str, size: str, where: str, look: str, to: Place | None) -> Finding:
    """An error: what it is called, how large it is, where it was read, where to look, and where it is."""
    text = item.text.removeprefix(item.what).lstrip(": ").removeprefix("is ")
    text = text[:1].upper() + text[1:]
    step = f"{look}, correct it, adjust again. What this means:"
    return Finding("bad", what, name(text), size, where, step, f"obseq causes {item.code}", to)


def _where(row: ObservationRecord | JointTestRecord) -> str:
    """File and line of an observation; nothing where it was in no file."""
    return f"{name(row.file)}:{row.line}" if row.file else ""


def searched(found: DiagnosisRecord | None, failures: Sequence[str]) -> Iterator[Finding]:
    """What could not be judged, what the search for errors says of itself, and effects that are no errors."""
    for text in failures:
        yield Finding("warn", "Not judged", name(text))
    if found is None:
        return
    if found.status == "undecided" or found.reason:
        is_wrong = found.status == "unexplained" or (found.status == "undecided" and not failures)
        level: Level = "bad" if is_wrong else "info"
        yield Finding(level, f"Search for errors: {found.status}", name(found.reason))
    for item in found.remarks:
        text = item.text.removeprefix(item.what).lstrip(": ")
        yield Finding("info", name(item.what), name(f"{text}. No error: it is not beyond a sigma of each."))


def _outside(record: AdjustmentRecord) -> Iterator[Finding]:
    """The system of the points, before what is suspected in it."""
    if record.outside:
        step = "give the system that the points are in (--points-crs), adjust again; then look at the others."
        yield Finding("bad", "Suspected first: the system of the points", name(record.outside), step=step)


def _accused(record: AdjustmentRecord, item: AccusedRecord) -> Finding:
    rows = [place.row for place in item.observations]
    to = Place("observations", row=rows[0]) if rows else None
    sigma = item.sigma[0] if item.sigma else 0.0
    off = abs(item.size[0]) / sigma if item.size and sigma else item.test**0.5
    size = (
        f"off by {off:.{0 if off >= 10 else 1}f} \u03c3" if off else ""
    )  # of many values nothing is estimated
    if len(rows) != 1:
        return suspected(item, name(item.what), size, "", BOOK, to)
    one = record.observations[rows[0]]
    found = suspected(item, sight(one), size, _where(one), BOOK, to)
    return structs.replace(found, text=f"{_both_values(item, one)}{found.text}")


def _both_values(item: AccusedRecord, one: ObservationRecord) -> str:
    """What was observed, and what the others give for it; nothing where the error has another unit."""
    unit = unit_of(one)
    if len(item.size) != 1 or item.unit != unit:
        return ""
    right = one.value - item.size[0]
    right = right % math.tau if unit == "rad" and one.value >= 0.0 else right
    return f"Observed {observed(one.value, unit)}; the others give {observed(right, unit)}. "


def _sigma0(record: AdjustmentRecord) -> Iterator[Finding]:
    """What sigma0 says where it is not as expected."""
    test, text = record.global_test, Test(record).explanation
    if test is not None and text:
        size = "large" if test.sigma0 > test.upper else "small"
        yield Finding("warn", f"sigma0 is too {size}", name(text), f"{test.sigma0:.3g}")


def _snooped(record: AdjustmentRecord) -> Iterator[Finding]:
    """What data snooping left out, why it ended, and what that changed."""
    snooping = record.snooping
    if snooping is None:
        return
    moved = ""
    if snooping.moved is not None and snooping.most_moved:
        moved = f" This moved {name(snooping.most_moved)} most, by {small(snooping.moved)}."
    left = f"{len(snooping.rejections)} left out; {name(snooping.end)}."
    level = f"overall level {100 * snooping.level:g} %"
    yield Finding("info", f"Data snooping with {snooping.statistic}, {level}", left + moved)
    for item in snooping.rejections:
        row = record.observations[item.row]
        test = f"{snooping.statistic} {item.statistic:.2f}"
        if item.degrees > 1:
            test = f"T of its vector {item.statistic:.2f}, limit {item.critical or 0.0:.2f}"
        least = "" if item.detectable is None else f", detectable from {small(item.detectable, unit_of(row))}"
        whole = " Its whole vector is left out." if item.companions else ""
        text = f"Left out: off by about {small(item.blunder, unit_of(row))}{least}.{whole}"
        to = Place("observations", row=item.row)
        yield Finding("warn", name(item.observation), text, test, to=to)
    if snooping.suspects:
        names = listed(snooping.suspects, MOST_NAMES)
        yield Finding("warn", "Not left out, but suspected", f"{name(names)}.")


def _vectors(record: AdjustmentRecord) -> Iterator[Finding]:
    """The vectors and positions whose test as a whole fails, the worst first."""
    beyond = [item for item in record.joint if item.is_beyond]
    beyond.sort(key=lambda item: -item.statistic / item.critical)
    for item in () if record.gross_errors else beyond[:MOST_BEYOND]:
        limit = f"limit {item.critical:.2f} with {item.degrees} degrees of freedom"
        share = f"{len(beyond)} of {len(record.joint)} are"
        text = f"As a whole it is off, {limit}; {share}."
        where = _where(item)
        to = Place("observations", row=item.rows[0]) if item.rows else None
        yield Finding("warn", name(item.what), text, f"T {item.statistic:.1f}", where, to=to)


def _types(record: AdjustmentRecord) -> Iterator[Finding]:
    for row in Test(record).types_beyond:
        factor = max(row.sigma_factor or 0.0, LEAST)
        expected = f"{row.lower:.2f} to {row.upper:.2f} is expected"
        text = f"Residuals of {row.count} are {factor:.3g} of what their sigmas announce; {expected}."
        step = f"multiply these sigmas by {factor:.2g}, or let them be estimated:"
        yield Finding(
            "warn",
            f"Sigmas of {name(row.name)}",
            text,
            f"\u00d7 {factor:.3g}",
            "",
            step,
            "--variance-components",
        )


def _lost(record: AdjustmentRecord) -> Iterator[Finding]:
    reasons: dict[str, list[str]] = {}
    for item in record.left_out:
        reasons.setdefault(item.reason, []).append(item.what)
    for reason, names in reasons.items():
        title = f"{names[0]} is left out" if len(names) == 1 else f"{len(names)} points left out"
        text = reason if len(names) == 1 else f"{listed(names, MOST_NAMES)}: {reason}"
        yield Finding("warn", name(title), name(text), step="one more observation to each.")
    for unused in record.unused:
        yield Finding(
            "warn",
            "Observations without part",
            name(f"Because {unused.reason}: {listed(unused.observations, MOST_NAMES)}."),
        )
    for doubtful in record.doubtful:
        sight_ = f"its nearest sight is {length(doubtful.sight)} long"
        text = f"Its {doubtful.axis} is known to {small(doubtful.sigma)} only; {sight_}."
        yield Finding("warn", name(f"{doubtful.name} is doubtful"), text)


def _beyond(record: AdjustmentRecord) -> Iterator[Finding]:
    """The largest tests that fail, where no error is suspected."""
    level = record.reliability
    if level is None or record.gross_errors:
        return
    parts = {row for item in record.joint for row in item.rows}  # tested as a whole
    tests = record.observations.numbers("standardised_residual").tolist()
    found = ((abs(value), k) for k, value in enumerate(tests) if value == value and k not in parts)
    for size, k in nlargest(MOST_BEYOND, found):
        row = record.observations[k]
        if size > level.critical and row.residual is not None:
            chance = f"limit {level.critical:.2f}, passed by chance once in {1 / level.level:.0f}"
            text = f"Residual {small(row.residual, unit_of(row))}; {chance}."
            yield Finding(
                "warn",
                sight(row),
                text,
                f"w {row.standardised_residual:.2f}",
                _where(row),
                to=Place("observations", row=k),
            )


def _weak(record: AdjustmentRecord) -> Iterator[Finding]:
    level = record.reliability
    shares = record.observations.numbers("redundancy")
    poor = (record.observations.truths("active") & (shares < POOR)).nonzero()[0].tolist()
    if level is None or not poor:
        return
    first = min(poor, key=shares.__getitem__)
    row = record.observations[first]
    to = Place("observations", row=first)
    if level.uncontrolled:
        text = f"Nothing checks them: an error there stays unseen. First: {sight(row)}."
        yield Finding(
            "warn",
            counted(level.uncontrolled, "equation is unchecked", "equations are unchecked"),
            text,
            step="measure these points from a second station, or accept the risk.",
            to=to,
        )
    elif row.detectable is not None:
        text = f"{sight(row)}: an error below {small(row.detectable, unit_of(row))} stays unseen."
        yield Finding(
            "info",
            counted(len(poor), "observation is weakly checked", "observations are weakly checked"),
            text,
            f"r {row.redundancy:.2f}",
            to=to,
        )


def _worst(record: AdjustmentRecord, rows: Mapping[str, int]) -> Iterator[Finding]:
    found = weakest(record)
    if found is None:
        return
    point = record.points[found[0]]
    if point.ellipse:
        axes = f"{small(point.ellipse.semi_major)} by {small(point.ellipse.semi_minor)}"
        size = f"Ellipse {axes} ({ellipse_level(record)})"
    else:
        what = " of its height" if of_height(point.sx, point.known) else ""
        size = f"Standard deviation{what} {small(found[1])}"
    height = f", height {small(point.sz)}" if point.sz and not of_height(point.sx, point.known) else ""
    yield Finding(
        "info",
        f"{name(point.name)} is the weakest point",
        f"{size}{height}.",
        to=Place(point=rows[point.name]),
    )


def _replaced(record: AdjustmentRecord) -> Iterator[Finding]:
    if record.replaced:
        names = listed([item.name for item in record.replaced], MOST_NAMES)
        far = max(item.moved for item in record.replaced)
        text = f"They were up to {observed(far)} from where the observations place them: {name(names)}."
        yield Finding(
            "info", f"Approximate coordinates of {counted(len(record.replaced), 'point')} replaced", text
        )


def _said(record: AdjustmentRecord) -> Iterator[Finding]:
    for text in record.warnings:
        if text not in (*record.failures, record.outside):
            yield Finding("warn", "Warning", name(text))
    for text in record.notes:
        yield Finding("info", "Note", name(text))
