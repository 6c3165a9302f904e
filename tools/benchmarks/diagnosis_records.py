"""What the results of this version accuse, as places: the one file that knows in which fields they say it.

A record has a `diagnosis`: status, accused, others, slips.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from diagnosis_verdicts import Found, Place

from obseq.records.record import to_plain

if TYPE_CHECKING:
    from collections.abc import Mapping

    from obseq.errors import ObseqError
    from obseq.images.output.block_record import BundleRecord
    from obseq.survey import Adjustment, Network

Set = tuple[Place, ...]


def of_diagnosis(diagnosis: Mapping[str, Any]) -> Found:
    """What the diagnosis of a record accuses."""
    return Found(diagnosis["status"], tuple(_set(one) for one in diagnosis["accused"]))


def _set(accused: Mapping[str, Any]) -> Set:
    slips = frozenset(slip["code"] for slip in accused.get("slips", ()))
    return _place(accused, slips), *(_place(other, frozenset()) for other in accused.get("others", ()))


def _place(hypothesis: Mapping[str, Any], slips: frozenset[str]) -> Place:
    lines = frozenset(
        (Path(row["file"]).name, int(row["line"])) for row in hypothesis.get("observations", ())
    )
    points = frozenset(f"{p['name']} {p['coordinate']}".strip() for p in hypothesis.get("points", ()))
    return Place(hypothesis["code"], lines, points, frozenset(hypothesis.get("images", ())), slips)


def of_survey(network: Network) -> tuple[Found, Adjustment]:
    """What the adjustment of a network accuses, and the adjustment."""
    adjustment = network.adjust()
    return of_diagnosis(adjustment.to_dict()["diagnosis"]), adjustment


# Blocks


def of_block(record: BundleRecord) -> Found:
    """What the adjustment of a block accuses."""
    if record.diagnosis is None:
        return Found("undecided")
    return of_diagnosis(to_plain(record.diagnosis))


def of_refusal(error: ObseqError) -> Found | None:
    """What an error accuses that says why a block has no solution; None where it does not."""
    diagnosis = getattr(error, "diagnosis", None)
    return None if diagnosis is None else of_diagnosis(diagnosis)
