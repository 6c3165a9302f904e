"""How the image points of a block control each other, in numbers that a file holds."""

from __future__ import annotations

import numpy as np

from obseq.images.adjustment.solution import BundleSolution
from obseq.images.diagnosing.largest_tests import LargestTestsRecord, largest_tests
from obseq.records.columns import Column
from obseq.records.record import Record

POOR = 0.1
"""Redundancy number below which the others hardly control a measure."""


class BlockReliabilityRecord(Record, frozen=True):
    """The reliability of the image points of a block.

    Attributes:
        level: of the test of one coordinate; `power` is that of finding a detectable blunder.
        critical: limit of |w|.
        redundancy: sum of the redundancy numbers of the image points.
        tested: coordinates that can be tested.
        beyond: of these, those beyond the limit.
        poor: coordinates with a redundancy number below a tenth.
        uncontrolled: coordinates that nothing controls.
        largest: the largest tests of the equations of all kinds.
    """

    level: float
    power: float
    critical: float
    redundancy: float
    tested: int
    beyond: int
    poor: int
    uncontrolled: int
    largest: LargestTestsRecord


def reliability_of(solution: BundleSolution) -> tuple[BlockReliabilityRecord, dict[str, Column]]:
    """The reliability of a solution with covariances, and the columns of the tests of its image points."""
    found = solution.reliability()
    whole, tested = found.whole, np.isfinite(found.w)
    tests = {"w": found.w, "redundancy": found.redundancy, "detectable": found.detectable}
    columns: dict[str, Column] = {
        f"{name}_{axis}": np.where(np.isfinite(of), of, np.nan)
        for name, values in tests.items()
        for axis, of in zip("xy", values.T, strict=True)
    }
    record = BlockReliabilityRecord(
        whole.level,
        whole.power,
        whole.w_critical,
        float(found.redundancy.sum()),
        int(np.count_nonzero(tested)),
        int(np.count_nonzero(np.abs(found.w[tested]) > whole.w_critical)),
        int(np.count_nonzero(found.redundancy < POOR)),
        int(np.count_nonzero(~tested)),
        largest_tests(solution, whole),
    )
    return record, columns
