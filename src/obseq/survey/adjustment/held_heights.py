"""Heights that nothing observes: which they are, and what another height would do to the plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares.assembly.evaluation import jacobian_rows
from obseq.printable import listed

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.adjustment.equations import Equations
    from obseq.survey.adjustment.point_system import PointSystem
    from obseq.survey.model import Points

HIGHER = 100.0
"""What heights are thought to be wrong by (m)."""
LEAST_MOVE = 1e-5
"""Movement (m) of which less is not told."""
MOST_NAMED = 10


def held_heights_note(equations: Equations, system: PointSystem, points: Points) -> tuple[str, ...]:
    """One sentence that counts and names the points without height; none where there are none."""
    rows = np.flatnonzero(points.is_free[:, 2] & points.is_invented[:, 2])
    if not rows.size:
        return ()
    names = listed([points.names[row] for row in rows.tolist()], MOST_NAMED)
    what = "1 point has" if rows.size == 1 else f"{rows.size} points have"
    move = float(np.hypot(*_leanings(equations, system, rows).T).max()) * HIGHER
    moves = f"by up to {move * 1e3:.2g} mm" if move > LEAST_MOVE else "by nothing that counts"
    return (
        f"{what} no height, which nothing observes: {names}. Their plan is adjusted, at heights of the site; "
        f"{HIGHER:g} m more would move it {moves}",
    )


def _leanings(equations: Equations, system: PointSystem, rows: IntArray) -> FloatArray:
    """(k, 2) what a metre of height moves points in the plan of their system, the others staying."""
    axes = system.axes(equations.system.values(equations.points[rows]))[0]
    normal = axes @ _normal_blocks(equations, rows) @ axes.transpose(0, 2, 1)
    inverse = np.linalg.pinv(normal[:, :2, :2], hermitian=True)
    return np.asarray(-np.einsum("kij,kj->ki", inverse, normal[:, :2, 2]))


def _normal_blocks(equations: Equations, rows: IntArray) -> FloatArray:
    """(k, 3, 3) blocks of points on the diagonal of the normal matrix, with what is held in them."""
    equations_of_all = equations.system.equations()
    table = equations_of_all.table
    place = np.full(len(table.values) + 1, -1)
    place[table.start[equations.points[rows]][:, None] + np.arange(3)] = np.arange(3 * len(rows)).reshape(
        -1, 3
    )
    found = np.zeros((len(rows), 3, 3))
    for batch in equations_of_all.batches:
        at = place[batch.scalars()]
        derivatives = jacobian_rows(table, batch)[1:] * batch.weights[0, : batch.n]
        for one, first in zip(at, derivatives, strict=True):
            for other, second in zip(at, derivatives, strict=True):
                both = (one >= 0) & (one // 3 == other // 3)
                np.add.at(found, (one[both] // 3, one[both] % 3, other[both] % 3), (first * second)[both])
    return found
