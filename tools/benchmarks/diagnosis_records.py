"""What the results of this version accuse, as places: the one file that knows in which fields they say it.

A record has a `diagnosis` (status, accused, others, slips); of blocks that have none yet the suspects and the
cause are read.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diagnosis_verdicts import Found, Place

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from obseq.errors import ObseqError
    from obseq.images.output.block_record import BundleRecord
    from obseq.survey import Adjustment, Network

Set = tuple[Place, ...]

IMAGE_POINT = re.compile(r"image (\S+), point (\S+?)[,:;. ]")
ONE_OF = re.compile(r"one of the \d+ measures of point (\S+) \(images ([^)]*)\)")
CONTROL = re.compile(r"(?:control points?|contradict:) ([^\s;(:]+)")
EXCHANGED = re.compile(r"images (\S+) and (\S+) (?:are|look) exchanged")
UNIT = re.compile("times (as large as the rest of the block says|too large)")


def of_diagnosis(diagnosis: Mapping[str, Any]) -> Found:
    """What the diagnosis of a record accuses."""
    return Found(diagnosis["status"], tuple(_set(one) for one in diagnosis.get("accused", ())))


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
    adjustment = network.adjust()
    return of_diagnosis(adjustment.to_dict()["diagnosis"]), adjustment


# Blocks


def of_block(record: BundleRecord, measures: Sequence[tuple[str, str]]) -> Found:
    """What the adjustment of a block accuses; measures: image and point of each line of their file."""
    diagnosis = getattr(record, "diagnosis", None)
    if diagnosis is not None:
        return of_diagnosis(diagnosis if isinstance(diagnosis, dict) else diagnosis.to_plain())
    line: dict[tuple[str, ...], Place] = {
        pair: Place(lines=frozenset({("measures.csv", row + 2)})) for row, pair in enumerate(measures)
    }
    sets = list(_told(record.cause, line)) if record.cause else []
    if not record.cause:
        sets = [(_suspect(record, suspect, line),) for suspect in record.suspects]
    return Found("explained" if sets else "accepted" if record.converged else "undecided", tuple(sets))


def of_refusal(error: ObseqError) -> Found | None:
    """What an error accuses that says why a block has no solution; None where it does not."""
    if (diagnosis := getattr(error, "diagnosis", None)) is not None:
        return of_diagnosis(diagnosis)
    sets = tuple(_told(str(error), {}))
    return Found("explained", sets) if sets[0][0].code != "other" else None


def _told(cause: str, line: Mapping[tuple[str, ...], Place]) -> Iterator[Set]:
    """What a cause in words names."""
    found: list[Set] = [(line[pair],) for pair in IMAGE_POINT.findall(f"{cause} ") if pair in line]
    for point, images in ONE_OF.findall(cause):
        found.append(tuple(line[image, point] for image in images.split(", ") if (image, point) in line))
    found += [(Place(points=frozenset({name})),) for name in CONTROL.findall(cause) if name.startswith("P")]
    if pair := EXCHANGED.search(cause):
        found.append((Place("I140", images=frozenset(pair.groups())),))
    if UNIT.search(cause):
        found = [(Place("I150"),)]
    yield from found or [(Place("other"),)]


def _suspect(record: BundleRecord, suspect: Any, line: Mapping[tuple[str, ...], Place]) -> Place:
    if suspect.row is None:
        return Place(points=frozenset({suspect.name.removeprefix("control point ")}))
    columns = record.residuals
    image = record.images[columns.image[suspect.row]].name
    return line[image, record.points[columns.point[suspect.row]].name]
