"""What the results of this version accuse, as places: the one file that knows in which fields they say it.

A record has a `diagnosis` (status, accused, others, slips); surveys, which have none yet, are read from the
fields that do the same: gross errors with their rows, and the suspicion.
"""

from __future__ import annotations

import re
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

from diagnosis_verdicts import Found, Line, Place

from obseq.records.record import to_plain
from obseq.survey import Adjustment

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from obseq.errors import ObseqError
    from obseq.images.output.block_record import BundleRecord
    from obseq.survey import Network

Set = tuple[Place, ...]

KNOWN = re.compile(r"known (?:coordinate )?([xyz]) of (\S+)")
PLACED = re.compile(r"\(([^():]+):(\d+)\)")
SHARED = "height of instrument or target", "constant or scale of distances", "index of zenith angles"
"""Causes that several observations have in common."""


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


# Surveys


def of_survey(network: Network) -> tuple[Found, Adjustment]:
    """What the adjustment of a network accuses, and the adjustment."""
    with _announced() as errors:
        adjustment = network.adjust()
    record = adjustment.record()
    if hasattr(record, "diagnosis"):
        return of_diagnosis(record.to_dict()["diagnosis"]), adjustment
    sets = [_gross(error, network) for error in errors] if adjustment.gross_errors else []
    if not sets and adjustment.suspicion is not None:
        sets.append(tuple(map(_named, adjustment.suspicion.observations)))
    return Found("explained" if sets else "accepted", tuple(sets)), adjustment


@contextmanager
def _announced() -> Iterator[list[Any]]:
    """The gross errors of the adjustment that is made meanwhile: their record does not list their rows."""
    told: list[Any] = []

    def announcing(self: Adjustment, errors: Sequence[Any], replaced: Any) -> Adjustment:
        told[:] = errors
        return own(self, errors, replaced)

    own = Adjustment.announcing
    with patch.object(Adjustment, "announcing", announcing):
        yield told


def _gross(error: Any, network: Network) -> Set:
    """The places of a gross error: all that it names, or one of these."""
    book, cause = network.book, frozenset({error.cause.value})
    observations, files = book.observations, book.files
    lines: list[Line] = [
        (Path(files[observations.file_indices[row]]).name, int(observations.lines[row])) for row in error.rows
    ]
    is_named = error.points and not (lines and error.cause.value in ("wrong point", "names swapped"))
    is_one = error.is_one and error.cause.value not in SHARED
    if is_one or error.text.endswith("nothing tells these apart"):
        points = tuple(Place(points=frozenset({name}), causes=cause) for name in error.points)
        return points or tuple(Place(lines=frozenset({line}), causes=cause) for line in lines)
    if is_named:
        return (Place(points=frozenset(error.points), causes=cause),)
    return (Place(lines=frozenset(lines), causes=cause),)


def _named(observation: str) -> Place:
    """The place of an observation that a suspicion names."""
    if known := KNOWN.search(observation):
        return Place(points=frozenset({f"{known[2]} {known[1]}"}))
    if observation.startswith("known"):
        return Place(points=frozenset({observation.split()[-1]}))
    return Place(lines=frozenset((Path(file).name, int(line)) for file, line in PLACED.findall(observation)))


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
