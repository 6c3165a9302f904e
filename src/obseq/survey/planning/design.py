"""The plan of a network: precisions and reliability before anything is measured."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from msgspec import structs

from obseq.arguments import FUNCTION, NOTHING, NUMBER, SEED, TRUTH, WHOLE, WORDS, expecting, instance
from obseq.arrays import BoolArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.records.adjustment import AdjustmentRecord, ConstraintRecord
from obseq.records.plan import DrawsRecord, GainRecord, PlanRecord, WeakObservationRecord, WeakPointRecord
from obseq.records.rows import Rows
from obseq.stopwatch import Progress
from obseq.survey.adjustment.adjusted import Adjustment
from obseq.survey.adjustment.adjusted_records import finite_number
from obseq.survey.adjustment.quality import Quality
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.network import Network
from obseq.survey.planning.gains import candidates, gains
from obseq.survey.planning.simulation import Simulation, compared, draw, placed

WEAKEST = 10
NOTE = (
    "planned, not measured: values are exact at the given coordinates, precisions those of the given sigmas"
)
UNCONTROLLED = 0.3
"""Redundancy below which an observation is listed as weakly controlled."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What a network is worth before it is measured.

    Attributes:
        adjustment: of exact observations, with a priori precisions and reliability.
        gains: what one more observation would bring, the best first.
        candidates: how many were tried.
        draws: the check by drawn observations; None when there was none.
        network: what was planned.
    """

    adjustment: Adjustment
    gains: tuple[GainRecord, ...]
    candidates: int
    draws: DrawsRecord | None
    network: Network

    def weakest_points(self, most: int = WEAKEST) -> tuple[WeakPointRecord, ...]:
        """The points that are known worst, with the direction in which they are."""
        points = self.adjustment.points
        verticals = self.network.frame.vertical(points.coordinates)
        turned = verticals @ points.covariances @ verticals.transpose(0, 2, 1)
        values, vectors = np.linalg.eigh(turned)
        order = np.argsort(-values[:, -1], kind="stable")[:most]
        return tuple(
            _weak_point(points.names[row], values[row, -1], vectors[row, :, -1])
            for row in order
            if values[row, -1] > 0.0
        )

    def weakest_observations(self, most: int = WEAKEST) -> tuple[WeakObservationRecord, ...]:
        """The observations that the others control least."""
        numbers, book = self.adjustment.quality.observations, self.adjustment.book
        if numbers is None:
            return ()
        redundancy = np.where(book.observations.active, numbers.redundancy, np.inf)
        order = np.argsort(redundancy, kind="stable")[:most]
        return tuple(
            WeakObservationRecord(
                observation=book.label(int(row)),
                redundancy=max(float(redundancy[row]), 0.0),
                detectable=finite_number(numbers.detectable[row]),
                unit=BY_CODE[int(book.observations.types[row])].unit,
                external=finite_number(numbers.external[row]),
            )
            for row in order
            if redundancy[row] < UNCONTROLLED
        )

    def record(self, most: int = WEAKEST) -> PlanRecord:
        """What the result file holds and the summary prints."""
        return PlanRecord(
            adjustment=_unmeasured(self.adjustment.record()),
            weakest_points=self.weakest_points(most),
            weakest_observations=self.weakest_observations(most),
            gains=self.gains[:most],
            candidates=self.candidates,
            draws=self.draws,
        )


@expecting(
    network=instance(Network),
    quality=instance(Quality) | NOTHING,
    with_gains=TRUTH,
    farthest=NUMBER | NOTHING,
    counted=WORDS | NOTHING,
    draws=WHOLE,
    seed=SEED,
    progress=FUNCTION | NOTHING,
)
def plan(
    network: Network,
    quality: Quality | None = None,
    *,
    with_gains: bool = True,
    farthest: float | None = None,
    counted: Collection[str] | None = None,
    draws: int = 0,
    seed: int = 0,
    progress: Progress | None = None,
) -> Plan:
    """What a network would be worth if it were measured as intended.

    Args:
        network: Points with approximate coordinates, and the intended observations with their sigmas. Where
            all points have coordinates, the values of the observations do not count; otherwise they place the
            points, as in a network that is measured and may get more observations. Placeholders (0 0 0, or
            several points at one place, which the observations contradict) are no coordinates.
        quality: What is wanted beside precisions; reliability by default. Precisions are a priori.
        with_gains: Whether to rank what one more observation of the kinds of the plan would bring.
        farthest: Longest sight of such an observation, m; by default the longest of the plan.
        counted: Names of the points whose precision ranks them; all by default.
        draws: How many times to adjust drawn observations, as a check of the predicted precisions.
        seed: Of the random numbers of these.
        progress: Receives what is being done.

    Raises:
        InputError: Points have no coordinates and are not placed by observations, a name is unknown, or the
            number of draws is negative.
        SingularSystemError: The observations do not determine some unknowns, which the message names.
    """
    if draws < 0:
        raise InputError(
            f"plan: draws={draws}; give 0 for none, or how many times to adjust drawn observations"
        )
    given, network = network, placed(network)
    network = replace(network, points=network.fieldwork.points)  # heights that nothing observes are none
    simulation = Simulation(network)
    mask = _mask(network, counted)
    wanted = replace(
        quality or Quality(), a_priori=True, inner=True, snooping=None, variance_components=False
    )
    exact = simulation.without_errors()
    adjustment = exact.adjust(start=simulation.truth, quality=wanted, progress=progress)
    adjustment = replace(adjustment, notes=(*_notes(given), *adjustment.notes))
    ranked: list[GainRecord] = []
    count = 0
    if with_gains and not adjustment.left_out and (network.points.sigmas != 0.0).any():
        tried = candidates(exact, farthest)
        count = len(tried)
        if count:
            ranked = gains(tried, simulation.truth, mask)
    check = None
    if draws and not adjustment.left_out:
        check = compared(draw(simulation, draws, seed, progress), adjustment, seed)
    return Plan(adjustment, tuple(ranked), count, check, network)


def _unmeasured(record: AdjustmentRecord) -> AdjustmentRecord:
    """The record without residuals and what is judged by them: exact observations have none."""
    return structs.replace(
        record,
        planned=True,
        sigma0=None,
        variance_factor=None,
        global_test=None,
        diagnosis=None,
        types=None,
        setups=None,
        joint=(),
        constraints=Rows(ConstraintRecord),
        iterations=(),
        points=record.points.without("moved"),
        observations=record.observations.without(
            "residual", "normalised_residual", "standardised_residual", "tau", "blunder"
        ),
    )


def _notes(given: Network) -> list[str]:
    """What a reader of the plan should know."""
    lacking = int(np.count_nonzero(~given.points.has_coordinates))
    where = f"{lacking} points had no coordinates: the plan is where the observed values place them"
    return [NOTE, where] if lacking else [NOTE]


def _mask(network: Network, counted: Collection[str] | None) -> BoolArray:
    names = network.points.names
    if counted is None:
        return np.ones(len(names), np.bool_)
    unknown = sorted(set(counted) - set(names))
    if unknown:
        raise InputError(f"plan: unknown point {', '.join(unknown)} among those whose precision counts")
    return np.array([name in set(counted) for name in names], np.bool_)


def _weak_point(name: str, variance: float, direction: np.ndarray) -> WeakPointRecord:
    east, north, up = direction if direction[2] >= 0.0 else -direction
    horizontal = float(np.hypot(east, north))
    azimuth = float(np.arctan2(east, north)) % (2.0 * np.pi)
    return WeakPointRecord(name, float(np.sqrt(variance)), azimuth, float(np.arctan2(up, horizontal)))
