"""The leaves of a network adjusted in Helmert blocks: what a worker keeps, and answers.

Functions of an imported module: what a worker keeps lasts from one task to the next.
"""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import SingularMatrixError
from obseq.leastsquares.diagnosis.singular import eliminated_error
from obseq.leastsquares.solvers.blas import one_blas_thread
from obseq.leastsquares.solvers.cholesky import SupernodalCholesky
from obseq.leastsquares.system import LeastSquares

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.leastsquares.problem.manifolds import Manifold


@dataclass(frozen=True)
class Part:
    """What a leaf is built from; blocks are counted within it.

    Attributes:
        unknowns: of each kind, the blocks' numbers in the whole network, names and values.
        frozen: (n_scalars,) unknowns that keep their value.
        batches: formula, blocks by argument, observations, sigmas.
        priors: blocks, values, sigmas.
        numbers: (n_scalars,) number of each unknown in the whole network, -1 where frozen.
        junction: (n_scalars,) True for unknowns that other leaves have as well.
    """

    unknowns: tuple[tuple[Manifold, IntArray, list[str], FloatArray], ...]
    frozen: BoolArray
    batches: tuple[tuple[str, dict[str, IntArray], FloatArray, FloatArray], ...]
    priors: tuple[tuple[IntArray, FloatArray, FloatArray], ...]
    numbers: IntArray
    junction: BoolArray


class Leaf:
    """A part with its equations and its factor.

    Attributes:
        numbers: (n_free,) number of each of its unknowns in the whole network.
        boundary: numbers of its junction.
        moves_done: how often its unknowns were moved.
        decrease: of the last move, -g'x: summed over all leaves, the square of the step in its own metric.
    """

    def __init__(self, part: Part) -> None:
        self.system = LeastSquares()
        self._blocks: list[tuple[IntArray, IntArray]] = []
        for manifold, blocks, names, values in part.unknowns:
            self._blocks.append((blocks, self.system.unknowns.add(manifold, names, values)))
        self.system.unknowns.frozen[:] = part.frozen
        for formula, arguments, observations, sigmas in part.batches:
            self.system.add(formula, arguments, observations, sigmas)
        for ids, values, sigmas in part.priors:
            self.system.add_prior(ids, values, sigmas)
        self.equations = self.system.equations()
        scalars = self.equations.free.scalars
        self.numbers = part.numbers[scalars]
        last = np.flatnonzero(part.junction[scalars])
        self.boundary = self.numbers[last]
        self.solver = SupernodalCholesky(last=last)
        self.solver.analyse(self.equations.pattern)
        self.moves_done, self.decrease = 0, 0.0
        self._linearise()

    def _linearise(self) -> None:
        """Assembles at the present unknowns, and eliminates all but the junction."""
        self.linearisation = self.equations.assemble()
        try:
            self.solver.eliminate(self.linearisation.values)
        except SingularMatrixError as error:
            scalar = int(self.equations.free.scalars[error.indices[0]])
            raise eliminated_error(self.system.unknowns, scalar) from error

    def move(self, junction: FloatArray) -> None:
        """Moves the unknowns of the part, given the steps of its junction unknowns."""
        step = self.solver.expand(-self.linearisation.gradient, junction)
        self.decrease = -float(self.linearisation.gradient @ step)
        self.system.unknowns.move(self.equations.step(step, self.linearisation))
        self.moves_done += 1
        self._linearise()

    def values(self) -> list[tuple[IntArray, FloatArray]]:
        """Numbers of blocks in the whole network, kind by kind, with their values."""
        return [(blocks, self.system.values(ids)) for blocks, ids in self._blocks]


LEAVES: dict[str, Leaf] = {}
"""The leaves that this worker has built, by the file of their part."""


def leaf_after(file: str, moves: list[FloatArray]) -> Leaf:
    """The leaf after these steps of its junction: the one kept, or one built anew that takes them all."""
    if file not in LEAVES or LEAVES[file].moves_done > len(moves):
        LEAVES[file] = Leaf(pickle.loads(Path(file).read_bytes()))
    leaf = LEAVES[file]
    for junction in moves[leaf.moves_done :]:
        leaf.move(junction)
    return leaf


@dataclass(frozen=True)
class Reduced:
    """What a part of a network says of some unknowns, the others eliminated.

    Attributes:
        numbers: (n,) numbers of the unknowns.
        matrix: (n, n) normal matrix.
        right: (n,) right-hand side.
        cost: sum of weighted squared residuals of the part.
        decrease: of its last move, see `Leaf`.
    """

    numbers: IntArray
    matrix: FloatArray
    right: FloatArray
    cost: float
    decrease: float


def leaf_up(file: str, moves: list[FloatArray]) -> Reduced:
    """What a leaf leaves to its parent."""
    with one_blas_thread():
        leaf = leaf_after(file, moves)
        right = leaf.solver.reduce(-leaf.linearisation.gradient)
        matrix = leaf.solver.schur_complement()
        return Reduced(leaf.boundary, matrix, right, leaf.linearisation.cost, leaf.decrease)


@dataclass(frozen=True)
class Answers:
    """What a leaf knows of its unknowns.

    Attributes:
        values: numbers of blocks, and their values.
        numbers: (n,) numbers of free unknowns.
        variances: (n,) their variances, for a unit weight of 1.
    """

    values: list[tuple[IntArray, FloatArray]]
    numbers: IntArray
    variances: FloatArray


def leaf_answers(file: str, moves: list[FloatArray], inverse: FloatArray) -> Answers:
    """Values and variances of the unknowns of a leaf, given the inverse on its junction."""
    with one_blas_thread():
        leaf = leaf_after(file, moves)
        variances = leaf.solver.expand_inverse(inverse)[leaf.equations.pattern.diagonal]
        return Answers(leaf.values(), leaf.numbers, variances)


def forget(file: str) -> None:
    """Forgets a leaf that is not needed any more."""
    LEAVES.pop(file, None)
