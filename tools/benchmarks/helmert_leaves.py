"""The leaves of a network adjusted in Helmert blocks: what a worker keeps and answers (`helmert_blocks`).

In a module of its own, so that workers import it: what they keep then lasts from one task to the next.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares import LeastSquares
from obseq.leastsquares.solvers.blas import one_blas_thread
from obseq.leastsquares.solvers.cholesky import SupernodalCholesky

if TYPE_CHECKING:
    from obseq.leastsquares.assembly.normal_equations import Linearisation, NormalEquations


@dataclass(frozen=True)
class Part:
    """What a leaf is built from: points, rotations, observations of formulas, known points.

    Attributes:
        points: (n, 3) values.
        rotations: (m, 3, 3) values.
        frozen: (3 (n + m),) unknowns that keep their value.
        batches: formula, blocks by argument (points from 0, rotations from n on), observations, sigmas.
        priors: points, values, sigmas.
        numbers: (3 (n + m),) number of each unknown in the whole network, -1 where frozen.
        junction: (3 (n + m),) True for unknowns that other leaves have as well.
    """

    points: np.ndarray
    rotations: np.ndarray
    frozen: np.ndarray
    batches: tuple[tuple[str, dict[str, np.ndarray], np.ndarray, np.ndarray], ...]
    priors: tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]
    numbers: np.ndarray
    junction: np.ndarray


class Leaf:
    """A part with its equations and its factor."""

    def __init__(self, part: Part) -> None:
        self.system = LeastSquares()
        points = self.system.add_points([f"P{k}" for k in range(len(part.points))], part.points)
        turns = self.system.add_rotations([f"R{k}" for k in range(len(part.rotations))], part.rotations)
        ids = np.concatenate([points, turns])
        self.system.unknowns.frozen[:] = part.frozen
        for formula, blocks, observations, sigmas in part.batches:
            self.system.add(formula, {name: ids[b] for name, b in blocks.items()}, observations, sigmas)
        for chosen, values, given in part.priors:
            self.system.add_prior(ids[chosen], values, given)
        self.equations: NormalEquations = self.system.equations()
        scalars = self.equations.free.scalars
        self.numbers = part.numbers[scalars]
        last = np.flatnonzero(part.junction[scalars])
        self.boundary = self.numbers[last]
        self.solver = SupernodalCholesky(last=last)
        self.solver.analyse(self.equations.pattern)
        self.moves_done = 0
        self.linearise()

    def linearise(self) -> None:
        """Assembles at the present unknowns, and eliminates all but the junction."""
        self.linearisation: Linearisation = self.equations.assemble()
        self.solver.eliminate(self.linearisation.values)

    def move(self, junction: np.ndarray) -> None:
        """Moves the unknowns of the part, given the steps of its junction unknowns."""
        step = self.solver.expand(-self.linearisation.gradient, junction)
        self.system.unknowns.move(self.equations.step(step, self.linearisation))
        self.moves_done += 1
        self.linearise()


LEAVES: dict[str, Leaf] = {}
"""The leaves that this worker has built, by the file of their part."""


def leaf_after(file: str, moves: list[np.ndarray]) -> Leaf:
    """The leaf after these steps of its junction: the one kept, or one built anew that takes them all."""
    if file not in LEAVES or LEAVES[file].moves_done > len(moves):
        LEAVES[file] = Leaf(pickle.loads(Path(file).read_bytes()))
    leaf = LEAVES[file]
    for junction in moves[leaf.moves_done :]:
        leaf.move(junction)
    return leaf


@dataclass(frozen=True)
class Reduced:
    """A system that remains for the unknowns `numbers`: matrix and right-hand side; and the cost below."""

    numbers: np.ndarray
    matrix: np.ndarray
    right: np.ndarray
    cost: float


def leaf_up(file: str, moves: list[np.ndarray]) -> Reduced:
    """What a leaf leaves to its parent."""
    with one_blas_thread():
        leaf = leaf_after(file, moves)
        right = leaf.solver.reduce(-leaf.linearisation.gradient)
        return Reduced(leaf.boundary, leaf.solver.schur_complement(), right, leaf.linearisation.cost)


def leaf_answers(
    file: str, moves: list[np.ndarray], inverse: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers, values and variances of the free unknowns of a leaf, given the inverse on its junction."""
    with one_blas_thread():
        leaf = leaf_after(file, moves)
        found = leaf.solver.expand_inverse(inverse)[leaf.equations.pattern.diagonal]
    return leaf.numbers, leaf.system.unknowns.values[leaf.equations.free.scalars], found
