"""How the image points of a block control each other, in numbers that a file holds."""

from __future__ import annotations

import math

import numpy as np

from obseq.arrays import FloatArray
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.diagnosing.largest_tests import LargestTestsRecord, largest_tests
from obseq.records.record import Record

POOR = 0.1
"""Redundancy number below which the others hardly control a measure."""


class TestColumns(Record, frozen=True):
    """The tests of all image points, in the rows of the residuals of the record.

    Attributes:
        redundancy_x: redundancy numbers of columns; `redundancy_y` of lines.
        w_x: standardised residuals of columns, None where nothing controls them; `w_y` of lines.
        detectable_x: smallest blunders that the test finds, pixels, None the same; `detectable_y` of lines.
    """

    redundancy_x: tuple[float, ...]
    redundancy_y: tuple[float, ...]
    w_x: tuple[float | None, ...]
    w_y: tuple[float | None, ...]
    detectable_x: tuple[float | None, ...]
    detectable_y: tuple[float | None, ...]


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
        all: the tests of all of them.
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
    all: TestColumns
    largest: LargestTestsRecord


def reliability_record(solution: BundleSolution) -> BlockReliabilityRecord:
    """The reliability of a solution with covariances."""
    found = solution.reliability()
    whole, tested = found.whole, np.isfinite(found.w)
    return BlockReliabilityRecord(
        whole.level,
        whole.power,
        whole.w_critical,
        float(found.redundancy.sum()),
        int(np.count_nonzero(tested)),
        int(np.count_nonzero(np.abs(found.w[tested]) > whole.w_critical)),
        int(np.count_nonzero(found.redundancy < POOR)),
        int(np.count_nonzero(~tested)),
        TestColumns(
            *map(tuple, found.redundancy.T.tolist()),
            *(_defined(column) for column in (*found.w.T, *found.detectable.T)),
        ),
        largest_tests(solution, whole),
    )


def _defined(values: FloatArray) -> tuple[float | None, ...]:
    return tuple(value if math.isfinite(value) else None for value in values.tolist())
