"""The large scale of one machine: surveys of 100,000 points, levelling nets of a million heights, by phases.

The equations are built in memory through `LeastSquares`; then come the layout of the normal equations,
assembly, analysis, factorisation, solution and all standard deviations, each with its time, and the peak of
memory. Where pypardiso is installed, MKL PARDISO factors the same matrix, in turn with ours.

    python tools/benchmarks/bench_network.py [--problem survey|levelling|chain] [--points N] [--threads N]
        [--json FILE]

Times are of the wall clock, and of the processor (all threads together): on a busy machine the second is the
one to compare with one thread.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from command import command_line, write_json

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterator, Mapping, Sequence

    import numpy as np

    from obseq.leastsquares import LeastSquares
    from obseq.leastsquares.assembly.normal_equations import NormalEquations
    from obseq.leastsquares.solvers import Solver

SIGMA_DIRECTION = 1e-3 * 3.141592653589793 / 200
SIGMA_ZENITH = 1.6e-3 * 3.141592653589793 / 200
SIGMA_DISTANCE = 2e-3
SIGMA_KNOWN = 1e-3
START_ERROR = 0.05
BAND = 1500.0
"""Width in metres of the bands along which points are numbered, as a survey that proceeds by areas does."""


@dataclass
class Clock:
    """Seconds of each phase, wall and processor, one pair per time it was run."""

    wall: dict[str, list[float]] = field(default_factory=dict)
    cpu: dict[str, list[float]] = field(default_factory=dict)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Times what is done inside."""
        wall, cpu = time.perf_counter(), time.process_time()
        yield
        self.wall.setdefault(name, []).append(time.perf_counter() - wall)
        self.cpu.setdefault(name, []).append(time.process_time() - cpu)

    def medians(self) -> dict[str, dict[str, float]]:
        """Median seconds of each phase."""
        return {
            name: {"wall": median(self.wall[name]), "cpu": median(self.cpu[name]), "times": len(values)}
            for name, values in self.cpu.items()
        }


def survey(n_points: int, threads: int) -> LeastSquares:
    """Points seen from 4 or 5 of the nearest stations: direction, zenith angle, distance.

    A quarter of the points are stations, plumb, with one orientation unknown each; one in a hundred is known
    to a millimetre. Points are numbered band by band, observations are listed by station.
    """
    import numpy as np

    from obseq.leastsquares import LeastSquares

    rng = np.random.default_rng(0)
    points = _scattered(n_points, rng)
    stations, station, target = _sights(points, rng)
    turn = rng.uniform(-np.pi, np.pi, len(stations))
    system = LeastSquares(threads=threads)
    names = [f"P{k}" for k in range(n_points)]
    ids = system.add_points(names, points + rng.normal(0.0, START_ERROR, points.shape))
    turns = system.add_rotations([names[k] for k in stations], _about_z(turn))
    system.freeze(turns, ("x", "y"))
    known = np.arange(0, n_points, 100)
    system.add_prior(ids[known], points[known] + rng.normal(0.0, SIGMA_KNOWN, (len(known), 3)), SIGMA_KNOWN)
    sight = points[target] - points[stations[station]]
    slope = np.linalg.norm(sight, axis=1)
    noise = rng.normal(size=(3, len(target)))
    direction = np.arctan2(sight[:, 0], sight[:, 1]) + turn[station] + SIGMA_DIRECTION * noise[0]
    zenith = np.column_stack([np.arccos(sight[:, 2] / slope) + SIGMA_ZENITH * noise[1], np.zeros(len(slope))])
    pose = {"station.centre": ids[stations[station]], "station.rotation": turns[station]}
    system.add("TopoHz", pose | {"target": ids[target]}, direction, SIGMA_DIRECTION)
    system.add("TopoZen", pose | {"target": ids[target]}, zenith, SIGMA_ZENITH)
    ends = {"p1": ids[stations[station]], "p2": ids[target]}
    system.add("Dist3D", ends, slope + SIGMA_DISTANCE * noise[2], SIGMA_DISTANCE)
    return system


def _scattered(n_points: int, rng: np.random.Generator) -> np.ndarray:
    """Points at random, one per hectare, numbered along bands."""
    import numpy as np

    side = 100.0 * np.sqrt(n_points)
    flat = rng.uniform(0.0, side, (n_points, 2))
    flat = flat[np.lexsort((flat[:, 0], flat[:, 1] // BAND))]
    return np.column_stack([flat, rng.uniform(0.0, 50.0, n_points)])


def _sights(points: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points that are stations; for each sight the number of its station among them, and its target."""
    import numpy as np
    from scipy.spatial import cKDTree

    n = len(points)
    stations = np.sort(rng.choice(n, int(0.245 * n), replace=False))
    near = np.asarray(cKDTree(points[stations, :2]).query(points[:, :2], 6)[1])
    seen = stations[near] != np.arange(n)[:, None]
    seen &= np.cumsum(seen, axis=1) <= np.where(rng.random(n) < 0.75, 5, 4)[:, None]
    target, rank = np.nonzero(seen)
    station = near[target, rank]
    order = np.argsort(station, kind="stable")
    return stations, station[order], target[order]


def _about_z(angle: np.ndarray) -> np.ndarray:
    """Rotations from instruments to the world whose y axes point `angle` to the left of the north."""
    import numpy as np

    cosine, sine, zero = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    rows = [cosine, -sine, zero, sine, cosine, zero, zero, zero, zero + 1.0]
    return np.stack(rows, axis=1).reshape(-1, 3, 3)


def levelling(n_points: int, threads: int) -> LeastSquares:
    """Square net of 100 x 100 junctions joined by lines of bench marks; one height is known."""
    import numpy as np

    side = 100
    junction = np.arange(side * side).reshape(side, side)
    ends = np.vstack(
        [
            np.column_stack([junction[:, :-1].ravel(), junction[:, 1:].ravel()]),
            np.column_stack([junction[:-1].ravel(), junction[1:].ravel()]),
        ]
    )
    between = max(1, (n_points - side * side) // len(ends))
    marks = side * side + np.arange(len(ends) * between).reshape(len(ends), between)
    lines = np.column_stack([ends[:, 0], marks, ends[:, 1]])
    return _levelled(side * side + len(ends) * between, lines[:, :-1].ravel(), lines[:, 1:].ravel(), threads)


def chain(n_points: int, threads: int) -> LeastSquares:
    """One line of bench marks, levelled once, closed on its start."""
    import numpy as np

    marks = np.arange(n_points)
    return _levelled(n_points, marks, np.roll(marks, -1), threads)


def _levelled(n: int, back: np.ndarray, fore: np.ndarray, threads: int) -> LeastSquares:
    import numpy as np

    from obseq.leastsquares import LeastSquares

    rng = np.random.default_rng(0)
    sigmas = np.sqrt(rng.uniform(0.5, 2.0, len(back))) * 1e-3
    system = LeastSquares(threads=threads)
    heights = system.add_scalars([f"M{k}" for k in range(n)], np.zeros(n))
    one = np.ones((len(back), 1))
    measured = rng.normal(0.0, sigmas)
    system.add_linear([heights[back], heights[fore]], [-one, one], measured, sigmas)
    system.add_prior(heights[:1], [[0.0]], SIGMA_KNOWN)
    return system


PROBLEMS: dict[str, Callable[[int, int], LeastSquares]] = {
    "survey": survey,
    "levelling": levelling,
    "chain": chain,
}
DEFAULT_POINTS = {"survey": 100_000, "levelling": 1_000_000, "chain": 1_000_000}


def our_solver(threads: int) -> Solver:
    """The supernodal Cholesky."""
    from obseq.leastsquares.solvers.cholesky import SupernodalCholesky

    return SupernodalCholesky(threads=threads)


def measure(problem: str, n_points: int, threads: int, rounds: int) -> dict[str, Any]:
    """Figures of one problem; ours alone first, so that the peak of memory is ours."""
    clock = Clock()
    with clock.phase("unknowns and equations"):
        system = PROBLEMS[problem](n_points, threads)
    with clock.phase("pattern and positions"):
        equations = system.equations()
    solver = our_solver(threads)
    with clock.phase("symbolic analysis"):
        solver.analyse(equations.pattern)
    for turn in range(rounds + 1):
        first = ", first" if turn == 0 else ""
        with clock.phase(f"assembly{first}"):
            linearisation = equations.assemble()
        solver.invalidate()  # the same values would not be factored again
        with clock.phase(f"factorisation{first}"):
            solver.factor(linearisation.values)
        with clock.phase(f"solution{first}"):
            step = solver.solve(-linearisation.gradient)
        if turn < rounds:
            system.unknowns.move(equations.step(step, linearisation))
    for _ in range(rounds):
        with clock.phase("all standard deviations"):
            inverse = solver.selected_inverse()
        with clock.phase("residuals and cost"):
            equations.sums_of_squares()
    seconds, n = clock.medians(), system.n_observations
    figures: dict[str, Any] = {
        "problem": problem,
        "points": n_points,
        "threads": threads,
        "unknowns": equations.pattern.n,
        "observations": n,
        "nnz": equations.pattern.nnz,
        "nnz_factor": solver.statistics.nnz_factor,
        "gigaflop": solver.statistics.flops / 1e9,
        "ordering": solver.statistics.ordering,
        "sigma0": (linearisation.cost / system.redundancy) ** 0.5 if system.redundancy else None,
        "largest_precision": float(inverse[equations.pattern.diagonal].max() ** 0.5),
        "seconds": seconds,
        "assembly_ns": 1e9 * seconds["assembly"]["wall"] / n,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    deviations, factor = seconds["all standard deviations"], seconds["factorisation"]
    figures["standard deviations / factorisation"] = deviations["wall"] / factor["wall"]
    if find_spec("pypardiso") is not None:
        figures["pardiso"] = against_pardiso(equations, linearisation.values, solver, threads, rounds)
    return figures


def against_pardiso(
    equations: NormalEquations, values: np.ndarray, ours: Solver, threads: int, rounds: int
) -> dict[str, float]:
    """Refactorisation and solution of the same matrix, in turn: medians, and median ratios."""
    import numpy as np

    from obseq.leastsquares.solvers.outside.pardiso import Pardiso

    other, clock, right = Pardiso(), Clock(), np.ones(equations.pattern.n)
    with clock.phase("analyse"):
        other.analyse(equations.pattern)
    other.factor(values)
    for _ in range(rounds):
        for name, solver in (("ours", ours), ("pardiso", other)):
            solver.invalidate()
            with clock.phase(f"factor {name}"):
                solver.factor(values)
            with clock.phase(f"solve {name}"):
                solver.solve(right)
    seconds = clock.cpu if threads == 1 else clock.wall
    return {name: median(times) for name, times in seconds.items()} | {"ratio": _ratio(seconds)}


def _ratio(seconds: Mapping[str, Sequence[float]]) -> float:
    """The middle one of our times over the rival's."""
    both = zip(seconds["factor ours"], seconds["factor pardiso"], strict=True)
    return median([ours / theirs for ours, theirs in both])


def show(figures: dict[str, Any]) -> None:
    """Prints the figures of one problem."""
    print(
        f"{figures['problem']}: {figures['points']} points, {figures['unknowns']} unknowns, "
        f"{figures['observations']} observations, {figures['threads']} thread(s)"
    )
    print(
        f"    N {figures['nnz'] / 1e6:.2f} million entries, factor {figures['nnz_factor'] / 1e6:.2f}, "
        f"{figures['gigaflop']:.2f} Gflop, {figures['ordering']}"
    )
    print(f"    {'phase':28}{'wall s':>9}{'cpu s':>9}")
    for name, seconds in figures["seconds"].items():
        print(f"    {name:28}{seconds['wall']:9.3f}{seconds['cpu']:9.3f}")
    print(f"    assembly {figures['assembly_ns']:.0f} ns per observation")
    print(f"    standard deviations / factorisation {figures['standard deviations / factorisation']:.2f}")
    for name, value in figures.get("pardiso", {}).items():
        print(f"    against PARDISO, {name:16}{value:9.3f}")
    print(f"    sigma0 {figures['sigma0']}, peak memory {figures['peak_mb']:.0f} MB")


def arguments() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("--problem", choices=PROBLEMS, default="survey")
    parser.add_argument("--points", type=int, nargs="*", help="sizes, each in a process of its own")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", type=Path, help="file to write")
    return parser.parse_args()


def in_child(work: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Does the work in a forked process, whose peak of memory is its own."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        with os.fdopen(writing, "w") as answer:
            json.dump(work(), answer)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as answer:
        text = answer.read()
    os.waitpid(child, 0)
    if not text:
        sys.exit("a measurement failed; the message is above")
    figures: dict[str, Any] = json.loads(text)
    return figures


def warmed_measure(problem: str, points: int, threads: int, rounds: int) -> dict[str, Any]:
    """The same after a small problem, so that no phase pays for compilation."""
    measure(problem, 2_000 if problem == "survey" else 30_000, threads, 1)
    return measure(problem, points, threads, rounds)


def main() -> None:
    """Runs the sizes asked for."""
    options = arguments()
    for variable in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ[variable] = str(options.threads)
    results = []
    for points in options.points or [DEFAULT_POINTS[options.problem]]:
        work = partial(warmed_measure, options.problem, points, options.threads, options.rounds)
        results.append(in_child(work))
        show(results[-1])
    write_json(options.json, results)


if __name__ == "__main__":
    main()
