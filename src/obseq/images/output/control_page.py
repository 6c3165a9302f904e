"""Parts of the page of a block, from its record: rigid blocks, clinometers, tests of image points."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.images.output.summary import suspected
from obseq.report.html import escaped

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from obseq.images.output.block_record import BundleRecord
    from obseq.images.output.instruments import ClinometerRecord, RigidRecord

MOST_ROWS = 500
"""Rows of a table before it is cut."""
BAD = ' class="bad"'


def reliability(record: BundleRecord) -> Iterator[str]:
    """Redundancy numbers, tests and detectable blunders of the worst image points."""
    found = record.reliability
    if found is None:
        return
    heads = (
        "image", "point", "redundancy x", "y", "w x", "w y", "detectable x px", "y", "blunder x px", "y"
    )  # fmt: skip
    rows = []
    for item in found.worst:
        pairs = (item.redundancy, item.w, item.detectable, item.blunder)
        numbers = ("-" if value is None else f"{value:.3g}" for pair in pairs for value in pair)
        rows.append((item.image, item.point, *numbers))
    yield (
        f"<h2>Tests of image points</h2><p>{found.beyond} of {found.tested} coordinates beyond "
        f"|w| &gt; {found.critical:.3g} (level {found.level:g}); redundancy of all {found.redundancy:.1f}, "
        f"{found.poor} coordinates poorly controlled, {found.uncontrolled} not at all; a detectable "
        f"blunder is found with probability {found.power:g}</p>{table(heads, rows, len(rows))}"
    )


def instruments(record: BundleRecord) -> Iterator[str]:
    """Places and residuals of rigid blocks, axes and residuals of clinometers."""
    for block in record.rigid_blocks:
        yield from _rigid(block)
    if record.clinometers:
        yield from _clinometers(record.clinometers)


def _rigid(block: RigidRecord) -> Iterator[str]:
    places = [
        (
            place.camera, *(f"{value:.6g}" for value in place.centre),
            *(f"{value:.8f}" for value in place.quaternion),
            *(f"{value:.3g}" for value in place.sigmas or ()),
        )
        for place in block.places
    ]  # fmt: skip
    heads = ["camera", "x", "y", "z", "qw", "qx", "qy", "qz"]
    if block.places[0].sigmas is not None:
        heads += ["sx", "sy", "sz", "s rot x", "s rot y", "s rot z"]
    name = escaped(block.name)
    yield f"<h2>Rigid block {name}</h2><p>places in the frame of {escaped(block.master)}; radians</p>"
    yield table(heads, places, len(places))
    means = [
        (f"{pair.first}, {pair.second}", f"{pair.rms_translation:.4g}", f"{pair.rms_rotation:.4g}")
        for pair in block.pairs
    ]
    yield table(("cameras", "rms translation", "rms rotation"), means, len(means))
    rows = [
        (
            item.exposure,
            f"{item.first}, {item.second}",
            *map("{:+.4g}".format, item.translation + item.rotation),
        )
        for item in block.exposures[:MOST_ROWS]
    ]
    heads = ["exposure", "cameras", "dx", "dy", "dz", "rot x", "rot y", "rot z"]
    yield table(heads, rows, len(block.exposures))


def _clinometers(found: Sequence[ClinometerRecord]) -> Iterator[str]:
    rows = [
        (item.name, *map("{:.6g}".format, (*item.axis, *item.correction)), f"{item.rms:.3g}")
        for item in found
    ]
    degrees = (f"degree {k}" for k in range(4))
    heads = ("clinometer", "axis x", "axis y", "axis z", *degrees, "rms rad")
    yield f"<h2>Clinometers</h2>{table(heads, rows, len(rows))}"
    readings = [
        (item.name, image, f"{value:+.4g}")
        for item in found
        for image, value in zip(item.images, item.residuals, strict=True)
    ]
    yield table(("clinometer", "image", "computed minus read, rad"), readings[:MOST_ROWS], len(readings))


def largest_tests(record: BundleRecord) -> Iterator[str]:
    """The largest tests of all kinds of observation; suspects stand first, and are marked."""
    tests = record.suspicion
    if tests is None or not tests.largest:
        return
    suspects = suspected(record)
    said = f'<p class="bad">{escaped(suspects)}</p>' if suspects else "<p>No gross error is suspected.</p>"
    rows = [
        (
            item.name, f"{item.w:+.2f}", f"{item.scaled:+.2f}",
            "" if item.blunder is None else f"{item.blunder:+.3g} {item.unit}", f"{item.weight:.3g}",
        )
        for item in tests.largest
    ]  # fmt: skip
    heads = ("what", "w", f"scaled (limit {tests.limit:.2f})", "error", "weight")
    shown = table(heads, rows, len(rows), len(record.suspects))
    yield f"<h2>Largest standardised residuals of all observations</h2>{said}{shown}"


def table(heads: Sequence[str], rows: Iterable[Sequence[object]], count: int, marked: int = 0) -> str:
    """A table, and a note when it has not all of so many rows; the first ones may be marked."""
    body = [
        f"<tr{BAD if k < marked else ''}>{''.join(f'<td>{escaped(str(cell))}</td>' for cell in row)}</tr>"
        for k, row in enumerate(rows)
    ]
    head = "".join(f"<th>{word}</th>" for word in heads)
    note = f"<p>and {count - len(body)} more, in the JSON file</p>" if count > len(body) else ""
    return f'<div class="scroll"><table><tr>{head}</tr>{"".join(body)}</table></div>{note}'
