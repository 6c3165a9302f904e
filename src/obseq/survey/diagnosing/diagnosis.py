"""The diagnosis of a network: what is wrong, where, and by which slip."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgspec import structs

from obseq.dataclass import dataclass
from obseq.diagnosis.engine import Search, diagnose
from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.verdict import Status
from obseq.records.diagnosis import DiagnosisRecord
from obseq.survey.diagnosing.words import accused, rewriting_record

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.diagnosis.policy import Policy
    from obseq.diagnosis.verdict import Verdict
    from obseq.report.tables.units import Units
    from obseq.survey.causes.catalogue import Named
    from obseq.survey.diagnosing.network_model import NetworkModel
    from obseq.survey.initial.left_out import Determined
    from obseq.survey.model import FieldBook, Points


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
    policy: Policy = POLICY,
    told: Callable[[str], None] | None = None,
) -> DiagnosisRecord:
    """What is wrong with a network: single errors, groups, and what is only seen when values are rewritten.

    Args:
        model: The network.
        units: In which sizes are told.
        begin: Points and observations -> what can be computed of them, at initial values.
        policy: How it is judged.
        told: Receives how far the search is.
    """
    search = Search(model, policy, told)
    found = search.at_first()
    if found is not None:
        return Diagnosis(found, model, units).record()
    from obseq.survey.diagnosing.rewritings import best_rewriting

    search.at_rest()
    trial = best_rewriting(model, begin, is_many=search.count > policy.few)
    rest = (
        None if trial is None else Diagnosis(diagnose(trial.model, policy, told), trial.model, units).record()
    )
    if trial is None or rest is None:
        return Diagnosis(search.patiently(), model, units).record()
    status = "explained" if rest.status == "accepted" else rest.status
    one = rewriting_record(trial.rewriting, trial.others, model.notes)
    both = structs.replace(rest, status=status, accused=(one, *rest.accused))
    is_explained = status == "explained"
    if is_explained and trial.rewriting.count > policy.few >= len(rest.accused):
        return both
    verdict = search.patiently()
    own = Diagnosis(verdict, model, units).record()
    if verdict.status is Status.EXPLAINED and len(verdict.accused) <= policy.few:
        return own
    is_better = is_explained or rest.left < policy.whole * own.left
    count = max(len(verdict.accused), verdict.many, search.count)
    return both if is_better and len(rest.accused) < count else own
