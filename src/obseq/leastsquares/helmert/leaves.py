"""The leaves of a network adjusted in Helmert blocks: what a worker makes of them, and answers.

A worker keeps nothing. A leaf is a file beside that of its part, after each move of its junction another one:
whoever gets the next task reads it, and builds the leaf anew from its part where it is lost. A task that is
done twice gives the same twice.
"""

from __future__ import annotations

import os
import pickle
from contextlib import suppress
from pathlib import Path
from tempfile import mkstemp
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
    from obseq.kernels.loading import Kernel
    from obseq.leastsquares.assembly.linearisation import Linearisation
    from obseq.leastsquares.problem.manifolds import Manifold
    from obseq.leastsquares.problem.unknowns import State

    Given = tuple[Kernel | None, dict[str, IntArray], FloatArray, FloatArray]
    Kept = tuple[State, SupernodalCholesky, Linearisation, int, float]


@dataclass(frozen=True)
class Part:
    """What a leaf is built from; blocks are counted within it.

    Attributes:
        unknowns: of each kind, the blocks' numbers in the whole network, names and values.
        frozen: (n_scalars,) unknowns that keep their value.
        batches: formula (None for linear rows), blocks by argument, observations, sigmas.
        priors: blocks, values, sigmas.
        numbers: (n_scalars,) number of each unknown in the whole network, -1 where frozen.
        junction: (n_scalars,) True for unknowns that other leaves have as well.
    """

    unknowns: tuple[tuple[Manifold, IntArray, list[str], FloatArray], ...]
    frozen: BoolArray
    batches: tuple[Given, ...]
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

    def __init__(self, part: Part, kept: Kept | None = None) -> None:
        self._part = part
        self.system, self._blocks = _system(part)
        self.equations = self.system.equations()
        scalars = self.equations.free.scalars
        self.numbers = part.numbers[scalars]
        last = np.flatnonzero(part.junction[scalars])
        self.boundary = self.numbers[last]
        if kept is None:
            self.solver = SupernodalCholesky(last=last)
            self.solver.analyse(self.equations.pattern)
            self.moves_done, self.decrease = 0, 0.0
            self._linearise()
        else:
            values, self.solver, self.linearisation, self.moves_done, self.decrease = kept
            self.system.unknowns.restore(values)

    def __reduce__(self) -> tuple[type[Leaf], tuple[Part, Kept]]:
        """Its part, and what its moves and its solver came to."""
        state = self.system.unknowns.state()
        return Leaf, (self._part, (state, self.solver, self.linearisation, self.moves_done, self.decrease))

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


def _system(part: Part) -> tuple[LeastSquares, list[tuple[IntArray, IntArray]]]:
    """The system of a part; the numbers of its blocks in the whole network, and here, kind by kind."""
    system, blocks = LeastSquares(), []
    for manifold, numbers, names, values in part.unknowns:
        blocks.append((numbers, system.unknowns.add(manifold, names, values)))
    system.unknowns.frozen[:] = part.frozen
    for given in part.batches:
        _add(system, given)
    for ids, values, sigmas in part.priors:
        system.add_prior(ids, values, sigmas)
    return system, blocks


def _add(system: LeastSquares, given: Given) -> None:
    """Adds the observations of one batch."""
    formula, arguments, observations, sigmas = given
    if formula is not None:
        system.add(formula, arguments, observations, sigmas)
        return
    columns = list(arguments.values())
    ends = np.cumsum([system.unknowns.size[column[0]] for column in columns])
    *coefficients, _ = np.split(observations, ends, axis=1)
    system.add_linear(columns, coefficients, observations[:, -1], sigmas, is_tangent=True)


def leaf_after(file: str, moves: list[FloatArray]) -> Leaf:
    """The leaf after these steps of its junction, from the last of its files that is there."""
    part, wanted = Path(file), len(moves)
    found = (_read(_after(part, done)) for done in range(wanted, -1, -1))
    leaf = next((leaf for leaf in found if leaf is not None), None)
    if leaf is None:
        leaf = Leaf(pickle.loads(part.read_bytes()))
    elif leaf.moves_done == wanted:
        return leaf
    for junction in moves[leaf.moves_done :]:
        leaf.move(junction)
    _write(_after(part, wanted), leaf)
    _after(part, wanted - 1).unlink(missing_ok=True)
    return leaf


def _after(part: Path, moves: int) -> Path:
    """The file of a leaf after some moves."""
    return part.with_suffix(f".{moves}")


def _read(path: Path) -> Leaf | None:
    """The leaf in a file; None where there is none."""
    try:
        leaf: Leaf = pickle.loads(path.read_bytes())
    except FileNotFoundError:
        return None
    return leaf


def _write(path: Path, leaf: Leaf) -> None:
    """Writes a leaf beside its place, which it takes when it is complete."""
    descriptor, name = mkstemp(dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            pickle.dump(leaf, file)
        Path(name).replace(path)
    except BaseException:
        with suppress(OSError):
            Path(name).unlink()
        raise


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
