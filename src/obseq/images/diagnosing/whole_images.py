"""Whole images that contradict the others in a large block: too many equations to solve for each.

A robust start tells them: most of what was measured in them is far off there. The block without them tells
what else is wrong.
"""

from __future__ import annotations

import numpy as np
from msgspec import structs

from obseq.arrays import IntArray
from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.protocol import Change
from obseq.diagnosis.verdict import Status
from obseq.images.causes.evidence import Evidence
from obseq.images.causes.images import IMAGE
from obseq.images.diagnosing.model import BlockModel, Place
from obseq.leastsquares.statistics.distributions import chi_square_limit
from obseq.records.diagnosis import AccusedRecord, DiagnosisRecord, SlipRecord

_HALF = 0.5
"""Share of the images that may be wrong: of more, the others might as well be."""


def images_off(model: BlockModel, place: Place) -> IntArray:
    """Images most of whose points are far off at a robust place; none where they are half of the block."""
    numbering = model.numbering
    off = model.off(place) > POLICY.suspect
    count = len(numbering.equations.centres)
    known = np.bincount(numbering.image[numbering.kept], minlength=count)
    far = np.bincount(numbering.image[numbering.kept], off[numbering.kept], minlength=count)
    found = np.flatnonzero((known > 1) & (far >= POLICY.whole * np.maximum(known, 1)))
    return found if len(found) < _HALF * np.count_nonzero(known) else found[:0]


def with_images(
    record: DiagnosisRecord, model: BlockModel, images: IntArray, before: float
) -> DiagnosisRecord:
    """What was found without some images, with these accused.

    Args:
        record: of the block without them.
        model: the block.
        images: positions of the images.
        before: the sum of squares with them.
    """
    evidence, none = Evidence.of(model.numbering), np.zeros(0)
    accused = []
    for image in images.tolist():
        found = list(IMAGE.slips(evidence, (image,), Change(0, none, none)))
        what = IMAGE.words(model.numbering, (image,))
        told = "".join(f"; {slip.text}" for slip in found[:1])
        points = int(np.count_nonzero(model.numbering.image[model.numbering.kept] == image))
        accused.append(
            AccusedRecord(
                IMAGE.code,
                what,
                images=(evidence.poses.images[image],),
                text=f"{what} is wrong{told}",
                test=(before - record.left) / len(images),
                limit=chi_square_limit(2 * points, above=POLICY.false_alarm),
                slips=tuple(SlipRecord(slip.code, slip.text) for slip in found),
            )
        )
    status = Status.EXPLAINED.value if record.status == Status.ACCEPTED else record.status
    return structs.replace(record, status=status, accused=(*accused, *record.accused))
