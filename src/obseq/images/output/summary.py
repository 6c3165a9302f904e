"""What is printed of a bundle adjustment, from its record alone: verdict, cameras, images, points."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from obseq.images.output.page_tables import tables, writer
from obseq.images.output.references_told import check_points
from obseq.images.output.shares import LARGE
from obseq.images.output.testing import POOR
from obseq.printable import printable
from obseq.report.writer import ordered, worst

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from obseq.images.output.block_record import BundleRecord, CameraRecord
    from obseq.images.output.testing import BlockReliabilityRecord
    from obseq.records.diagnosis import DiagnosisRecord

FIRST = 4
"""Names of a list before it is cut."""
MOST = 12
"""Rows of a table, and lines of errors, before they are cut."""
STRONG = 0.95
"""Correlation from which two parameters are one thing."""
SHOWN: dict[str, tuple[tuple[str, ...], str | None]] = {
    "parameters": (("camera", "parameter", "value", "sigma", "state"), None),
    "images": (("image", "points", "rms", "largest", "x", "y", "z", "sx", "sy", "sz"), "rms"),
    "points": (("point", "rays", "rms", "dx", "dy", "dz"), "rms"),
    "check-points": ((), None),
    "antennas": ((), None),
    "shutters": ((), None),
    "pairs": ((), None),
    "clinometers": (("clinometer", "rms"), None),
    "tests": ((), "w"),
    "measures": (("from", "to", "dx", "dy", "w", "weight"), "w"),
    "without": ((), None),
}
"""Tables of the summary: their columns (all where none are named), and by which the worst come first."""


def summary(record: BundleRecord, files: Sequence[str] = ()) -> str:
    """A screenful about an adjusted block."""
    parts = [
        _line_of(suspected(record)),
        _verdict(record),
        *_tables(record),
        *(_camera(camera) for camera in record.cameras[:FIRST]),
        check_points(record),
        "".join(f"Warning: {failure}\n" for failure in record.failures),
        "".join(f"note: {note}\n" for note in record.notes),
        "".join(f"remark: {text}\n" for text in remarks(record)),
        "".join(f"written: {name}\n" for name in files),
    ]
    return printable("\n".join(part for part in parts if part))


def remarks(record: BundleRecord) -> tuple[str, ...]:
    """Effects that many observations show together, which are no errors."""
    found = record.diagnosis.remarks if record.diagnosis is not None else ()
    return tuple(f"{one.text}; no error, it is not beyond a sigma of each" for one in found)


def suspected(record: BundleRecord) -> str:
    """What is suspected to be wrong, in a line; empty where nothing is."""
    if record.diagnosis is not None and (told := _told(record.diagnosis)):
        return told
    return _distrusted(record) if record.converged else ""


def _told(diagnosis: DiagnosisRecord) -> str:
    """What a diagnosis says: a line for each error, and what is left without them."""
    lines = [one.text for one in diagnosis.accused[:MOST]]
    if not lines:
        return diagnosis.reason
    if (more := len(diagnosis.accused) - MOST) > 0:
        lines.append(f"and {more} more errors, which the result file names")
    sigma0 = diagnosis.sigma0
    is_single = all(one.test for one in diagnosis.accused)  # of what all share, the text says it
    if diagnosis.status == "explained" and sigma0 is not None and is_single:
        lines[-1] += f". Without {'it' if len(lines) == 1 else 'them'}, sigma0 is {sigma0:.3g}"
    elif diagnosis.status == "unexplained" and is_single:
        lines.append("this does not explain all: more is wrong, or the sigmas are too small")
    return "\n".join(lines)


def _distrusted(record: BundleRecord) -> str:
    """Of what so much is rejected that it is not to be trusted, though nothing single stands out.

    That is the whole result where half of the block, of its images or of its points are such.
    """
    shares = record.rejected_shares
    if not shares:
        return ""
    listed = first_of([share.text for share in shares])
    whole = {"block": 1, "image": len(record.images), "point": len(record.points)}
    counts = {kind: sum(share.kind == kind for share in shares) for kind in whole}
    few = [f"{count} of {whole[kind]} {kind}s" for kind, count in counts.items() if count]
    is_all = any(count >= LARGE * whole[kind] for kind, count in counts.items())
    verb = "is" if sum(counts.values()) == 1 else "are"
    what = "the result is" if is_all else f"{' and '.join(few)} {verb}"
    return (
        f"{what} not to be trusted: half of the image coordinates or more are rejected of {listed}; "
        "look for a cause that they share (axes of pixels, names of points or images, camera, pose), or for "
        "sigmas that are too small"
    )


def _verdict(record: BundleRecord) -> str:
    sigma0 = "undefined" if record.sigma0 is None else f"{record.sigma0:.4f}"
    state = "converged" if record.converged else f"NOT CONVERGED: {record.stopped}"
    kinds = Counter(point.kind for point in record.points)
    check = f", {kinds['check']} check points" if kinds["check"] else ""
    lines = [
        f"Bundle adjustment: sigma0 {sigma0}, {state} after {len(record.iterations)} iterations",
        f"  {len(record.images)} images, {len(record.cameras)} cameras, "
        f"{kinds['control']} control points, {kinds['tie']} tie points{check}",
        f"  {record.n_observations} equations, {record.n_unknowns} unknowns, redundancy {record.redundancy}; "
        f"precisions {record.precision}",
    ]
    if record.weak:
        lines.append(f"  WEAK, without precisions: {record.weak}")
    lines.append(tested(record))
    if record.weakened:
        lines.append(f"  {record.weakened} image points have less than half of their weight")
    if record.reliability is not None:
        lines.append(_reliability(record.reliability))
    if record.behind:
        names = list(dict.fromkeys(item.point for item in record.behind))
        lines.append(
            f"  {len(record.behind)} image points are BEHIND their camera in the solution: {first_of(names)}"
        )
    if record.far:
        lines.append(
            f"  {len(record.far)} points are too far for their distance to be determined, only their "
            f"direction is: {first_of(record.far)}"
        )
    return "\n".join(lines) + "\n"


def tested(record: BundleRecord) -> str:
    """What sigma0 says of the residuals."""
    test = record.global_test
    if test is None:
        return f"  sigma0 is not tested: {_untested(record)}"
    limits = f"  chi-square test at 95 %: sigma0 between {test.lower:.4g} and {test.upper:.4g} is expected"
    if test.passed:
        return f"{limits}: accepted"
    if test.sigma0 < test.lower:
        return f"{limits}: REJECTED, too small: the sigmas are too large"
    return (
        f"{limits}: REJECTED, too large: look for blunders among the largest residuals, for wrong control "
        "points, for axes or units that are not what was said, or for sigmas that are too small"
    )


def _untested(record: BundleRecord) -> str:
    """Why sigma0 is not tested, and what says in its place whether the sigmas are right."""
    if record.redundancy <= 0:
        return "no redundancy, nothing checks the result"
    if record.reliability is None:
        return "robust weights"
    spread = record.reliability.largest.spread
    return f"robust weights; most residuals are {spread:.3g} times what the sigmas say"


def _line_of(text: str) -> str:
    return f"{text}\n" if text else ""


def _reliability(found: BlockReliabilityRecord) -> str:
    return (
        f"  {found.beyond} of {found.tested} image coordinates beyond the test |w| > {found.critical:.2f}; "
        f"{found.poor} are poorly controlled (redundancy below {POOR}), {found.uncontrolled} not at all"
    )


def _camera(camera: CameraRecord) -> str:
    """Pairs of parameters that the block can hardly tell apart."""
    if camera.correlations is None:
        return ""
    matrix = np.abs(np.array(camera.correlations))
    names = [parameter.name for parameter in camera.parameters]
    pairs = [
        f"{names[i]}-{names[j]} {camera.correlations[i][j]:+.3f}"
        for i, j in np.argwhere(np.triu(matrix, 1) > STRONG)
    ]
    return f"Correlations of {camera.name} above {STRONG}: {', '.join(pairs)}\n" if pairs else ""


def _tables(record: BundleRecord) -> Iterator[str]:
    """The first rows of the tables that tell most."""
    written = writer(record)
    for table in tables(record):
        if table["id"] not in SHOWN:
            continue
        keys, by = SHOWN[table["id"]]
        rows = ordered(table) if by is None else worst(table, by)
        if table["id"] == "points":
            rows = [row for row in rows if record.points[row].residual]
        if rows:
            more = f"  ... and {len(rows) - MOST} more\n" if len(rows) > MOST else ""
            yield "\n".join(written.lines(table, rows[:MOST], keys)) + "\n" + more


def first_of(names: Sequence[str]) -> str:
    """The first names, and how many more there are."""
    more = len(names) - FIRST
    return ", ".join(names[:FIRST]) + (f" and {more} more" if more > 0 else "")
