"""Times whole solutions of small systems against scipy.optimize.least_squares(method="lm").

Points observed by distances to their neighbours, their coordinates known beforehand to 10 cm. Both begin with
arrays and end with coordinates: ours builds the system each time. SciPy is given the weighted residuals as a
NumPy expression, and takes their derivatives by differences, or from a function (`--jacobian`). Many systems
of one shape are one system: the last column is SciPy's time over ours where a thousand are solved so.

    python tools/benchmarks/bench_small.py
    python tools/benchmarks/bench_small.py --points 4 12 60 --rounds 15 --json small.json
"""

import argparse
import time
import timeit
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from command import command_line, write_json
from interleaved import Repeat, race, ratio
from numpy.typing import NDArray
from scipy.optimize import least_squares

from obseq.leastsquares import LeastSquares

Array = NDArray[np.float64]
POINTS = (4, 12, 60)
SIGMA, PRIOR = 0.003, 0.1
TOGETHER = 1_000
REACH = 260.0
"""Points of the grid (100 m) that are nearer than this are observed."""


@dataclass(frozen=True)
class Network:
    """Points from which distances were observed: starts (n, 3), pairs (m, 2), lengths (m,)."""

    start: Array
    pairs: NDArray[np.int64]
    lengths: Array

    def solve(self) -> Array:
        """The points, by a system built for them."""
        system = LeastSquares()
        points = system.add_points([f"P{k}" for k in range(len(self.start))], self.start)
        first, second = points[self.pairs.T]
        system.add("Dist3D", {"p1": first, "p2": second}, self.lengths, SIGMA)
        system.add_prior(points, self.start, PRIOR)
        system.solve()
        return system.values(points)

    def copies(self, count: int) -> "Network":
        """So many of it, side by side."""
        n = len(self.start)
        pairs = self.pairs + n * np.arange(count)[:, None, None]
        return Network(np.tile(self.start, (count, 1)), pairs.reshape(-1, 2), np.tile(self.lengths, count))

    def residuals(self, x: Array) -> Array:
        """(m + 3 n,) weighted residuals, as SciPy wants them."""
        points = x.reshape(-1, 3)
        shift = points[self.pairs[:, 1]] - points[self.pairs[:, 0]]
        distances = np.sqrt(np.einsum("ij,ij->i", shift, shift))
        return np.concatenate([(distances - self.lengths) / SIGMA, (x - self.start.ravel()) / PRIOR])

    def jacobian(self, x: Array) -> Array:
        """(m + 3 n, 3 n) derivatives of the residuals."""
        points, m = x.reshape(-1, 3), len(self.pairs)
        shift = points[self.pairs[:, 1]] - points[self.pairs[:, 0]]
        along = shift / np.linalg.norm(shift, axis=1, keepdims=True) / SIGMA
        rows = np.zeros((m + x.size, len(points), 3))
        rows[np.arange(m), self.pairs[:, 1]] = along
        rows[np.arange(m), self.pairs[:, 0]] -= along
        matrix: Array = rows.reshape(m + x.size, x.size)
        matrix[m:] = np.eye(x.size) / PRIOR
        return matrix

    def scipy(self, jacobian: bool) -> Array:
        """The points, by SciPy."""
        derivatives: str | Callable[[Array], Array] = self.jacobian if jacobian else "2-point"
        found = least_squares(self.residuals, self.start.ravel(), derivatives, method="lm")
        points: Array = found.x.reshape(-1, 3)
        return points


@dataclass(frozen=True)
class Row:
    """The result of one size: milliseconds of CPU, and SciPy's time in ours, alone and `TOGETHER`."""

    points: int
    unknowns: int
    distances: int
    obseq: float
    scipy: float
    ratio: float
    disagreement: float
    together: float


def network(n: int) -> Network:
    """Points of a square grid, moved at random, with distances between near ones."""
    random, side = np.random.default_rng(n), int(np.ceil(np.sqrt(n)))
    grid = np.array([[100.0 * i, 100.0 * j, 0.0] for i in range(side) for j in range(side)])[:n]
    points = grid + random.normal(0.0, 10.0, (n, 3))
    first, second = np.triu_indices(n, 1)
    distances = np.linalg.norm(points[first] - points[second], axis=1)
    near = distances < REACH
    lengths = distances[near] + random.normal(0.0, SIGMA, int(near.sum()))
    start = points + random.normal(0.0, PRIOR, points.shape)
    return Network(start, np.column_stack([first, second])[near], lengths)


def bench(n: int, rounds: int, jacobian: bool) -> Row:
    """The bench of one size."""
    problem = network(n)
    many = problem.copies(TOGETHER)
    contenders: dict[str, Repeat] = {
        "obseq": lambda count: _repeat(problem.solve, count),
        "scipy": lambda count: _repeat(lambda: problem.scipy(jacobian), count),
        "together": lambda count: _repeat(many.solve, count),
    }
    difference = float(np.abs(problem.solve() - problem.scipy(jacobian)).max())
    timings = race(contenders, rounds)
    return Row(
        n,
        3 * n,
        len(problem.pairs),
        1e3 * timings["obseq"].median,
        1e3 * timings["scipy"].median,
        ratio(timings["obseq"], timings["scipy"]),
        difference,
        TOGETHER * ratio(timings["scipy"], timings["together"]),
    )


def ten_calls() -> None:
    """Adds blocks of three kinds, batches of two formulas, priors; freezes one block."""
    system, places = LeastSquares(), np.arange(18.0).reshape(6, 3) ** 2
    points = system.add_points([f"P{k}" for k in range(6)], places)
    more = system.add_points(["Q"], places[:1] + 1.0)
    length = system.add_scalars(["length"], [3.0])
    system.add("Dist3D", {"p1": points[:3], "p2": points[3:]}, [1.0, 2.0, 3.0], SIGMA)
    system.add("Dist3D", {"p1": points[0], "p2": points[1:]}, np.ones(5), SIGMA)
    system.add("Dist3D", {"p1": more, "p2": points[1:2]}, [5.0], SIGMA, labels=["Q to P1"])
    system.add("Dist3DParam", {"distance": length, "p1": points[:1], "p2": more}, None, PRIOR)
    system.add_prior(points, places, PRIOR)
    system.add_prior(more, places[:1], [PRIOR])
    system.freeze(points[:1])


def calls_of_ten(rounds: int) -> float:
    """Microseconds of each of ten calls that build a system: the least of many rounds."""
    return 1e5 * min(timeit.repeat(ten_calls, time.process_time, repeat=20 * rounds, number=5)) / 5.0


def _repeat(work: Callable[[], Array], count: int) -> None:
    for _ in range(count):
        work()


def asked() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("--points", type=int, nargs="+", default=POINTS)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--jacobian", action="store_true", help="give SciPy the derivatives")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the table as JSON")
    return parser.parse_args()


def main() -> int:
    """Reads the command line, benches, prints the table."""
    arguments = asked()
    rows = [bench(n, arguments.rounds, arguments.jacobian) for n in arguments.points]
    titles = ("unknowns", "distances", "obseq ms", "scipy ms", "obseq/scipy", "differ by", "together")
    print("".join(f"{title:>12}" for title in titles))
    for row in rows:
        print(
            f"{row.unknowns:12}{row.distances:12}{row.obseq:12.2f}{row.scipy:12.2f}{row.ratio:12.2f}"
            f"{row.disagreement:12.1e}{row.together:12.2f}"
        )
    print(f"ten calls that build a system: {calls_of_ten(arguments.rounds):.0f} us each")
    write_json(arguments.json, [asdict(row) for row in rows])
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
