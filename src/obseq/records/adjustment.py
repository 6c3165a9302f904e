"""The record of an adjustment: what is computed once, written to the result file, printed by every report.

Its plain form is the result file (format "obseq-adjustment", version 1; docs/result-file.md). Metres and
radians. A number that is not defined (a precision when sigma0 cannot be computed, for instance) is None, and
null in the file.
"""

from __future__ import annotations

import functools
import math
import os
from collections import Counter
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import msgspec

from obseq.errors import InputError
from obseq.packages import version
from obseq.printable import printable_line
from obseq.records import one_point
from obseq.records.diagnosis import AccusedRecord, DiagnosisRecord
from obseq.records.quality import (
    DoubtfulRecord,
    EffectRecord,
    EllipseRecord,
    EllipsoidRecord,
    GlobalTestRecord,
    JointTestRecord,
    LeftOutRecord,
    MotionRecord,
    RejectionRecord,
    RelativeRecord,
    ReliabilityRecord,
    ReplacedRecord,
    SnoopingRecord,
    StatisticsRecord,
    UnusedRecord,
    VarianceComponentRecord,
)
from obseq.records.record import Record, from_plain, to_plain
from obseq.records.rows import Rows, hold_as_columns
from obseq.records.shown_units import METRIC, ShownUnits
from obseq.records.table import AnyTable, table_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from obseq.arrays import FloatArray

FORMAT = "obseq-adjustment"
VERSION = 1
__all__ = [
    "AccusedRecord",
    "AdjustmentRecord",
    "ConstraintRecord",
    "DiagnosisRecord",
    "DoubtfulRecord",
    "EffectRecord",
    "EllipseRecord",
    "EllipsoidRecord",
    "GlobalTestRecord",
    "IterationRecord",
    "JointTestRecord",
    "LeftOutRecord",
    "MotionRecord",
    "ObservationRecord",
    "OperationRecord",
    "PhaseRecord",
    "PointRecord",
    "RejectionRecord",
    "RelativeRecord",
    "ReliabilityRecord",
    "ReplacedRecord",
    "RunRecord",
    "SnoopingRecord",
    "StationRecord",
    "StatisticsRecord",
    "UnusedRecord",
    "VarianceComponentRecord",
    "defined",
    "new_run",
]

MAIN_PACKAGES = ("obseq", "numpy", "scipy", "numba", "pyproj")


class RunRecord(Record, frozen=True):
    """Which run of the program made a result: all files of one run carry the same identifier.

    Attributes:
        identifier: Twelve hexadecimal digits.
        created: Date and time, ISO 8601, UTC.
        versions: Of obseq and of what it computes with.
    """

    identifier: str
    created: str
    versions: dict[str, str]


class IterationRecord(Record, frozen=True):
    """One iteration: sigma0 of the residuals at its start, and its largest step (m or rad)."""

    sigma0: float | None
    max_step: float | None


class PointRecord(Record, frozen=True):
    """One point: x, y, z and their precisions in the computation frame, crs_* in the input system.

    What nobody gave and nothing observes is None: the plan of points that are levelled, heights in a plane.

    Attributes:
        covariance: xx, xy, xz, yy, yz, zz in the computation frame (m^2).
        crs_sx: Precision (m), as crs_sy and crs_sz: along the axes of that system when it is in metres, or
            east, north and up.
        ellipse: In the computation frame.
        ellipsoid: In the computation frame; None when it was not asked for.
        known: Which of its coordinates are known, of "xyz"; those held fixed in capitals.
        moved: Adjusted minus given coordinates, in the computation frame (m); None where none were given.
        inner: Precisions of x, y, z when nothing is held but the datum is that of inner constraints (m);
            None when they were not asked for.
    """

    name: str
    x: float | None
    y: float | None
    z: float | None
    sx: float | None
    sy: float | None
    sz: float | None
    crs_x: float | None
    crs_y: float | None
    crs_z: float | None
    crs_sx: float | None = None
    crs_sy: float | None = None
    crs_sz: float | None = None
    covariance: tuple[float | None, ...] | None = None
    ellipse: EllipseRecord | None = None
    ellipsoid: EllipsoidRecord | None = None
    known: str | None = None
    moved: tuple[float | None, ...] | None = None
    inner: tuple[float, ...] | None = None

    @property
    def plan(self) -> tuple[float, float] | None:
        """X and y; None of a point that has no plan."""
        return None if self.x is None or self.y is None else (self.x, self.y)


class StationRecord(Record, frozen=True):
    """One station: its point, how it is oriented, and the azimuth of the zero of its circle (rad)."""

    origin: str
    orientation: str
    g0: float | None


class ObservationRecord(Record, frozen=True):
    """One observation, where it was read, and how it fits.

    Attributes:
        unit: Of value, sigma, residual, detectable and blunder: "m" or "rad".
        redundancy: How far the others control it: 0 not at all, 1 completely.
        standardised_residual: Residual over its own a priori standard deviation (Baarda's w).
        tau: Residual over its own a posteriori standard deviation (Pope's tau).
        detectable: Smallest bias that the test of w finds with the stated power; None when it finds none.
        external: Most that such a bias moves any coordinate, in its standard deviations.
        blunder: Estimate of the error of the value, if it were the only one; too large when positive.
        rejected: True when data snooping left it out.
        backsight: Of an angle, the point from which it counts.
        effect: What its detectable bias does to coordinates; None when it was not asked for.
        adjusted: What the adjusted coordinates give: value plus residual; None where it is not used.
        azimuth: Where a direction that is not used points, clockwise from y (rad); None of others.
    """

    type: str
    origin: str = msgspec.field(name="from")
    target: str = msgspec.field(name="to")
    value: float
    sigma: float
    residual: float | None
    normalised_residual: float | None
    file: str
    line: int
    active: bool
    unit: str | None = None
    redundancy: float | None = None
    standardised_residual: float | None = None
    tau: float | None = None
    detectable: float | None = None
    external: float | None = None
    blunder: float | None = None
    rejected: bool | None = None
    backsight: str | None = None
    effect: EffectRecord | None = None
    adjusted: float | None = None
    azimuth: float | None = None


class ConstraintRecord(Record, frozen=True):
    """A known coordinate: as given, in the unit of its system; sigma and residual (adjusted - given) in m."""

    point: str
    coordinate: str
    value: float
    sigma: float
    residual: float
    normalised_residual: float
    file: str
    line: int
    redundancy: float | None = None
    standardised_residual: float | None = None


class OperationRecord(Record, frozen=True):
    """The operation of PROJ between a coordinate system and geocentric WGS 84.

    Attributes:
        system: Definition of the system.
        description: What PROJ calls the operation.
        accuracy: As PROJ announces it (m); None where it does not.
    """

    system: str
    description: str
    accuracy: float | None = None


class PhaseRecord(Record, frozen=True):
    """How long a part of the work took."""

    name: str
    seconds: float


class AdjustmentRecord(Record, frozen=True, omit_defaults=False):
    """The whole adjustment.

    Attributes:
        variance_factor: Sum of all weighted squared residuals, those of known points included, over the
            redundancy.
        precision: "a posteriori": precisions are multiplied by the estimated sigma0; "a priori": not.
        points_crs_unit: Unit of crs_x and crs_y: "m" (also when absent), "degree", "grad", "kilometre", ...
        points_crs_height_unit: Unit of crs_z; metres when absent.
        points_crs_is_angular: Whether crs_x and crs_y are a longitude and a latitude.
        constraints: The known coordinates that have a sigma.
        notes: What was computed and how far it holds: refraction, validity of a plane frame.
        global_test: None without redundancy.
        reliability: Levels behind the reliability of observations; None when it was not asked for.
        snooping: None when it was not asked for.
        variance_components: None when they were not asked for.
        ellipse_level: Probability that the true point is inside its ellipse; None: standard ellipses, 39 %.
        relative: Pairs of points that observations join; None when it was not asked for.
        run: Which run made it.
        title: What the user calls it.
        files: The files it was made from.
        refraction: Coefficient of refraction of zenith angles.
        operations: How PROJ leads from the systems to the Earth.
        types: How the observations of each type fit.
        setups: How the observations from each point fit.
        diagnosis: What is wrong with it; None where nobody has looked.
        units: What the reports show; the numbers here are in metres and radians.
        undetermined: Motions that the datum of a free network takes away; None where known points hold it.
        doubtful: Points that converged, and of which the observations say next to nothing.
        unused: Observations of the files that take no part, though no file switches them off.
        planned: Whether nothing is measured yet: there are no residuals, nor what is judged by them.
        failures: What should explain the result, and failed: nobody has looked; among the warnings too.
        outside: What to say of points outside the area of their system, where errors are suspected.
        joint: Tests of vectors, and of positions that have a covariance, each as one observation.
    """

    n_observations: int
    n_constraints: int
    n_unknowns: int
    redundancy: int
    iterations: tuple[IterationRecord, ...]
    sigma0: float | None
    converged: bool
    frame: str
    points_crs: str
    points: Rows[PointRecord]
    stations: Rows[StationRecord]
    observations: Rows[ObservationRecord]
    variance_factor: float | None = None
    global_test: GlobalTestRecord | None = None
    reliability: ReliabilityRecord | None = None
    snooping: SnoopingRecord | None = None
    variance_components: tuple[VarianceComponentRecord, ...] | None = None
    ellipse_level: float | None = None
    relative: Rows[RelativeRecord] | None = None
    stop_reason: str | None = None
    precision: str | None = None
    points_crs_unit: str | None = None
    points_crs_height_unit: str | None = None
    points_crs_is_angular: bool | None = None
    constraints: Rows[ConstraintRecord] = msgspec.field(default_factory=lambda: Rows(ConstraintRecord))
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    left_out: tuple[LeftOutRecord, ...] = ()
    replaced: tuple[ReplacedRecord, ...] = ()
    diagnosis: DiagnosisRecord | None = None
    phases: tuple[PhaseRecord, ...] = ()
    run: RunRecord | None = None
    title: str | None = None
    files: tuple[str, ...] | None = None
    refraction: float | None = None
    operations: tuple[OperationRecord, ...] | None = None
    types: tuple[StatisticsRecord, ...] | None = None
    setups: tuple[StatisticsRecord, ...] | None = None
    undetermined: tuple[MotionRecord, ...] | None = None
    doubtful: tuple[DoubtfulRecord, ...] = ()
    unused: tuple[UnusedRecord, ...] = ()
    joint: tuple[JointTestRecord, ...] = ()
    failures: tuple[str, ...] = ()
    outside: str = ""
    planned: bool = False
    units: ShownUnits = METRIC
    format: str = FORMAT
    version: int = VERSION

    def __post_init__(self) -> None:
        hold_as_columns(self)

    @property
    def rejections(self) -> tuple[RejectionRecord, ...]:
        """What data snooping left out."""
        return () if self.snooping is None else self.snooping.rejections

    @property
    def gross_errors(self) -> tuple[AccusedRecord, ...]:
        """The errors that were found, the clearest first."""
        return () if self.diagnosis is None else self.diagnosis.accused

    @property
    def is_complete(self) -> bool:
        """Whether it converged, with all that was given, no error suspected and no point doubtful."""
        is_clean = (self.diagnosis is None or self.diagnosis.is_quiet) and not self.doubtful
        is_whole = not self.left_out and not self.unused and not self.rejections
        return self.converged and is_whole and is_clean and not self.failures

    def table(self, name: str = "points") -> AnyTable:
        """One of its lists as a table; see `obseq.records.table`."""
        return table_of(self, name)

    def covariance(self, name: str) -> FloatArray:
        """(3, 3) covariance of one point in the computation frame (m^2).

        Raises:
            InputError: There is no such point.
        """
        return one_point.covariance(self.points, name)

    def ellipse(self, name: str, level: float | None = 0.95) -> EllipseRecord:
        """The error ellipse of a point in x and y, at `ellipse_level`; see `records.one_point`."""
        return one_point.ellipse(self.points, name, level, self.ellipse_level)

    def to_dict(self) -> dict[str, Any]:
        """The plain form: what the result file holds."""
        return to_plain(self)

    @classmethod
    def from_dict(cls, plain: Any, what: str = "the record") -> AdjustmentRecord:
        """The record whose plain form is given, by this version or a later one that added fields.

        Raises:
            InputError: It is not the result of an adjustment, or something in it is not what it must be.
        """
        found = plain.get("format") if isinstance(plain, dict) else None
        if found != FORMAT:
            raise InputError(f"{what}: it is not the result of an adjustment (its format is not {FORMAT})")
        if plain.get("version") != VERSION:
            raise InputError(f"{what}: it has another version than {VERSION}; make it again with this obseq")
        record = from_plain(cls, plain, what)
        counts = Counter(record.points.values("name"))
        for name, count in counts.most_common(1):
            if count > 1:
                raise InputError(f"{what}: point {printable_line(name)} comes twice")
        return record


def defined(values: NDArray[np.float64]) -> list[float | None]:
    """(n,) numbers as a record holds them: None for what is not finite."""
    return [number if math.isfinite(number) else None for number in values.tolist()]


def new_run() -> RunRecord:
    """The record of a run that begins now."""
    created = datetime.now(UTC).isoformat(timespec="seconds")
    return RunRecord(os.urandom(6).hex(), created, dict(_versions()))


@functools.cache
def _versions() -> dict[str, str]:
    return {name: version(name) for name in MAIN_PACKAGES}
