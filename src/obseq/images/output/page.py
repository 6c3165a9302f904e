"""The page of an adjusted block: one page for networks and blocks, made of the record of the block."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.images.output.arrays import arrays_of, suspected_measures
from obseq.images.output.page_charts import cameras, frames
from obseq.images.output.page_plan import plan
from obseq.images.output.page_tables import tables
from obseq.images.output.summary import tested
from obseq.printable import listed
from obseq.report.head import (
    WORDS,
    Card,
    Finding,
    Findings,
    Page,
    Place,
    Section,
    Verdict,
    counted,
    gauge,
    joined,
    shares,
    strip,
)
from obseq.report.page import about, document, printed
from obseq.report.said import name, small
from obseq.report.units import significant

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.images.output.arrays import BlockArrays
    from obseq.images.output.block_record import BlockLeftOutRecord, BundleRecord
    from obseq.records.diagnosis import AccusedRecord
    from obseq.report.head import Level

MOST_NAMES = 8
STRONG = 0.95
"""Correlation from which two parameters of a camera are one thing."""
POOR = 0.1


def page(record: BundleRecord) -> str:
    """The report of a block as an HTML document that loads nothing."""
    return document(shown(record))


def shown(record: BundleRecord) -> Page:
    """All that the page of a block shows."""
    block = arrays_of(record)
    lists = _lists(record, block)
    return Page(
        "block",
        f"Block of {counted(len(record.images), 'image')}",
        about("Image block", record.run),
        record.run.identifier,
        {"length": "m", "angle": "gon"},
        _verdict(record),
        tuple(_cards(record, block)),
        lists,
        printed([*(point.name for point in record.points), *(image.name for image in record.images)]),
        plan(record, block),
        tables(record),
        tuple(_sections(record, block)),
        None if record.reliability is None else record.reliability.critical,
        lists[0].items[0].to if lists and lists[0].title == "Suspected errors" else None,
    )


def _verdict(record: BundleRecord) -> Verdict:
    control = sum(point.kind == "control" for point in record.points)
    detail = joined(
        [
            f"{counted(len(record.images), 'image')}, {counted(len(record.cameras), 'camera')}",
            f"{control} control and {len(record.points) - control} tie points",
            counted(record.n_observations, "equation"),
            ("" if record.converged else "NOT ")
            + f"converged after {counted(len(record.iterations), 'iteration')}",
        ]
    )
    return Verdict(*_judged(record), detail)


def _judged(record: BundleRecord) -> tuple[Level, str]:
    """Level and sentence of what decides: the first of these that holds."""
    diagnosis, test = record.diagnosis, record.global_test
    if not record.converged:
        return "bad", f"Not usable: {name(record.stopped)}."
    count = 0 if diagnosis is None else len(diagnosis.accused)
    if count:
        what = "1 error is suspected. Check it" if count == 1 else f"{count} errors are suspected. Check them"
        return "bad", f"Not usable yet: {what}, then adjust again."
    if diagnosis is not None and diagnosis.status in ("undecided", "unexplained"):
        return "bad", "Not usable yet: something is wrong, and no single cause explains it."
    if any(item.is_off for item in record.check_points):
        return "bad", "Not usable yet: check points are farther off than chance lets them be."
    if record.rejected_shares:
        return (
            "bad",
            f"Not usable yet: most residuals of {name(record.rejected_shares[0].text)} are rejected.",
        )
    if record.weak:
        return "warn", f"Adjusted without precisions: {name(record.weak)}."
    if not record.is_complete:
        return "warn", "Usable, but not all of it took part: see the findings."
    if test is not None and not test.passed:
        size = "large" if test.sigma0 > test.upper else "small"
        expected = f"{test.lower:.2f} to {test.upper:.2f} is expected"
        return (
            "warn",
            f"The residuals are too {size} for their sigmas: sigma0 is {test.sigma0:.3g}, {expected}.",
        )
    if record.redundancy <= 0:
        return "warn", "Adjusted, but nothing is checked: there is no redundancy."
    return "ok", "The block is sound: residuals fit the sigmas, and no error is suspected."


def _cards(record: BundleRecord, block: BlockArrays) -> Iterator[Card]:
    yield _sigma0(record)
    lengths = np.linalg.norm(block.residuals, axis=1)
    rms = float(np.sqrt(np.mean(block.residuals**2))) if lengths.size else 0.0
    given = f"px rms; {float(np.median(block.sigmas)):.2g} given" if lengths.size else "px"
    yield Card(
        "image residuals",
        f"{rms:.3g}",
        given,
        None,
        strip(lengths.tolist()),
        f"{lengths.size} image points, per coordinate",
        Place("measures"),
    )
    if record.reliability is not None:
        yield from _tests(record, record.reliability.critical)
    if block.covariances is not None and len(record.points):
        sigmas = np.sqrt(np.clip(np.diagonal(block.covariances, axis1=1, axis2=2).max(axis=1), 0.0, None))
        worst = int(np.argmax(sigmas))
        yield Card(
            "weakest point",
            small(float(sigmas[worst])),
            "",
            None,
            strip(sigmas.tolist()),
            f"{name(record.points[worst].name)}, its worst coordinate",
            Place(point=worst),
        )
    equations = record.n_observations
    each = f"{record.redundancy / equations:.2f} per equation" if equations else ""
    known = record.reliability and [
        *record.reliability.all.redundancy_x,
        *record.reliability.all.redundancy_y,
    ]
    yield Card(
        "redundancy",
        str(record.redundancy),
        each,
        None,
        shares(known) if known else None,
        "share of an error that shows" if known else "",
        Place("measures", filter="redundancy<0.3"),
    )


def _sigma0(record: BundleRecord) -> Card:
    test = record.global_test
    if test is None:
        return Card("sigma0", significant(record.sigma0, 4), note=name(tested(record).strip()))
    is_large, is_small = test.sigma0 > test.upper, test.sigma0 < test.lower
    tag = ("bad", "too large") if is_large else ("warn", "too small") if is_small else ("ok", "as expected")
    figure = gauge(test.sigma0, test.lower, test.upper, "bad" if is_large else "warn")
    return Card(
        "sigma0",
        significant(test.sigma0, 4),
        "expected 1",
        tag,
        figure,
        "95 % chi-square interval",
        Place("quality"),
    )


def _tests(record: BundleRecord, limit: float) -> Iterator[Card]:
    assert record.reliability is not None
    tests = record.reliability.all
    worst = [
        max((abs(w) for w in pair if w is not None), default=0.0)
        for pair in zip(tests.w_x, tests.w_y, strict=True)
    ]
    if worst:
        row = int(np.argmax(worst))
        beyond = record.reliability.beyond
        tag = ("warn", f"{beyond} beyond") if beyond else ("ok", "none beyond")
        columns = record.residuals
        note = f"{record.images[columns.image[row]].name} \u00b7 {record.points[columns.point[row]].name}"
        yield Card(
            "largest w",
            f"{worst[row]:.2f}",
            f"limit {limit:.2f}",
            tag,
            strip(worst, limit),
            name(note),
            Place("measures", row=row),
        )


def _lists(record: BundleRecord, block: BlockArrays) -> tuple[Findings, ...]:
    accused = () if record.diagnosis is None else record.diagnosis.accused
    found = (
        Findings("Suspected errors", tuple(_accused(record, item) for item in accused)),
        Findings("Worth knowing" if accused else "Look at first", tuple(_others(record, block))),
    )
    return tuple(part for part in found if part.items)


def _accused(record: BundleRecord, item: AccusedRecord) -> Finding:
    text = item.text[:1].upper() + item.text[1:]
    if item.others:
        others = listed([other.what for other in item.others], MOST_NAMES)
        text = f"{text.rstrip('.')}. Not told apart from: {others}."
    off = f"T {item.test:.0f}" if item.test else ""
    rows = [place.row for place in item.observations]
    points = {point.name: k for k, point in enumerate(record.points)}
    to = Place("measures", row=rows[0]) if rows else None
    if to is None and item.points and item.points[0].name in points:
        to = Place(point=points[item.points[0].name])
    return Finding(
        "bad",
        name(item.what),
        name(text),
        off,
        "",
        "look at the image or the list, correct it, adjust again. What this means:",
        f"obseq causes {item.code}",
        to,
    )


def _others(record: BundleRecord, block: BlockArrays) -> Iterator[Finding]:
    found = record.diagnosis
    if found is not None and found.reason:
        yield Finding(
            "bad" if found.status != "accepted" else "info",
            f"Search for errors: {found.status}",
            name(found.reason),
        )
    yield from _lost("Left out", record.left_out, "warn")
    yield from _lost("Changes nothing", record.unmeasured, "info")
    yield from _lost("Not in pairs of their rigid blocks", record.unpaired, "warn")
    if record.behind:
        names = listed([f"{item.point} in {item.image}" for item in record.behind], MOST_NAMES)
        yield Finding(
            "warn",
            f"{counted(len(record.behind), 'point')} behind the camera",
            name(f"In the solution: {names}."),
        )
    if record.far:
        yield Finding(
            "info",
            f"{counted(len(record.far), 'far point')}",
            name(f"Their direction is determined, their distance is not: {listed(record.far, MOST_NAMES)}."),
        )
    off = [item.name for item in record.check_points if item.is_off]
    if off:
        text = "They are farther from where they should be than chance lets them."
        yield Finding("bad", name(f"Check points off: {listed(off, MOST_NAMES)}"), text)
    if record.unchecked:
        yield Finding("warn", "Check points without a place", name(listed(record.unchecked, MOST_NAMES)))
    if record.weakened:
        yield Finding(
            "info",
            f"{counted(record.weakened, 'image point')} weakened",
            "They have less than half of their weight.",
            to=Place("measures", filter="weight<0.5"),
        )
    yield from _fit(record)
    for failure in record.failures:
        yield Finding("warn", "Warning", name(failure))
    for note in record.notes:
        yield Finding("info", "Note", name(note))


def _fit(record: BundleRecord) -> Iterator[Finding]:
    """The worst control point, correlation and image."""
    control = [(max(map(abs, point.residual)), k) for k, point in enumerate(record.points) if point.residual]
    if control:
        size, k = max(control)
        yield Finding(
            "info",
            name(f"Control point {record.points[k].name}"),
            "Largest difference from its given coordinates.",
            small(size),
            to=Place(point=k),
        )
    for camera in record.cameras:
        if camera.correlations and (pair := _strongest(np.array(camera.correlations))):
            i, j, value = pair
            first, second = camera.parameters[i].name, camera.parameters[j].name
            level: Level = "warn" if abs(value) > STRONG else "info"
            yield Finding(
                level,
                name(f"{first} and {second} of {camera.name}"),
                "Largest correlation of the calibration; beyond 0.95 two parameters are one thing.",
                f"{value:+.2f}",
            )
    if len(record.images) > 1:
        worst = max(record.images, key=lambda image: image.rms)
        yield Finding(
            "info",
            name(f"Image {worst.name} has the largest residuals"),
            f"rms {worst.rms:.3g} px of {counted(worst.n_measures, 'image point')}.",
        )


def _lost(title: str, items: tuple[BlockLeftOutRecord, ...], level: Level) -> Iterator[Finding]:
    """What took no part, one finding for each kind and reason."""
    groups: dict[tuple[str, str], list[str]] = {}
    for item in items:
        groups.setdefault((item.kind, item.reason), []).append(item.name)
    for (kind, reason), names in groups.items():
        what = f"{title}: {counted(len(names), kind)}"
        yield Finding(level, name(what), name(f"{listed(names, MOST_NAMES)}: {reason}."))


def _strongest(matrix: np.ndarray) -> tuple[int, int, float] | None:
    lower = np.tril(np.abs(matrix), -1)
    if not lower.any():
        return None
    i, j = np.unravel_index(int(np.argmax(lower)), lower.shape)
    return int(i), int(j), float(matrix[i, j])


def _sections(record: BundleRecord, block: BlockArrays) -> Iterator[Section]:
    marked = suspected_measures(record)
    yield Section("frames", "Image residuals", tuple(frames(record, block, marked)))
    yield Section("calibration", "Calibration", tuple(cameras(record, block, marked)), tables=("parameters",))
    charts = []
    if record.reliability is not None:
        charts = [{"kind": kind, "table": "measures", "column": "w"} for kind in ("histogram", "normal")]
    steps = [{"sigma0": row.sigma0, "step": row.max_step} for row in record.iterations]
    yield Section("quality", "Quality", (*charts, {"kind": "convergence", "iterations": steps}))
    yield Section("provenance", "Provenance", facts=tuple(_facts(record)), words=WORDS)


def _facts(record: BundleRecord) -> Iterator[tuple[str, str]]:
    yield "run", f"{record.run.identifier}, {record.run.created}"
    yield "versions", ", ".join(f"{package} {version}" for package, version in record.run.versions.items())
    yield "precisions", record.precision
    yield (
        "equations",
        f"{record.n_observations}, unknowns {record.n_unknowns}, redundancy {record.redundancy}",
    )
    yield "sums of squares", ", ".join(f"{kind} {value:.6g}" for kind, value in record.squares.items())
    yield "sigma0", name(tested(record).strip())
    if record.frame:
        yield "frame", name(record.frame)
    yield "stopped", name(record.stopped)
    yield from (("warning", name(text)) for text in record.failures)
    yield from (("note", name(text)) for text in record.notes)
