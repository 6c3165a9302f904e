"""The check of a plan by chance: adjustments of drawn observations, against the predicted precisions."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq.errors import ObseqError
from obseq.leastsquares.statistics.distributions import chi_square_tails
from obseq.records.plan import DrawsRecord
from obseq.survey.equations.equations import Equations

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, FloatArray
    from obseq.stopwatch import Progress
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.planning.simulation import Simulation

LEVEL = 0.001
"""Probability of calling a right prediction wrong."""
RANK = 1e-9
"""Share of the largest variance of a point below which a direction counts as known."""
MAX_ITERATIONS = 10


class Drawn(NamedTuple):
    """What adjustments of drawn observations gave.

    Attributes:
        errors: (draws, n, 3) adjusted minus true coordinates, m.
        variance_factors: (draws,) squared sigma0; NaN without redundancy.
        failed: how many others did not converge.
    """

    errors: FloatArray
    variance_factors: FloatArray
    failed: int


def draw(simulation: Simulation, count: int, seed: int, progress: Progress | None = None) -> Drawn:
    """Adjusts drawn observations.

    Args:
        simulation: the network, whose coordinates count as true.
        count: number of draws.
        seed: of the random numbers.
        progress: receives how far it is.
    """
    rng = np.random.default_rng(seed)
    errors, factors = [], []
    for number in range(count):
        if progress is not None:
            progress(f"draw {number + 1} of {count}")
        found = _adjusted(simulation, rng)
        if found is not None:
            errors.append(found[0])
            factors.append(found[1])
    shape = (-1, len(simulation.network.points), 3)
    return Drawn(np.array(errors).reshape(shape), np.array(factors), count - len(errors))


def compared(drawn: Drawn, planned: Adjustment, seed: int) -> DrawsRecord:
    """Drawn errors against the precisions of a plan."""
    covariances = planned.points.covariances
    is_unknown = np.trace(covariances, axis1=1, axis2=2) > 0.0
    rows = np.flatnonzero(is_unknown & np.isfinite(covariances).all(axis=(1, 2)))
    inverses, ranks = _inverses(covariances[rows])
    count = len(drawn.errors)
    sums = np.einsum("dni,nij,dnj->n", drawn.errors[:, rows], inverses, drawn.errors[:, rows])
    single = np.array(
        [2.0 * min(chi_square_tails(s, count * rank)) for s, rank in zip(sums, ranks, strict=True)]
    )
    worst = int(np.argmin(single))
    p_value = float(-np.expm1(len(rows) * np.log1p(-min(float(single[worst]), 1.0 - 1e-16))))
    ratios = sums / (count * ranks)
    with_redundancy = np.isfinite(drawn.variance_factors).any()
    return DrawsRecord(
        draws=count + drawn.failed,
        seed=seed,
        ratio=float(ratios.mean()),
        ratio_sigma=float(np.sqrt(2.0 / (count * ranks.mean()))),
        worst_point=planned.points.names[rows[worst]],
        worst_ratio=float(ratios[worst]),
        p_value=p_value,
        agrees=p_value > LEVEL,
        sigma0=float(np.sqrt(np.nanmean(drawn.variance_factors))) if with_redundancy else None,
        failed=drawn.failed,
    )


def _adjusted(simulation: Simulation, rng: np.random.Generator) -> tuple[FloatArray, float] | None:
    """(n, 3) errors of the coordinates in one draw, and its variance factor; None if it did not converge."""
    network, start = simulation.drawn(rng), simulation.truth
    equations = Equations(network.frame, network.point_system, network.points, network.book, start)
    try:
        solution = equations.system.solve(
            max_iterations=MAX_ITERATIONS, before_iteration=equations.follow, strategy="controlled"
        )
    except ObseqError:
        return None
    if not solution.converged:
        return None
    factor = np.nan if solution.variance_factor is None else solution.variance_factor
    return solution.values(equations.points) - start.coordinates, factor


def _inverses(covariances: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Inverses (n, 3, 3) in the directions that are not known exactly, and how many these are."""
    values, vectors = np.linalg.eigh(covariances)
    free: BoolArray = values > RANK * values[:, -1:]
    inverted = np.where(free, 1.0 / np.where(free, values, 1.0), 0.0)
    return np.einsum("nij,nj,nkj->nik", vectors, inverted, vectors), free.sum(axis=1).astype(np.float64)
