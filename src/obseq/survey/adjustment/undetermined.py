"""What the observations of a network leave undetermined, as motions of its points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares.diagnosis.motions import motions
from obseq.record import MotionRecord

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from obseq.arrays import FloatArray
    from obseq.leastsquares.diagnosis.motions import Motion
    from obseq.survey.adjustment.equations import Equations

DECIMALS = 4
"""Of moves, whose largest is 1."""

LEAST = 1e-3
"""Share of the largest direction from which a point is said to move along another."""


def free_motions(equations: Equations, names: Sequence[str]) -> tuple[MotionRecord, ...]:
    """The motions that the datum of a free network takes away; none where known points hold it."""
    system = equations.system
    if not system.datum_defect:
        return ()
    analysis = system.analysis(reduced=True)
    normal = analysis.equations
    rows = {block: row for row, block in enumerate(equations.points.tolist())}
    kernel = analysis.solver.null_vectors()
    found = motions(normal.table, normal.free, normal.pattern, kernel)
    return tuple(_record(motion, rows, names) for motion in found)


def _record(motion: Motion, rows: Mapping[int, int], names: Sequence[str]) -> MotionRecord:
    rounded = np.round(motion.moves, DECIMALS) + 0.0
    moving = rounded.any(axis=1)
    moved = [names[rows[block]] for block in motion.points[moving].tolist()]
    return MotionRecord(motion.text, tuple(moved), tuple(map(tuple, rounded[moving].tolist())))


def directions(name: str, unknowns: Sequence[str], kernel: FloatArray) -> tuple[tuple[float, ...], ...]:
    """Unit vectors along which a point may move without any residual, the most undetermined first.

    Args:
        name: The point.
        unknowns: (n) names of unknowns, such as "P.x".
        kernel: (n, k) what the vectors of the kernel do to them.
    """
    rows = {unknown: row for row, unknown in enumerate(unknowns)}
    at = [rows.get(f"{name}.{axis}") for axis in "xyz"]
    moved = np.array([np.zeros(kernel.shape[1]) if row is None else kernel[row] for row in at])
    axes, sizes, _ = np.linalg.svd(moved, full_matrices=False)
    kept = axes[:, sizes > LEAST * np.abs(kernel).max(initial=0.0)]
    return tuple(map(tuple, (np.round(kept.T, DECIMALS) + 0.0).tolist()))
