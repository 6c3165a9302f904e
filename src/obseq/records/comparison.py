"""The record of a comparison of two epochs; its plain form is `comparison.json`. Metres and radians."""

from __future__ import annotations

from typing import Any

from obseq.records.adjustment import EllipseRecord, RunRecord
from obseq.records.record import Record, to_plain
from obseq.records.shown_units import METRIC, ShownUnits

FORMAT = "obseq-comparison"
VERSION = 1


class TestRecord(Record, frozen=True):
    """A test: its statistic, the limit at the level, and what is beyond it.

    Attributes:
        statistic: Fisher's F, or chi-square over its freedom when the sigmas are trusted.
        freedom: of the numerator.
        limit: of the statistic at the level.
        p_value: probability of a larger one where nothing has moved.
        passed: whether the statistic is within the limit.
    """

    statistic: float
    freedom: int
    limit: float
    p_value: float
    passed: bool


class DisplacementRecord(Record, frozen=True):
    """How a point has moved, second epoch minus first, along east, north and up of its place.

    Attributes:
        point: its name.
        x: in the frame, of the first epoch, as y and z; m. What is upwards is None where an epoch does not
            observe the height.
        east: m, as north and up.
        s_east: standard deviation, m, as s_north and s_up.
        length: m, in space, or in plan.
        ellipse: of the displacement in plan, at the level of the comparison.
        test: None for a point that is held in both epochs.
        is_reference: whether it belongs to the points that are taken to have stayed.
        is_significant: whether it has moved, all points judged together; False too where the comparison has
            obstacles.
        is_marginal: whether only its own test says so, as some do by chance.
        overall: probability of a test as large at any of the points, where none has moved (Holm); None for
            points that are not tested one by one.
    """

    point: str
    x: float
    y: float
    z: float | None
    east: float
    north: float
    up: float | None
    s_east: float
    s_north: float
    s_up: float | None
    length: float
    ellipse: EllipseRecord
    test: TestRecord | None
    is_reference: bool
    is_significant: bool
    is_marginal: bool = False
    overall: float | None = None


class ComparisonRecord(Record, frozen=True, omit_defaults=False):
    """Two epochs compared.

    Attributes:
        level: of each test: probability that it finds a movement where there is none.
        datum: "as adjusted"; "reference points", or "known points" of which others have moved: displacements
            are relative to these.
        congruence: of all points that are tested together.
        moved: reference or known points that were found to have moved, in the order in which that was found.
        undecided: reference or known points some of which have moved, and nothing tells which.
        displacements: of the common points, the most significant first.
        only_first: points of the first epoch alone.
        only_second: points of the second epoch alone.
        sigma0: of the two epochs together; None when the sigmas are trusted.
        redundancy: of the two together.
        same_precision: test of the two variance factors against each other; None where one is undefined.
        runs: which runs adjusted the epochs.
        obstacles: why there is no verdict: what the tests say means nothing until these are mended.
        reservations: what weakens the verdict.
        incomplete: numbers of the epochs, from 1, that leave something out or did not converge.
        units: of the summary; what is here is in metres and radians.
    """

    level: float
    datum: str
    congruence: TestRecord
    moved: tuple[str, ...]
    displacements: tuple[DisplacementRecord, ...]
    only_first: tuple[str, ...]
    only_second: tuple[str, ...]
    sigma0: float | None
    redundancy: int
    same_precision: TestRecord | None
    frame: str
    runs: tuple[RunRecord, RunRecord]
    obstacles: tuple[str, ...] = ()
    reservations: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()
    incomplete: tuple[int, ...] = ()
    units: ShownUnits = METRIC
    format: str = FORMAT
    version: int = VERSION

    def to_dict(self) -> dict[str, Any]:
        """The plain form: what the file holds."""
        return to_plain(self)
