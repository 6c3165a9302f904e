"""What there is to look at in an adjusted block: suspected errors, and what is worth knowing."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from obseq.images.output.block_record import BlockLeftOutRecord, BundleRecord
from obseq.images.output.shares import LARGE
from obseq.images.output.testing import POOR
from obseq.printable import listed
from obseq.records.diagnosis import AccusedRecord
from obseq.report.findings import searched, shortened, suspected
from obseq.report.head import Finding, Findings, Level, Place, counted
from obseq.report.said import name, small

PLACE = re.compile(r"\(([^()]+):\d+\)")
"""A line of a file that a text quotes."""
FIRST = 4
"""Names of what is not to be trusted."""
MOST_NAMES = 8
STRONG = 0.95
"""Correlation from which two parameters of a camera are one thing."""
WITHIN = 1.96
"""Sigmas that 95 % of errors keep."""


def findings(record: BundleRecord) -> tuple[Findings, ...]:
    """Suspected errors, and what is worth knowing."""
    accused = () if record.diagnosis is None else record.diagnosis.accused
    found = (
        Findings("Suspected errors", tuple(_accused(record, item) for item in accused)),
        Findings("Worth knowing" if accused else "Look at first", tuple(_others(record))),
    )
    texts = (f"{item.title} {item.text}" for part in found for item in part.items)
    return shortened(found, [file for text in texts for file in PLACE.findall(text)])


def _accused(record: BundleRecord, item: AccusedRecord) -> Finding:
    off = f"T {item.test:.0f}" if item.test else ""
    rows = [place.row for place in item.observations]
    points = {point.name: k for k, point in enumerate(record.points)}
    to = Place("measures", row=rows[0]) if rows else None
    if to is None and item.points and item.points[0].name in points:
        to = Place(point=points[item.points[0].name])
    return suspected(item, name(item.what), off, "", "look at the image or the list", to)


def _others(record: BundleRecord) -> Iterator[Finding]:
    yield from searched(record.diagnosis, record.failures)
    if text := distrusted(record):
        yield Finding("bad", "Not to be trusted", name(text))
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
    yield from _checks(record)
    yield from _weakly_checked(record)
    yield from _fit(record)
    for note in record.notes:
        yield Finding("info", "Note", name(note))


def _checks(record: BundleRecord) -> Iterator[Finding]:
    """How check points agree with the result."""
    found = record.check_points
    if not found:
        return
    differences = np.array([point.residual for point in found])
    rms, mean = np.sqrt(np.mean(differences**2, axis=0)), differences.mean(axis=0)
    parts = [" ".join(small(float(value)) for value in values) for values in (mean, rms)]
    pairs = [
        (abs(difference), sigma)
        for point in found
        if point.sigmas
        for difference, sigma in zip(point.residual, point.sigmas, strict=True)
    ]
    within = sum(difference <= WITHIN * sigma for difference, sigma in pairs)
    share = f"; {within} of {len(pairs)} coordinates within {WITHIN} sigmas" if pairs else ""
    text = f"Adjusted minus given: mean {parts[0]}, rms {parts[1]}{share}."
    yield Finding("info", counted(len(found), "check point"), text)


def _weakly_checked(record: BundleRecord) -> Iterator[Finding]:
    """Image coordinates that others hardly check."""
    found = record.reliability
    if found is not None and found.poor:
        text = f"Redundancy below {POOR:g}; {found.uncontrolled} of them not checked at all."
        count = found.tested + found.uncontrolled
        title = f"{found.poor} of {count} image coordinates are weakly checked"
        yield Finding("info", title, text, to=Place("measures", filter=f"redundancy<{POOR:g}"))


def distrusted(record: BundleRecord) -> str:
    """Of what so much is rejected that it is not to be trusted, though nothing single stands out.

    That is the whole result where half of the block, of its images or of its points are such.
    """
    shares = record.rejected_shares
    is_accused = record.diagnosis is not None and (record.diagnosis.accused or record.diagnosis.reason)
    if not shares or is_accused or not record.converged:
        return ""
    names = listed([share.text for share in shares], FIRST)
    whole = {"block": 1, "image": len(record.images), "point": len(record.points)}
    counts = {kind: sum(share.kind == kind for share in shares) for kind in whole}
    few = [f"{count} of {whole[kind]} {kind}s" for kind, count in counts.items() if count]
    is_all = any(count >= LARGE * whole[kind] for kind, count in counts.items())
    verb = "is" if sum(counts.values()) == 1 else "are"
    what = "the result is" if is_all else f"{' and '.join(few)} {verb}"
    return (
        f"{what} not to be trusted: half of the image coordinates or more are rejected of {names}; "
        "look for a cause that they share (axes of pixels, names of points or images, camera, pose), or for "
        "sigmas that are too small"
    )


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
