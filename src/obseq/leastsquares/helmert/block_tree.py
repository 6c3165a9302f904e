"""The tree above the leaves: systems that remain are added and eliminated upwards, solutions go down."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve, solve_triangular

from obseq.dataclass import dataclass
from obseq.errors import SingularSystemError
from obseq.leastsquares.helmert.leaves import Answers, Reduced, leaf_answers, leaf_up
from obseq.leastsquares.solvers.blas import one_blas_thread

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.arrays import BoolArray, FloatArray, IntArray


class Future(Protocol):
    """Work that was given away."""

    def result(self) -> Any:
        """What it gave."""


class Executor(Protocol):
    """Who does the work: a pool of `concurrent.futures`, a `distributed.Client`, or one's own."""

    def submit(self, function: Callable[..., Any], /, *arguments: Any) -> Future:
        """Gives work away."""


@dataclass
class Front:
    """A node of the tree: the sum of its children's systems, own unknowns first, then its parents'.

    Attributes:
        own: numbers of the unknowns that are eliminated here.
        outer: numbers of the others.
        lower: Cholesky factor of the part of the own ones.
        coupling: (n_own, n_outer) part of the matrix.
        right: (n_own,) right-hand side.
        children: numbers of the unknowns of each child.
    """

    own: IntArray
    outer: IntArray
    lower: FloatArray
    coupling: FloatArray
    right: FloatArray
    children: list[IntArray]

    def solution(self, outer: FloatArray) -> FloatArray:
        """Steps of own and outer unknowns."""
        return np.concatenate([cho_solve((self.lower, True), self.right - self.coupling @ outer), outer])

    def inverse(self, outer: FloatArray) -> FloatArray:
        """Inverse of the whole system on own and outer unknowns, given that on the outer ones."""
        gain = cho_solve((self.lower, True), self.coupling)
        cross = -gain @ outer
        top = cho_solve((self.lower, True), np.eye(len(self.own))) - cross @ gain.T
        return np.block([[top, cross], [cross.T, outer]])

    def for_child(self, child: int) -> IntArray:
        """Places of a child's unknowns among own and outer ones."""
        return _places(np.concatenate([self.own, self.outer]), self.children[child])


def _places(among: IntArray, wanted: IntArray) -> IntArray:
    """Positions of numbers in a list of numbers."""
    order = np.argsort(among)
    return np.asarray(order[np.searchsorted(among[order], wanted)])


def merge(children: list[Reduced], is_own: BoolArray) -> tuple[Front, Reduced]:
    """Adds the systems of children; eliminates the unknowns that are the node's own (n_unknowns,).

    Raises:
        SingularSystemError: the observations below do not determine them.
    """
    numbers = np.unique(np.concatenate([child.numbers for child in children]))
    numbers = np.concatenate([numbers[is_own[numbers]], numbers[~is_own[numbers]]])
    own = int(np.count_nonzero(is_own[numbers]))
    matrix, right = np.zeros((len(numbers), len(numbers))), np.zeros(len(numbers))
    for child in children:
        at = _places(numbers, child.numbers)
        matrix[np.ix_(at, at)] += child.matrix
        right[at] += child.right
    try:
        lower = cho_factor(matrix[:own, :own], lower=True)[0] if own else np.zeros((0, 0))
    except LinAlgError as error:
        raise SingularSystemError(f"the observations do not determine some junctions: {error}") from error
    coupling, parts = matrix[:own, own:], [child.numbers for child in children]
    half = solve_triangular(lower, coupling, lower=True) if own else coupling
    rest = right[own:] - half.T @ solve_triangular(lower, right[:own], lower=True) if own else right
    cost, decrease = sum(child.cost for child in children), sum(child.decrease for child in children)
    front = Front(numbers[:own], numbers[own:], lower, coupling, right[:own], parts)
    remaining = matrix[own:, own:] - half.T @ half
    return front, Reduced(numbers[own:], remaining, rest, cost, decrease)


class Tree:
    """A binary tree over the leaves, numbered as in a heap: 1 the root, 2 k and 2 k + 1 below k.

    Args:
        files: the parts of the leaves; the executor's workers read them.
        home: (n_unknowns,) the node where each unknown is eliminated.
        executor: does the work of the leaves.
    """

    def __init__(self, files: list[str], home: IntArray, executor: Executor) -> None:
        self._files, self._home, self._executor = files, home, executor
        self._moves: list[list[FloatArray]] = [[] for _ in files]
        self._fronts: dict[int, Front] = {}

    def up(self) -> Reduced:
        """Linearises, and eliminates up to the root: its cost and decrease are those of the network."""
        sent = [self._executor.submit(leaf_up, *pair) for pair in zip(self._files, self._moves, strict=True)]
        level = {len(self._files) + k: future.result() for k, future in enumerate(sent)}
        with one_blas_thread():
            for node in range(len(self._files) - 1, 0, -1):
                pair = [level.pop(2 * node), level.pop(2 * node + 1)]
                self._fronts[node], level[node] = merge(pair, self._home == node)
        root: Reduced = level[1]
        return root

    def move(self) -> None:
        """Solves, and sends the leaves the steps of their junctions."""
        with one_blas_thread():
            steps = self._down(lambda front, outer: front.solution(outer), np.zeros(0))
        for k, moves in enumerate(self._moves):
            moves.append(steps[len(self._files) + k])

    def answers(self) -> list[Answers]:
        """Values and variances of each leaf, after `up`."""
        with one_blas_thread():
            given = self._down(lambda front, outer: front.inverse(outer), np.zeros((0, 0)))
        sent = [
            self._executor.submit(leaf_answers, file, moves, given[len(self._files) + k])
            for k, (file, moves) in enumerate(zip(self._files, self._moves, strict=True))
        ]
        return [future.result() for future in sent]

    @property
    def separators(self) -> list[int]:
        """Unknowns that are eliminated at each node, from the root down."""
        return [len(self._fronts[node].own) for node in sorted(self._fronts)]

    def _down(
        self, solve: Callable[[Front, FloatArray], FloatArray], root: FloatArray
    ) -> dict[int, FloatArray]:
        """What goes to each leaf: the part of its parent's solution, or inverse, on its junction."""
        given = {1: root}
        for node in range(1, len(self._files)):
            front = self._fronts[node]
            whole = solve(front, given.pop(node))
            for child in (0, 1):
                at = front.for_child(child)
                given[2 * node + child] = whole[at] if whole.ndim == 1 else whole[np.ix_(at, at)]
        return given
