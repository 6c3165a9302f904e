"""Several gross errors: which data snooping leaves out one after the other, once one is suspected."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from obseq.errors import ObseqError
from obseq.report.units import units_of
from obseq.survey.kinds.registry import BY_CODE

if TYPE_CHECKING:
    from obseq.records.adjustment import RejectionRecord
    from obseq.report.units import Units
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.adjustment.computation import Computation
    from obseq.survey.initial.left_out import Determined

_LARGEST = 20_000
"""Observations up to which a network is adjusted again for that."""
_SHARE = 0.1
"""Share of the observations beyond which what is left out is no handful of gross errors."""
_LEVEL = 0.001
"""Level of the snooping, of all tests together."""


def one_after_the_other(
    computation: Computation, given: Determined, adjustment: Adjustment
) -> tuple[str, ...]:
    """A sentence that lists several gross errors in the order of their removal; none for fewer than two.

    They are told only where what remains is honest: where sigmas are wrong, snooping has no end. Nor where
    one known coordinate is suspected: snooping leaves out observations only, several of them for it.

    Args:
        computation: how the network was adjusted.
        given: the network.
        adjustment: what came out.
    """
    count = len(given.book.observations)
    asked = computation.quality.reliability and computation.quality.snooping is None
    suspicion = adjustment.suspicion
    if not asked or count > _LARGEST or suspicion is None or suspicion.may_be_known:
        return ()
    wanted = replace(computation.plain().quality, snooping="w", snooping_level=_LEVEL, reliability=True)
    try:
        cleaned = replace(computation, quality=wanted).determined(given, strict=True)
    except ObseqError:
        return ()
    record = cleaned.record()
    removed = record.rejections
    if not 2 <= len(removed) <= max(_SHARE * count, 2.0) or cleaned.suspicion is not None:
        return ()
    if record.global_test is None or not record.global_test.passed:
        return ()
    shown = units_of(record)
    listed = "; ".join(f"{k}. {_told(item, cleaned, shown)}" for k, item in enumerate(removed, 1))
    return (f"{len(removed)} gross errors, each found once those before it are left out: {listed}",)


def _told(item: RejectionRecord, cleaned: Adjustment, shown: Units) -> str:
    unit = BY_CODE[int(cleaned.book.observations.types[item.row])].unit
    size = shown.small(unit, item.blunder)
    return f"{item.observation}: off by about {size} (standardised residual {item.statistic:.2f})"
