"""The motions of a network that its equations do not determine: free ones, and loose ones.

A part of a network moves as a rigid whole, or changes its scale, and its instruments with it. What no
equation sees of that is free. What equations see through the curvature of the Earth alone is loose where its
standard deviation is beyond a share of the size of the network. The rest is determined (docs/statistics.md,
"Free, loose and determined motions").
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from obseq import graphs
from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import SingularMatrixError, SingularSystemError
from obseq.leastsquares import LeastSquares
from obseq.leastsquares.assembly.evaluation import jacobian_rows
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.diagnosis.singular import undetermined_error
from obseq.leastsquares.iterations.constraints import held_rows
from obseq.leastsquares.iterations.datum_solver import DatumSolver
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.solvers import choose_solver
from obseq.survey.equations.frame import MEAN_RADIUS

UNDETERMINED = 0.01
"""Standard deviation of a motion, as a share of the size of the network, from which it is not determined.

Beyond it derivatives change so much within it that its own two digits are wrong (docs/statistics.md).
"""
DIRECT = 1e-3
"""Share of what an equation sees of single points from which it sees a motion: less may be a misclosure."""
ALIKE = 1e-10
"""Share, squared, of what sets a motion apart from others, below which it is none of its own."""
SHORTEST_ARM = 1e-6
"""Arm (m) below which a turn moves nothing but the rounding of coordinates: points on one vertical."""
HELD = 1e12
"""What the largest of the diagonal of the normal matrix is multiplied by to hold points."""


@dataclass(frozen=True, eq=False)
class LooseMotions:
    """Independent motions of a network that equations see through curvature at most, of root mean square 1.

    Attributes:
        count: How many of them, the first ones, are free or loose; the others are determined.
        unknowns: (n_free, k) of the free unknowns of the normal equations.
        parts: (n_points,) the part of each point, -1 where all of it is held.
        middles: (n_points, 3) the middle of the part of each point.
        shares: (7 n_parts, k) of what shifts, turns and changes of scale of each part they are made.
    """

    count: int
    unknowns: FloatArray
    parts: IntArray
    middles: FloatArray
    shares: FloatArray

    def of(self, rows: IntArray) -> Callable[[FloatArray], FloatArray]:
        """Coordinates (n, 3) of some points -> (n, 3, k) their motions."""
        return partial(_moved_places, self.middles[rows], self.parts[rows], self.shares)


def loose_motions(system: LeastSquares, points: IntArray) -> LooseMotions:
    """The motions that are free or loose at the current values.

    Args:
        system: The equations.
        points: (n_points,) blocks of the points.

    Raises:
        SingularSystemError: no equation touches some unknowns.
    """
    normal = system.equations()
    table, places = normal.table, normal.table.start[points][:, None] + np.arange(3)
    numbers, coordinates = normal.free.number[places], table.values[places]
    parts = _parts(normal, numbers)
    middles, extent = _middles(coordinates, parts)
    basic = np.eye(7 * (int(parts.max(initial=-1)) + 1))
    moves = _moved_places(middles, parts, basic, coordinates)
    moves[numbers < 0] = 0.0
    _keep_held(normal, points, moves)
    unknowns, is_place = np.zeros((normal.pattern.n, moves.shape[2])), np.zeros(normal.pattern.n, np.bool_)
    unknowns[numbers[numbers >= 0]], is_place[numbers[numbers >= 0]] = moves[numbers >= 0], True
    try:
        unknowns = _with_others(normal, unknowns, is_place)
    except SingularMatrixError:  # with all points known, others are undetermined: no motion is to blame
        return LooseMotions(0, unknowns[:, :0], parts, middles, basic[:, :0])
    of_points = np.zeros(len(table.values), np.bool_)
    of_points[places] = True
    seen = _seen(normal, unknowns, of_points)
    size = np.einsum("pik,pil->kl", moves, moves) / len(moves)
    chosen, _ = _modes(seen, size)
    most = np.abs(seen @ chosen).max(axis=0, initial=0.0)
    chosen = chosen[:, most <= max(DIRECT, 2.0 * extent / MEAN_RADIUS)]
    amounts = np.zeros((normal.pattern.n, chosen.shape[1]))
    amounts[numbers[numbers >= 0]] = (moves @ chosen)[numbers >= 0] / len(moves)
    weights, turned = np.linalg.eigh(_resistance(normal, amounts))
    count = int(np.count_nonzero(np.sqrt(np.maximum(weights, 0.0)) * UNDETERMINED * extent < 1.0))
    chosen = chosen @ turned
    return LooseMotions(count, unknowns @ chosen, parts, middles, chosen)


def loose_error(system: LeastSquares, points: IntArray) -> SingularSystemError | None:
    """The error for motions that are free or loose; None where there are none. Arguments as of the latter."""
    found = loose_motions(system, points)
    if not found.count:
        return None
    normal, loose = system.equations(), np.linalg.qr(found.unknowns[:, : found.count])[0]
    return undetermined_error(normal.table, normal.free, normal.pattern, loose)


def size_of(coordinates: FloatArray) -> float:
    """Size of a network of points (n, 3): twice the farthest of them from their middle."""
    arms = coordinates - coordinates.mean(axis=0)
    return 2.0 * float(np.linalg.norm(arms, axis=1).max())


def _parts(normal: NormalEquations, numbers: IntArray) -> IntArray:
    """(n_points,) the part of each point, -1 where all of it is held: parts share points or instruments."""
    table, pattern = normal.table, normal.pattern
    block = np.repeat(np.arange(len(table)), table.size)[normal.free.scalars]
    rows, columns = block[pattern.indices], block[pattern.columns()]
    joins = (table.size[rows] == 3) & (table.size[columns] == 3)
    labels = graphs.parts(len(table), rows[joins], columns[joins])
    first = numbers.max(axis=1)
    _, found = np.unique(labels[block[first[first >= 0]]], return_inverse=True)
    parts = np.full(len(numbers), -1)
    parts[first >= 0] = found
    return parts


def _keep_held(normal: NormalEquations, points: IntArray, moves: FloatArray) -> None:
    """Takes from motions (n_points, 3, k) of points what hard constraints of single points hold."""
    row = np.full(len(normal.table), -1)
    row[points] = np.arange(len(points))
    for batch in normal.constraints:
        axes, rows = jacobian_rows(normal.table, batch)[1:], row[batch.blocks[0]]
        if len(axes) == 3 and (rows >= 0).all():
            for axis, at in zip((axes / np.linalg.norm(axes, axis=0)).T, rows.tolist(), strict=True):
                moves[at] -= np.outer(axis, axis @ moves[at])


def _middles(coordinates: FloatArray, parts: IntArray) -> tuple[FloatArray, float]:
    """(n, 3) the middle of the part of each point; the size of the largest part."""
    middles, extent = np.zeros_like(coordinates), 0.0
    for part in range(int(parts.max(initial=-1)) + 1):
        own = parts == part
        middles[own] = coordinates[own].mean(axis=0)
        extent = max(extent, size_of(coordinates[own]))
    return middles, extent


def _moved_places(
    middles: FloatArray, parts: IntArray, shares: FloatArray, coordinates: FloatArray
) -> FloatArray:
    """(n, 3, k) motions of places (n, 3), made of shifts, turns and changes of scale of their parts.

    Args:
        middles: (n, 3) the middles of their parts.
        parts: (n,) their parts; what has -1 stays.
        shares: (7 n_parts, k) of what the motions are made.
        coordinates: (n, 3) the places.
    """
    arms = coordinates - middles
    shifts = np.broadcast_to(np.eye(3), (len(arms), 3, 3))
    turns = np.cross(np.eye(3), arms[:, None]).swapaxes(1, 2)
    own = np.concatenate([shifts, turns, arms[:, :, None]], axis=2)
    each = np.vstack([shares, np.zeros((7, shares.shape[1]))]).reshape(
        len(shares) // 7 + 1, 7, shares.shape[1]
    )
    return np.asarray(own @ each[parts])


def _with_others(normal: NormalEquations, unknowns: FloatArray, is_place: BoolArray) -> FloatArray:
    """Motions (n_free, k) of points with what the other unknowns make of them: as little as they can.

    Raises:
        SingularMatrixError: the others are undetermined.
    """
    values, diagonal = normal.assemble(viscous=False).values.copy(), normal.pattern.diagonal
    held = np.where(is_place, HELD * values[diagonal].max(initial=0.0), 0.0)
    values[diagonal] += held
    solver = choose_solver(normal.pattern)
    solver.analyse(normal.pattern)
    solver.factor(values)
    return np.asarray(solver.solve(held[:, None] * unknowns))


def _resistance(normal: NormalEquations, amounts: FloatArray) -> FloatArray:
    """(k, k) inverse covariance of amounts, linear functions (n_free, k) of the unknowns; 0 of what is free.

    It is what the equations see, at least, where one amount changes by 1 and the others by nothing.
    """
    n, count = amounts.shape
    if not count:
        return np.zeros((0, 0))
    still, given = partial(np.zeros, n), partial(np.asarray, amounts)
    plain = choose_solver(normal.pattern)
    holds = partial(held_rows, normal.table, normal.free, normal.constraints)
    solver = DatumSolver(plain, np.ones(n, np.bool_), still, None, given, count, normal.seen, holds)
    solver.analyse(normal.pattern)
    solver.factor(normal.assemble(viscous=False).values)
    rows = normal.seen(solver.motions[:, :count])
    return np.asarray(rows.T @ rows)


def _seen(normal: NormalEquations, unknowns: FloatArray, of_points: BoolArray) -> FloatArray:
    """(m, k) what equations see of motions, as shares of what they see of points."""
    shares = [np.zeros((0, unknowns.shape[1]))]
    for batch in (*normal.batches, *normal.constraints):
        moved, alone = _moved(normal, batch, unknowns, of_points)
        sees = batch.active & (alone > 0.0)
        shares.append(moved[sees] / alone[sees, None])
    return np.concatenate(shares)


def _moved(
    normal: NormalEquations, batch: Batch, unknowns: FloatArray, of_points: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """(n, k) changes of residuals by motions, and (n,) the lengths of their derivatives by points.

    What is held of a point counts in these: what an equation sees of it is no less.
    """
    derivatives, scalars = jacobian_rows(normal.table, batch)[1:], batch.scalars()
    numbers = normal.free.number[scalars]
    moved = np.einsum("cn,cnk->nk", np.where(numbers >= 0, derivatives, 0.0), unknowns[numbers])
    return moved, np.linalg.norm(derivatives * of_points[scalars], axis=0)


def _modes(seen: FloatArray, size: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(k, q) combinations of motions of root mean square 1, and (q,) what is seen of each.

    Args:
        seen: (m, k) what equations see of the motions.
        size: (k, k) mean products of the motions.
    """
    scale = np.sqrt(np.diag(size))
    scale = np.where(scale > SHORTEST_ARM, scale, np.inf)
    lengths, axes = np.linalg.eigh(size / np.outer(scale, scale))
    apart = lengths > ALIKE
    basis = axes[:, apart] / np.sqrt(lengths[apart]) / scale[:, None]
    _, values, turned = np.linalg.svd(np.vstack([seen @ basis, np.zeros((basis.shape[1],) * 2)]), False)
    return basis @ turned.T, values
