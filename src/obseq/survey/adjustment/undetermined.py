"""What the observations of a network leave undetermined, as motions of its points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares.diagnosis.free_motions import find_motions
from obseq.records.adjustment import MotionRecord

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from obseq.arrays import FloatArray
    from obseq.leastsquares.diagnosis.free_motions import Motion
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
    found = find_motions(normal.table, normal.free, normal.pattern, kernel)
    return tuple(_record(motion, rows, names) for motion in found)


def _record(motion: Motion, rows: Mapping[int, int], names: Sequence[str]) -> MotionRecord:
    rounded = np.round(motion.moves, DECIMALS) + 0.0
    moving = rounded.any(axis=1)
    moved = [names[rows[block]] for block in motion.points[moving].tolist()]
    return MotionRecord(motion.text, tuple(moved), tuple(map(tuple, rounded[moving].tolist())))


def directions(
    names: Sequence[str], unknowns: Sequence[str], kernel: FloatArray
) -> list[tuple[tuple[float, ...], ...]]:
    """Of each point, unit vectors along which it may move without any residual, the most undetermined first.

    Args:
        names: The points.
        unknowns: (n) names of unknowns, such as "P.x".
        kernel: (n, k) what the vectors of the kernel do to them.
    """
    rows = {unknown: row for row, unknown in enumerate(unknowns)}
    at = np.array([[rows.get(f"{name}.{axis}", -1) for axis in "xyz"] for name in names]).reshape(-1, 3)
    moved = np.where(at[:, :, None] >= 0, kernel[at], 0.0)
    least = LEAST * np.abs(kernel).max(initial=0.0)
    return [_axes(one, least) for one in moved]


def _axes(moved: FloatArray, least: float) -> tuple[tuple[float, ...], ...]:
    """Unit vectors along the columns (3, k) of what moves a point by more than the least."""
    axes, sizes, _ = np.linalg.svd(moved, full_matrices=False)
    return tuple(map(tuple, (np.round(axes[:, sizes > least].T, DECIMALS) + 0.0).tolist()))
