"""A network adjusted in Helmert blocks: a tree of eliminations for any executor, checked against one machine.

The area is halved again and again. An observation belongs to the leaf of its last block (its target, so
that stations are on the junctions: there are fewer of them); a block of unknowns is eliminated at the lowest
node of the tree below which all its observations are. A leaf is a `LeastSquares` of its own whose solver
eliminates all but the junction unknowns; a node adds the systems that remain of its two children, eliminates
its own unknowns and passes the rest on; the root solves. Solutions, and the inverse on what children share
with their parents, come back down.

An executor is anything with `submit(function, *arguments)` that gives something with `result()`: a
`concurrent.futures` pool, or a `distributed.Client` of Dask. A worker keeps the leaves that it has built; one
that has not got a leaf, because it is new or another one was lost, builds it from its part and the unknowns.

    python tools/benchmarks/helmert_blocks.py [--points N] [--depth N] [--workers N] [--dask]
"""

from __future__ import annotations

import argparse
import pickle
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from bench_network import survey
from helmert_leaves import Part, Reduced, leaf_answers, leaf_up
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.linalg.blas import dgemm

from obseq.leastsquares.problem.manifolds import POINT3, ROTATION
from obseq.leastsquares.solvers.blas import one_blas_thread
from obseq.leastsquares.solvers.cholesky import SupernodalCholesky

if TYPE_CHECKING:
    from obseq.leastsquares import LeastSquares

COORDINATES = 3


@dataclass
class Front:
    """A node of the tree: the sum of its children's systems, own unknowns first, then its parents'."""

    own: np.ndarray
    outer: np.ndarray
    lower: np.ndarray
    coupling: np.ndarray
    right: np.ndarray
    children: list[np.ndarray] = field(default_factory=list)

    def solution(self, outer: np.ndarray) -> np.ndarray:
        """Steps of own and outer unknowns."""
        return np.concatenate([cho_solve((self.lower, True), self.right - self.coupling @ outer), outer])

    def inverse(self, outer: np.ndarray) -> np.ndarray:
        """Inverse of the whole system on own and outer unknowns, given that on the outer ones."""
        gain = cho_solve((self.lower, True), self.coupling)
        cross = -product(gain, outer)
        top = cho_solve((self.lower, True), np.eye(len(self.own))) - product(cross, gain.T)
        return np.block([[top, cross], [cross.T, outer]])

    def for_child(self, child: int) -> np.ndarray:
        """Places of a child's unknowns among own and outer ones."""
        return places(np.concatenate([self.own, self.outer]), self.children[child])


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """A product by SciPy's BLAS, whose threads `one_blas_thread` rules; NumPy has another."""
    return np.asarray(dgemm(1.0, a, b)) if a.size and b.size else a @ b


def places(among: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Positions of numbers in a list of numbers."""
    order = np.argsort(among)
    return np.asarray(order[np.searchsorted(among[order], wanted)])


def merge(children: list[Reduced], is_own: np.ndarray) -> tuple[Front, Reduced]:
    """Adds the systems of children; eliminates the unknowns that are the node's own (n_unknowns,)."""
    numbers = np.unique(np.concatenate([child.numbers for child in children]))
    numbers = np.concatenate([numbers[is_own[numbers]], numbers[~is_own[numbers]]])
    own = int(np.count_nonzero(is_own[numbers]))
    matrix, right = np.zeros((len(numbers), len(numbers))), np.zeros(len(numbers))
    for child in children:
        at = places(numbers, child.numbers)
        matrix[np.ix_(at, at)] += child.matrix
        right[at] += child.right
    lower, coupling = cho_factor(matrix[:own, :own], lower=True)[0], matrix[:own, own:]
    half = solve_triangular(lower, coupling, lower=True)
    remaining = matrix[own:, own:] - product(half.T, half)
    rest = right[own:] - half.T @ solve_triangular(lower, right[:own], lower=True)
    parts = [child.numbers for child in children]
    front = Front(numbers[:own], numbers[own:], lower, coupling, right[:own], parts)
    return front, Reduced(numbers[own:], remaining, rest, sum(child.cost for child in children))


class Tree:
    """A binary tree over the leaves, numbered as in a heap: 1 the root, 2 k and 2 k + 1 below k."""

    def __init__(self, files: list[str], home: np.ndarray, executor: Any) -> None:
        self.parts, self.home, self.executor = files, home, executor
        self.moves: list[list[np.ndarray]] = [[] for _ in files]
        self.fronts: dict[int, Front] = {}

    def iterate(self) -> tuple[float, float, int]:
        """One iteration; cost before it, largest step on junctions, unknowns of the largest front."""
        sent = [self.executor.submit(leaf_up, *pair) for pair in zip(self.parts, self.moves, strict=True)]
        level = {len(self.parts) + k: future.result() for k, future in enumerate(sent)}
        with one_blas_thread():
            cost = self._up(level)
            steps = self._down(lambda front, outer: front.solution(outer), np.zeros(0))
        for k, moves in enumerate(self.moves):
            moves.append(steps[len(self.parts) + k])
        largest = max(len(front.own) + len(front.outer) for front in self.fronts.values())
        return cost, max(float(np.abs(step).max(initial=0.0)) for step in steps.values()), largest

    def _up(self, level: dict[int, Reduced]) -> float:
        for node in range(len(self.parts) - 1, 0, -1):
            pair = [level.pop(2 * node), level.pop(2 * node + 1)]
            self.fronts[node], level[node] = merge(pair, self.home == node)
        return level[1].cost

    def _down(self, solve: Any, root: np.ndarray) -> dict[int, np.ndarray]:
        """What goes to each leaf: the part of its parent's solution, or inverse, on its junction."""
        given = {1: root}
        for node in range(1, len(self.parts)):
            front = self.fronts[node]
            whole = solve(front, given.pop(node))
            for child in (0, 1):
                at = front.for_child(child)
                given[2 * node + child] = whole[at] if whole.ndim == 1 else whole[np.ix_(at, at)]
        return given

    def answers(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """(n,) values and variances of all free unknowns, from a last elimination at the solution."""
        self.iterate()
        for moves in self.moves:
            moves.pop()
        with one_blas_thread():
            given = self._down(lambda front, outer: front.inverse(outer), np.zeros((0, 0)))
        values, variances = np.zeros(n), np.zeros(n)
        sent = [
            self.executor.submit(leaf_answers, part, moves, given[len(self.parts) + k])
            for k, (part, moves) in enumerate(zip(self.parts, self.moves, strict=True))
        ]
        for future in sent:
            numbers, found, of_part = future.result()
            values[numbers], variances[numbers] = found, of_part
        return values, variances


def halved(places_of: np.ndarray, depth: int) -> np.ndarray:
    """(n,) number of the leaf of each place (n, 2): halves across the longer side, again and again."""
    leaf = np.zeros(len(places_of), dtype=np.int64)
    for _ in range(depth):
        new = 2 * leaf
        for part in np.unique(leaf):
            inside = np.flatnonzero(leaf == part)
            axis = int(np.argmax(np.ptp(places_of[inside], axis=0)))
            order = inside[np.argsort(places_of[inside, axis], kind="stable")]
            new[order[len(order) // 2 :]] += 1
        leaf = new
    return leaf


def cut(system: LeastSquares, depth: int) -> tuple[list[Part], np.ndarray]:
    """The parts of a system of points and rotations, and (n_unknowns,) the node where each is eliminated."""
    table, equations = system.unknowns, system.equations()
    n_leaves, n_blocks = 2**depth, len(table)
    points = np.flatnonzero(table.each(lambda kind: kind == POINT3))
    leaf_of = np.zeros(n_blocks, dtype=np.int64)
    leaf_of[points] = halved(table.read(points)[:, :2], depth)
    touched = np.zeros((n_leaves, n_blocks), dtype=bool)
    of_batch = [leaf_of[batch.blocks[-1]] for batch in equations.batches]
    for batch, leaf in zip(equations.batches, of_batch, strict=True):
        for blocks in batch.blocks:
            touched[leaf, blocks] = True
    for prior in equations.priors:
        touched[leaf_of[prior.ids], prior.ids] = True
    home = homes(touched)
    of_scalar = np.repeat(np.arange(n_blocks), table.size)
    parts = [_part(system, k, touched, of_batch, leaf_of, home, of_scalar) for k in range(n_leaves)]
    return parts, home[of_scalar[equations.free.scalars]]


def homes(touched: np.ndarray) -> np.ndarray:
    """(n_blocks,) lowest node above all leaves that touch a block (n_leaves, n_blocks)."""
    n = len(touched)
    first, last = n + np.argmax(touched, axis=0), 2 * n - 1 - np.argmax(touched[::-1], axis=0)
    while (first != last).any():
        apart = first != last
        first, last = np.where(apart, first // 2, first), np.where(apart, last // 2, last)
    return np.asarray(first)


def _part(
    system: LeastSquares,
    key: int,
    of_leaves: np.ndarray,
    of_batch: list[np.ndarray],
    leaf_of: np.ndarray,
    home: np.ndarray,
    of_scalar: np.ndarray,
) -> Part:
    table, equations = system.unknowns, system.equations()
    chosen = [
        np.flatnonzero(of_leaves[key] & table.each(lambda kind, wanted=wanted: kind == wanted))
        for wanted in (POINT3, ROTATION)
    ]
    blocks = np.concatenate(chosen)
    local = np.full(len(table), -1)
    local[blocks] = np.arange(len(blocks))
    scalars = (table.start[blocks][:, None] + np.arange(COORDINATES)).ravel()
    batches = []
    for batch, leaf in zip(equations.batches, of_batch, strict=True):
        rows = np.flatnonzero(leaf == key)
        arguments = zip(batch.shape.roles, batch.blocks, strict=True)
        given = {role.name: local[ids[rows]] for role, ids in arguments}
        batches.append((batch.name, given, batch.observations[rows], batch.sigmas[rows]))
    priors = []
    for prior in equations.priors:
        rows = np.flatnonzero(leaf_of[prior.ids] == key)
        if not rows.size:
            continue
        sigmas = 1.0 / prior.weights.reshape(-1, COORDINATES)[rows]
        priors.append((local[prior.ids[rows]], prior.values.reshape(-1, COORDINATES)[rows], sigmas))
    return Part(
        table.read(chosen[0]),
        table.read(chosen[1]) if len(chosen[1]) else np.zeros((0, 3, 3)),
        table.frozen[scalars],
        tuple(batches),
        tuple(priors),
        equations.free.number[scalars],
        home[of_scalar[scalars]] != len(of_leaves) + key,
    )


class Pools:
    """Processes of this machine, each with its own leaves."""

    def __init__(self, workers: int) -> None:
        context = get_context("spawn")
        self.pools = [ProcessPoolExecutor(1, mp_context=context) for _ in range(workers)]

    def submit(self, function: Any, file: str, *arguments: Any) -> Any:
        """Sends work on a leaf to where that leaf is kept."""
        return self.pools[int(Path(file).stem) % len(self.pools)].submit(function, file, *arguments)

    def close(self) -> None:
        """Ends the processes."""
        for pool in self.pools:
            pool.shutdown()


class DaskWorkers:
    """Workers of a Dask cluster, here a local one. If one is lost, another takes its leaves over."""

    def __init__(self, workers: int) -> None:
        from distributed import Client, LocalCluster  # type: ignore[import-not-found,unused-ignore]

        self.client = Client(LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None))

    def submit(self, function: Any, file: str, *arguments: Any) -> Any:
        """Sends work on a leaf to where that leaf is kept."""
        present = sorted(self.client.scheduler_info(n_workers=-1)["workers"])
        worker = present[int(Path(file).stem) % len(present)]
        return self.client.submit(function, file, *arguments, workers=[worker], pure=False)

    def close(self) -> None:
        """Ends the cluster."""
        self.client.close()
        self.client.cluster.close()


def adjusted_alone(system: LeastSquares, iterations: int) -> tuple[np.ndarray, np.ndarray]:
    """Values and variances of the free unknowns, on one machine."""
    equations, solver = system.equations(), SupernodalCholesky()
    solver.analyse(equations.pattern)
    begin = time.perf_counter()
    for _ in range(iterations):
        found = equations.assemble()
        solver.factor(found.values)
        system.unknowns.move(equations.step(solver.solve(-found.gradient), found))
    print(f"    one machine: {(time.perf_counter() - begin) / iterations:.2f} s per iteration")
    solver.factor(equations.assemble().values)
    variances = solver.selected_inverse()[equations.pattern.diagonal]
    return system.unknowns.values[equations.free.scalars], variances


def main() -> None:
    """Adjusts a survey in blocks, and at once; prints times and differences."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--points", type=int, default=10_000)
    parser.add_argument("--depth", type=int, default=3, help="2 to this power leaves")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--iterations", type=int, default=3)
    parser.add_argument("--dask", action="store_true")
    options = parser.parse_args()
    system = survey(options.points, 1)
    parts, home = cut(system, options.depth)
    sizes = [int(np.count_nonzero(home == node)) for node in range(1, len(parts))]
    print(f"{options.points} points, {len(home)} unknowns, {len(parts)} leaves")
    print(f"    separators from the root down: {sizes}")
    executor: Any = DaskWorkers(options.workers) if options.dask else Pools(options.workers)
    with tempfile.TemporaryDirectory() as folder:
        files = [str(Path(folder) / f"{k}.part") for k in range(len(parts))]
        for file, part in zip(files, parts, strict=True):
            Path(file).write_bytes(pickle.dumps(part))
        tree = Tree(files, home, executor)
        for _ in range(options.iterations):
            begin = time.perf_counter()
            cost, step, largest = tree.iterate()
            seconds = time.perf_counter() - begin
            print(f"    {seconds:.2f} s, cost {cost:.6f}, junction step {step:.2e} m, front {largest}")
        values, variances = tree.answers(len(home))
    executor.close()
    expected, of_expected = adjusted_alone(system, options.iterations)
    print(f"    differences: unknowns {np.abs(values - expected).max():.1e} m or rad, ", end="")
    print(f"variances {np.abs(variances / of_expected - 1.0).max():.1e} of them")


if __name__ == "__main__":
    main()
