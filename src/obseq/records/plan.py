"""The record of a plan: what a network is worth before it is measured; its plain form is `plan.json`.

Metres and radians; the precisions themselves stand in the record of the adjustment of exact observations.
"""

from __future__ import annotations

from typing import Any

from obseq.records.adjustment import AdjustmentRecord
from obseq.records.record import Record, to_plain

FORMAT = "obseq-plan"
VERSION = 1


class WeakPointRecord(Record, frozen=True):
    """A point and the direction in which it is known worst.

    Attributes:
        point: its name.
        sigma: standard deviation in that direction, m.
        azimuth: of the direction, rad clockwise from north.
        elevation: above the horizon, rad, from 0 to pi / 2.
    """

    point: str
    sigma: float
    azimuth: float
    elevation: float


class WeakObservationRecord(Record, frozen=True):
    """An observation whose mistake would not be noticed, or not soon.

    Attributes:
        observation: its kind, points, file and line.
        redundancy: from 0 (nothing controls it) to 1.
        detectable: smallest bias that the test finds, m or rad; None: none at all.
        unit: "m" or "rad".
        external: most that such a bias moves any coordinate, in its standard deviations.
    """

    observation: str
    redundancy: float
    detectable: float | None
    unit: str
    external: float | None


class GainRecord(Record, frozen=True):
    """What one more observation would bring.

    Attributes:
        type: kind of observation.
        origin: where the instrument stands.
        target: what is observed.
        sigma: m or rad.
        unit: "m" or "rad".
        before: root mean square of the standard deviations of all coordinates that count, m.
        after: the same with the observation.
        point: the point that gains most.
        point_before: root of the sum of its variances, m.
        point_after: the same with the observation.
    """

    type: str
    origin: str
    target: str
    sigma: float
    unit: str
    before: float
    after: float
    point: str
    point_before: float
    point_after: float


class DrawsRecord(Record, frozen=True):
    """Errors of adjustments of drawn observations, against the precisions that were predicted.

    Attributes:
        draws: how many adjustments.
        seed: of the random numbers.
        ratio: mean over points of squared errors over their prediction; 1 is expected.
        ratio_sigma: standard deviation of the ratio of one point.
        worst_point: the point that fits the prediction worst.
        worst_ratio: its ratio.
        p_value: probability of one that fits as badly, among so many points, where the prediction is right.
        agrees: whether that is above 0.1 %.
        sigma0: root of the mean of the squared sigma0 of the draws; 1 is expected. None without redundancy.
        failed: draws whose iterations did not converge; they do not count.
    """

    draws: int
    seed: int
    ratio: float
    ratio_sigma: float
    worst_point: str
    worst_ratio: float
    p_value: float
    agrees: bool
    sigma0: float | None
    failed: int


class PlanRecord(Record, frozen=True, omit_defaults=False):
    """A plan.

    Attributes:
        adjustment: of exact observations: precisions, reliability, ellipses.
        weakest_points: the least precise first.
        weakest_observations: the least controlled first.
        gains: what one more observation would bring, the best first.
        candidates: how many observations were tried for that.
        draws: None when there were none.
    """

    adjustment: AdjustmentRecord
    weakest_points: tuple[WeakPointRecord, ...]
    weakest_observations: tuple[WeakObservationRecord, ...]
    gains: tuple[GainRecord, ...] = ()
    candidates: int = 0
    draws: DrawsRecord | None = None
    format: str = FORMAT
    version: int = VERSION

    def to_dict(self) -> dict[str, Any]:
        """The plain form: what the file holds."""
        return to_plain(self)
