"""The diagnosis of a network: what is wrong, where, and by which slip."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.dataclass import dataclass
from obseq.diagnosis.engine import diagnose
from obseq.diagnosis_record import DiagnosisRecord
from obseq.survey.diagnosing.words import accused

if TYPE_CHECKING:
    from obseq.diagnosis.verdict import Verdict
    from obseq.report.units import Units
    from obseq.survey.causes.catalogue import Named
    from obseq.survey.diagnosing.network_model import NetworkModel


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
        catalogue = self.model.catalogue if verdict.accused else None
        told = (accused(one, catalogue, self.units) for one in verdict.accused if catalogue is not None)
        return DiagnosisRecord(
            verdict.status.value, float(verdict.left), int(verdict.redundancy), tuple(told), verdict.reason
        )

    def named(self) -> list[Named]:
        """What is accused."""
        return [self.model.catalogue.named(one.change.index) for one in self.verdict.accused]


def diagnosis_of(model: NetworkModel, units: Units) -> Diagnosis:
    """The diagnosis of a network."""
    return Diagnosis(diagnose(model), model, units)
