"""Data snooping: an adjustment without the observations that a diagnosis accuses."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from msgspec import structs

from obseq.arrays import BoolArray
from obseq.dataclass import dataclass
from obseq.diagnosis.policy import POLICY, Policy
from obseq.leastsquares.statistics.hypothesis_tests import non_centrality
from obseq.leastsquares.statistics.joint_levels import joint_p_value
from obseq.records.diagnosis import AccusedRecord, DiagnosisRecord
from obseq.records.quality import RejectionRecord, SnoopingRecord
from obseq.survey.adjustment.adjusted import Adjustment
from obseq.survey.adjustment.quality import Quality
from obseq.survey.model import FieldBook

Diagnose = Callable[[Policy], DiagnosisRecord]

CLEAN = "no test rejects any more"
INSEPARABLE = "a test rejects, but cannot tell which of several observations is wrong"
SHARED = "a test rejects what is given or shared beforehand, which is corrected and not left out"
UNEXPLAINED = "the rest is rejected still: no error explains it"
NEEDED = "without what is accused, some unknowns are undetermined"
TAU = "tau"


@dataclass(frozen=True, eq=False)
class Snooped:
    """What snooping leaves out.

    Attributes:
        diagnosis: What is wrong.
        policy: By which that is judged.
        gone: Of the errors, those of which the observations are left out.
    """

    diagnosis: DiagnosisRecord
    policy: Policy
    gone: tuple[AccusedRecord, ...] = ()

    @property
    def kept(self) -> tuple[AccusedRecord, ...]:
        """The others."""
        return tuple(one for one in self.diagnosis.accused if one not in self.gone)

    def rows(self, n: int) -> BoolArray:
        """(n,) the observations that are left out."""
        mask = np.zeros(n, np.bool_)
        mask[[place.row for one in self.gone for place in one.observations]] = True
        return mask


def snooped(diagnose: Diagnose, wanted: Quality, factor: Callable[[], float]) -> Snooped:
    """What is to be left out of a network: the observations of errors that are told from all others.

    Args:
        diagnose: What is wrong with the network, judged by a policy.
        wanted: By which test, and at which level: with "tau" the variance factor is that of what remains.
        factor: Of the sigmas, where errors take no part in it.
    """
    policy = replace(POLICY, false_alarm=wanted.snooping_level)
    if wanted.snooping != TAU or not (variance := factor()):
        found = diagnose(policy)
        return Snooped(found, policy, tuple(filter(_is_left_out, found.accused)))
    policy = replace(policy, variance=variance)
    found = diagnose(policy)
    if not all(map(partial(_is_sure, found), found.accused)):  # Pope's tau: chance alone does as much
        found = structs.replace(found, accused=())
    return Snooped(found, policy, tuple(filter(_is_left_out, found.accused)))


def _is_sure(found: DiagnosisRecord, one: AccusedRecord) -> bool:
    """Whether the test of an error is beyond its limit with the variance factor of what remains."""
    degrees = max(len(one.size), 1)
    spare = found.redundancy + degrees
    ratio = one.test * spare / (one.test + found.left)
    return joint_p_value(ratio, degrees, spare) < joint_p_value(one.limit, degrees)


def _is_left_out(one: AccusedRecord) -> bool:
    """Whether an error is one of observations, the same ones whatever else may explain it."""
    own = {place.row for place in one.observations}
    others = all(not it.points and own >= {place.row for place in it.observations} for it in one.others)
    return bool(own) and not one.points and bool(one.test) and others


def snooping_record(
    of: Snooped, wanted: Quality, book: FieldBook, before: Adjustment, after: Adjustment, *, is_needed: bool
) -> SnoopingRecord:
    """What is told of it.

    Args:
        of: What was left out.
        wanted: By which test, and at which level.
        book: The observations.
        before: The adjustment with everything in it.
        after: That without.
        is_needed: Whether what is accused was kept since unknowns depend on it.
    """
    moved = np.linalg.norm(after.points.coordinates - before.points.coordinates, axis=1) if of.gone else None
    most = 0 if moved is None or not np.isfinite(moved).all() else int(np.argmax(moved))
    is_known = moved is not None and bool(np.isfinite(moved).all())
    return SnoopingRecord(
        wanted.snooping or "",
        wanted.snooping_level,
        NEEDED if is_needed else _end(of),
        tuple(one.what for one in of.kept),
        tuple(_rejection(one, of.policy, book) for one in of.gone),
        after.points.names[most] if is_known else None,
        float(moved[most]) if moved is not None and is_known else None,
    )


def _end(of: Snooped) -> str:
    """Why nothing more is left out."""
    if any(one.others for one in of.kept):
        return INSEPARABLE
    if of.kept:
        return SHARED
    return CLEAN if of.diagnosis.status in ("accepted", "explained") else UNEXPLAINED


def _rejection(one: AccusedRecord, policy: Policy, book: FieldBook) -> RejectionRecord:
    """One error that is left out: the first of its observations, with its companions."""
    degrees, row = len(one.size), one.observations[0].row
    alone = joint_p_value(one.limit, degrees)
    tests = math.log1p(-policy.false_alarm) / math.log1p(-alone)
    is_single = degrees == 1
    return RejectionRecord(
        observation=book.label(row),
        row=row,
        statistic=one.test**0.5 if is_single else one.test,
        p_value=-math.expm1(tests * math.log1p(-min(joint_p_value(one.test, degrees), 1.0 - 1e-12))),
        blunder=one.size[0],
        detectable=non_centrality(alone, policy.power) * one.sigma[0] if is_single else None,
        companions=len(one.observations) - 1,
        degrees=degrees,
        critical=None if is_single else one.limit,
        blunders=() if is_single else one.size,
    )
