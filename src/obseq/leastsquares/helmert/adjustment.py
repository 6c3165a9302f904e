"""A system solved in Helmert blocks, by any executor."""

from __future__ import annotations

import math
import pickle
import tempfile
from concurrent.futures import Future
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.leastsquares.helmert.block_tree import Tree
from obseq.leastsquares.helmert.cutting import Cut, cut

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from obseq.arrays import FloatArray
    from obseq.leastsquares.helmert.block_tree import Executor
    from obseq.leastsquares.helmert.leaves import Answers
    from obseq.leastsquares.problem.unknowns import UnknownTable
    from obseq.leastsquares.system import LeastSquares


@dataclass(frozen=True)
class BlockSolution:
    """What an adjustment in Helmert blocks found; the unknowns of the system are at the solution.

    Attributes:
        converged: whether the iterations ended by themselves.
        costs: sum of weighted squared residuals before each iteration, and at the end.
        redundancy: equations minus unknowns.
        variances: (n_scalars,) of all unknowns, for a unit weight of 1; 0 where frozen.
        separators: unknowns that are eliminated at each node of the tree, from the root down.
    """

    converged: bool
    costs: tuple[float, ...]
    redundancy: int
    variances: FloatArray
    separators: tuple[int, ...]

    @property
    def sigma0(self) -> float | None:
        """Unit-weight estimate; None without redundancy."""
        return math.sqrt(self.costs[-1] / self.redundancy) if self.redundancy > 0 else None


class Here:
    """An executor that does the work at once, in this process."""

    def submit(self, function: Callable[..., object], /, *arguments: object) -> Future[object]:
        """Does the work."""
        future: Future[object] = Future()
        future.set_result(function(*arguments))
        return future


def solve_in_blocks(
    system: LeastSquares,
    depth: int = 3,
    executor: Executor | None = None,
    max_iterations: int = 20,
    tolerance: float = 1e-6,
    folder: str | Path | None = None,
) -> BlockSolution:
    """Solves a system in 2 to the power of `depth` parts; its unknowns move to the solution.

    The result is that of the whole: nothing is approximated. It is for networks that one machine does not
    hold; where it does, `LeastSquares.solve` is faster. docs/scaling.md has the method and measurements.

    Args:
        system: points and other unknowns, observations by formulas and linear rows, priors.
        depth: how often the area is halved.
        executor: gives work to others: anything with `submit(function, *arguments)` that returns something
            with `result()`, such as a pool of `concurrent.futures` or a `distributed.Client`; None to do it
            here. A worker keeps nothing: any of them can do any task, twice if one is lost.
        max_iterations: no more iterations than this.
        tolerance: the iterations end when no unknown moves by more than this share of its standard deviation.
        folder: where a folder of this run is made and removed at the end, which all workers read and write;
            that of temporary files by default. Another run, after a killed one too, has another folder.

    Raises:
        InputError: the system has what cannot be cut (see `cutting.cut`).
        SingularSystemError: the observations do not determine some unknowns.
    """
    parts = cut(system, depth)
    with tempfile.TemporaryDirectory(prefix="obseq-blocks-", dir=folder) as of_this_run:
        return _solve(system, parts, executor, max_iterations, tolerance, Path(of_this_run))


def _solve(
    system: LeastSquares,
    parts: Cut,
    executor: Executor | None,
    max_iterations: int,
    tolerance: float,
    folder: Path,
) -> BlockSolution:
    files = [str(folder / f"{k}.part") for k in range(len(parts.parts))]
    for file, part in zip(files, parts.parts, strict=True):
        Path(file).write_bytes(pickle.dumps(part))
    tree = Tree(files, parts.home, executor or Here())
    root = tree.up()
    costs, converged = [root.cost], False
    while not converged and len(costs) <= max_iterations:
        tree.move()
        root = tree.up()
        costs.append(root.cost)
        # |x_k| <= s_k sqrt(x' N x): the root bounds the share of its s_k by which any unknown has moved
        converged = math.sqrt(max(root.decrease, 0.0)) <= tolerance
    answers = tree.answers()
    redundancy = system.n_observations + system.n_constraints - len(parts.home)
    variances = _take(system.unknowns, parts, answers)
    return BlockSolution(converged, tuple(costs), redundancy, variances, tuple(tree.separators))


def _take(table: UnknownTable, parts: Cut, answers: Sequence[Answers]) -> FloatArray:
    """Gives the unknowns their values; (n_scalars,) their variances."""
    variances = np.zeros(table.n_scalars)
    for answer in answers:
        for blocks, values in answer.values:
            table.write(blocks, values)
        variances[parts.scalars[answer.numbers]] = answer.variances
    return variances
