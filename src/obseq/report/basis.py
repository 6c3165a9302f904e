"""What a result was made from and how it ended, in words."""

from __future__ import annotations

from collections.abc import Iterator

from obseq.printable import listed
from obseq.records.adjustment import AdjustmentRecord, OperationRecord
from obseq.report.tables import units

MOST_FILES = 12


def kinds(record: AdjustmentRecord) -> str:
    """How many active observations of each type, in words."""
    active = record.observations.truths("active")
    count, unused = record.observations.distinct("type", active), int((~active).sum())
    text = ", ".join(f"{count[kind]} {kind}" for kind in sorted(count))
    return f"{text}; {unused} not used" if unused else text


def run_line(record: AdjustmentRecord) -> str:
    """Which run made the record, and with what."""
    if record.run is None:
        return "not in the record"
    versions = ", ".join(f"{name} {version}" for name, version in record.run.versions.items())
    return f"{record.run.identifier}, {record.run.created}; {versions}"


def basis(record: AdjustmentRecord) -> Iterator[tuple[str, str]]:
    """What it was made from, in words: files, versions, systems, refraction, operations, precisions."""
    names = record.files or tuple(record.observations.distinct("file"))
    yield "files", listed(names, MOST_FILES)
    yield "run", run_line(record)
    yield "frame", record.frame
    if record.points_crs != record.frame:
        yield "points in", record.points_crs
    if record.refraction is not None:
        yield "refraction", f"coefficient {record.refraction:g}"
    yield from (("operation", _operation(item)) for item in record.operations or ())
    yield "precisions", record.precision or "not said"
    yield "units", units.units_of(record).words


def _operation(item: OperationRecord) -> str:
    accuracy = "accuracy not announced" if item.accuracy is None else f"accuracy {item.accuracy:g} m"
    return f"{item.system} to WGS 84 by PROJ: {item.description} ({accuracy})"
