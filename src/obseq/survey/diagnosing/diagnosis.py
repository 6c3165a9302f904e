"""The diagnosis of a network: what is wrong, where, and by which slip."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgspec import structs

from obseq.dataclass import dataclass
from obseq.diagnosis.engine import diagnose
from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.verdict import Status
from obseq.records.diagnosis import DiagnosisRecord
from obseq.survey.diagnosing.words import accused, rewriting_record

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.diagnosis.policy import Policy
    from obseq.diagnosis.verdict import Verdict
    from obseq.report.units import Units
    from obseq.survey.causes.catalogue import Named
    from obseq.survey.diagnosing.network_model import NetworkModel
    from obseq.survey.initial.left_out import Determined
    from obseq.survey.model import FieldBook, Points

_FEW = 3
"""Errors that are told one by one before it is asked whether many values share a mistake."""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What was found.

    Attributes:
        verdict: What the engine says.
        model: The network that it was asked about.
        units: In which sizes are told.
    """

    verdict: Verdict
    model: NetworkModel
    units: Units

    def record(self) -> DiagnosisRecord:
        """What the result holds of it."""
        verdict = self.verdict
        told, remarks = (
            tuple(accused(one, self.model.catalogue, self.units) for one in some)
            for some in (verdict.accused, verdict.remarks)
        )
        left, redundancy = float(verdict.left), int(verdict.redundancy)
        return DiagnosisRecord(verdict.status.value, left, redundancy, told, verdict.reason, remarks)

    def named(self) -> list[Named]:
        """What is accused."""
        return [self.model.catalogue.named(one.change.index) for one in self.verdict.accused]


def record_of(
    model: NetworkModel,
    units: Units,
    begin: Callable[[Points, FieldBook], Determined],
    of: Callable[[Determined], NetworkModel],
    policy: Policy = POLICY,
    told: Callable[[str], None] | None = None,
) -> DiagnosisRecord:
    """What is wrong with a network: single errors, groups, and what is only seen when values are rewritten.

    Args:
        model: The network.
        units: In which sizes are told.
        begin: Points and observations -> what can be computed of them, at initial values.
        of: Such a network -> its model.
        policy: How it is judged.
        told: Receives how far the search is.
    """
    found = diagnosis_of(model, units, policy, is_patient=False, told=told)
    count = max(len(found.verdict.accused), found.verdict.many)
    if found.verdict.status in (Status.ACCEPTED, Status.EXPLAINED) and count <= _FEW:
        return found.record()
    from obseq.survey.diagnosing.rewritings import best_rewriting

    trial = best_rewriting(model, begin, of, is_many=count > _FEW)
    rest = None if trial is None else diagnosis_of(of(trial.start), units, policy, told=told).record()
    if found.verdict.many and (rest is None or rest.status not in ("accepted", "explained")):
        found = diagnosis_of(model, units, policy, told=told)
        count = max(len(found.verdict.accused), found.verdict.many)
    own = found.record()
    if trial is None or rest is None:
        return own
    is_better = rest.status in ("accepted", "explained") or rest.left < POLICY.whole * own.left
    if not is_better or len(rest.accused) >= max(count, 1):
        return own
    status = "explained" if rest.status == "accepted" else rest.status
    one = rewriting_record(trial.rewriting, trial.others, model.notes)
    return structs.replace(rest, status=status, accused=(one, *rest.accused))


def diagnosis_of(
    model: NetworkModel,
    units: Units,
    policy: Policy = POLICY,
    *,
    is_patient: bool = True,
    told: Callable[[str], None] | None = None,
) -> Diagnosis:
    """The diagnosis of a network."""
    return Diagnosis(diagnose(model, policy, is_patient=is_patient, told=told), model, units)
