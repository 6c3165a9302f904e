"""Times the solvers on survey and levelling networks, one after the other in each round.

Run `python tools/benchmarks/bench_solvers.py survey-10k survey-100k levelling-1m --json out.json`. It prints,
for each phase, the median over the rounds and the median ratio to each witness in the same round. PARDISO is
a witness where pypardiso is installed; SuperLU, which takes long, runs once and only up to `--superlu-limit`.
"""

from __future__ import annotations

import json
import os
import platform
import resource
import sys
import time
from dataclasses import asdict, dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from command import command_line

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

    import numpy as np

    from obseq.leastsquares.solvers import Solver, SymmetricPattern

PHASES = ("analyse", "factor", "refactor", "solve", "selected inverse")
OURS = "supernodal"


@dataclass
class Timings:
    """Seconds of each phase of one solver, one number per round, and what the solver says of itself."""

    seconds: dict[str, list[float]] = field(default_factory=lambda: {phase: [] for phase in PHASES})
    statistics: dict[str, Any] = field(default_factory=dict)


def survey(n_points: int) -> tuple[SymmetricPattern, np.ndarray]:
    """Points seen from 4 or 5 of the nearest stations: direction, zenith angle, distance.

    A quarter of the points are stations, with one orientation unknown each; one point in a hundred is known.
    """
    import numpy as np
    from scipy.sparse import csr_array, diags_array
    from scipy.spatial import cKDTree

    from obseq.leastsquares.solvers import SymmetricPattern

    generator = np.random.default_rng(0)
    side = 100.0 * np.sqrt(n_points)
    points = np.column_stack(
        [generator.uniform(0.0, side, (n_points, 2)), generator.uniform(0.0, 50.0, n_points)]
    )
    stations = np.sort(generator.choice(n_points, int(0.245 * n_points), replace=False))
    near = cKDTree(points[stations, :2]).query(points[:, :2], 6)[1]
    seen = stations[near] != np.arange(n_points)[:, None]
    seen &= np.cumsum(seen, axis=1) <= np.where(generator.random(n_points) < 0.75, 5, 4)[:, None]
    target, rank = np.nonzero(seen)
    used, station = np.unique(near[target, rank], return_inverse=True)
    stations = stations[used]
    sight = points[target] - points[stations[station]]
    jacobian = _polar_derivatives(sight)
    unknowns = np.column_stack(
        [
            3 * stations[station][:, None] + np.arange(3),
            3 * target[:, None] + np.arange(3),
            3 * n_points + station,
        ]
    )
    m, n = len(target), 3 * n_points + len(stations)
    rows = np.repeat(np.arange(3 * m), 7)
    design = csr_array((jacobian.ravel(), (rows, np.repeat(unknowns, 3, axis=0).ravel())), shape=(3 * m, n))
    known = np.zeros(n)
    known[(3 * np.arange(0, n_points, 100)[:, None] + np.arange(3)).ravel()] = 1e3**2
    return SymmetricPattern.of(design.T @ design + diags_array(known))


def _polar_derivatives(sight: np.ndarray) -> np.ndarray:
    """(m, 3, 7) derivatives of direction, zenith angle, distance over 1 mgon, 1.6 mgon and 2 mm."""
    import numpy as np

    flat = np.hypot(sight[:, 0], sight[:, 1])
    slope = np.linalg.norm(sight, axis=1)
    zero = np.zeros_like(flat)
    direction = np.column_stack([sight[:, 1] / flat**2, -sight[:, 0] / flat**2, zero])
    horizontal = sight[:, :2] * (sight[:, 2] / (slope**2 * flat))[:, None]
    zenith = np.column_stack([horizontal, -flat / slope**2])
    distance = sight / slope[:, None]
    derivatives = np.zeros((len(sight), 3, 7))
    sigmas = (1e-3 * np.pi / 200, 1.6e-3 * np.pi / 200, 2e-3)
    for row, (gradient, sigma) in enumerate(zip((direction, zenith, distance), sigmas, strict=True)):
        derivatives[:, row, :3] = -gradient / sigma
        derivatives[:, row, 3:6] = gradient / sigma
    derivatives[:, 0, 6] = -1.0 / sigmas[0]
    return derivatives


def levelling(side: int, between: int) -> tuple[SymmetricPattern, np.ndarray]:
    """Square net of `side` x `side` junctions, `between` bench marks on each line; one height is known."""
    import numpy as np
    from scipy.sparse import coo_array

    from obseq.leastsquares.solvers import SymmetricPattern

    junction = np.arange(side * side).reshape(side, side)
    ends = np.vstack(
        [
            np.column_stack([junction[:, :-1].ravel(), junction[:, 1:].ravel()]),
            np.column_stack([junction[:-1].ravel(), junction[1:].ravel()]),
        ]
    )
    marks = side * side + np.arange(len(ends) * between).reshape(len(ends), between)
    lines = np.column_stack([ends[:, 0], marks, ends[:, 1]])
    a, b = lines[:, :-1].ravel(), lines[:, 1:].ravel()
    n = side * side + len(ends) * between
    weights = np.random.default_rng(0).uniform(0.5, 2.0, len(a))
    rows, columns = (
        np.concatenate([a, b, np.maximum(a, b), [0]]),
        np.concatenate([a, b, np.minimum(a, b), [0]]),
    )
    entries = np.concatenate([weights, weights, -weights, [1.0]])
    return SymmetricPattern.of(coo_array((entries, (rows, columns)), shape=(n, n)))


PROBLEMS: dict[str, Callable[[], tuple[Any, Any]]] = {
    "survey-1k": lambda: survey(1_000),
    "survey-10k": lambda: survey(10_000),
    "survey-100k": lambda: survey(100_000),
    "levelling-10k": lambda: levelling(10, 55),
    "levelling-1m": lambda: levelling(100, 50),
    "chain-1m": lambda: levelling(2, 250_000),
}


def solvers_for(n: int, options: argparse.Namespace) -> dict[str, Solver]:
    """Ours first, then the witnesses that are there."""
    from obseq.leastsquares.solvers.cholesky import SupernodalCholesky
    from obseq.leastsquares.solvers.outside.pardiso import Pardiso
    from obseq.leastsquares.solvers.outside.superlu import SuperLU

    chosen: dict[str, Solver] = {OURS: SupernodalCholesky(ordering=options.ordering, threads=options.threads)}
    if find_spec("pypardiso") is not None:
        chosen["pardiso"] = Pardiso()
    if n <= options.superlu_limit:
        chosen["superlu"] = SuperLU()
    return chosen


def measure(
    pattern: SymmetricPattern,
    values: np.ndarray,
    solvers: dict[str, Solver],
    rounds: int,
    clock: Callable[[], float],
) -> dict[str, Timings]:
    """Times all phases of all solvers, the solvers taking turns in each round."""
    import numpy as np

    timings = {name: Timings() for name in solvers}
    rhs = np.random.default_rng(1).normal(size=pattern.n)

    def timed(name: str, phase: str, step: Callable[[], object]) -> None:
        start = clock()
        step()
        timings[name].seconds[phase].append(clock() - start)

    for name, solver in solvers.items():
        timed(name, "analyse", lambda solver=solver: solver.analyse(pattern))
        timed(name, "factor", lambda solver=solver: solver.factor(values))
        timings[name].statistics = asdict(solver.statistics)
    for turn in range(rounds):
        for name, solver in solvers.items():
            if name == "superlu" and turn > 0:
                continue
            solver.invalidate()  # the same values would not be factored again
            timed(name, "refactor", lambda solver=solver: solver.factor(values))
            timed(name, "solve", lambda solver=solver: solver.solve(rhs))
            if name == OURS:
                timed(name, "selected inverse", solver.selected_inverse)
    return timings


def warm_up(options: argparse.Namespace) -> None:
    """Compiles and loads everything on a small network, so that no phase pays for it."""
    pattern, values = survey(300)
    for solver in solvers_for(pattern.n, options).values():
        solver.analyse(pattern)
        solver.factor(values)
        solver.solve(values[: pattern.n])
        solver.selected_inverse()


def ratio(timings: dict[str, Timings], phase: str, witness: str) -> float | None:
    """Median over the rounds of our time over the witness's."""
    from statistics import median

    pairs = zip(timings[OURS].seconds[phase], timings[witness].seconds[phase], strict=False)
    ratios = [ours / theirs for ours, theirs in pairs if theirs > 0]
    return median(ratios) if ratios else None


def report(name: str, timings: dict[str, Timings]) -> dict[str, Any]:
    """Prints the table of one problem; returns it for JSON."""
    from statistics import median

    witnesses = [solver for solver in timings if solver != OURS]
    summary: dict[str, Any] = {"problem": name, "solvers": {}, "ratios": {}}
    for solver, timing in timings.items():
        statistics = timing.statistics
        medians = {phase: median(values) for phase, values in timing.seconds.items() if values}
        summary["solvers"][solver] = {"seconds": medians, "statistics": statistics}
        million, gigaflop = statistics["nnz_factor"] / 1e6, statistics["flops"] / 1e9
        print(f"{name} {solver}: {statistics['n']} unknowns, {statistics['ordering']}")
        print(f"    {million:.2f} million entries, {gigaflop:.2f} Gflop, {statistics['memory'] / 1e6:.0f} MB")
        for phase, value in medians.items():
            print(f"    {phase:17s} {value:9.4f} s")
    for phase in PHASES:
        against = {witness: ratio(timings, phase, witness) for witness in witnesses}
        summary["ratios"][phase] = against
        shown = ", ".join(
            f"{value:.2f} x {witness}" for witness, value in against.items() if value is not None
        )
        if shown:
            print(f"    {phase:17s} {shown}")
    ours = summary["solvers"][OURS]["seconds"]
    summary["ratios"]["selected inverse / refactor"] = ours["selected inverse"] / ours["refactor"]
    print(f"    selected inverse  {ours['selected inverse'] / ours['refactor']:.2f} x refactor")
    return summary


def arguments() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("problems", nargs="*", default=["survey-10k"], choices=PROBLEMS, metavar="PROBLEM")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--ordering", default="auto")
    parser.add_argument(
        "--clock", choices=("cpu", "wall"), default=None, help="cpu with one thread, else wall"
    )
    parser.add_argument("--superlu-limit", type=int, default=50_000, help="unknowns up to which SuperLU runs")
    parser.add_argument("--json", type=Path, help="file to write")
    return parser.parse_args()


def main() -> int:
    """Runs the problems asked for."""
    options = arguments()
    for variable in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ[variable] = str(options.threads)
    use_cpu = options.clock == "cpu" or (options.clock is None and options.threads == 1)
    clock = time.process_time if use_cpu else time.perf_counter
    warm_up(options)
    summaries = []
    for name in options.problems:
        pattern, values = PROBLEMS[name]()
        solvers = solvers_for(pattern.n, options)
        summaries.append(report(name, measure(pattern, values, solvers, options.rounds, clock)))
        del solvers
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory of the process {peak:.0f} MB")
    if options.json:
        document = {
            "clock": "cpu" if use_cpu else "wall",
            "threads": options.threads,
            "machine": platform.machine(),
            "peak_mb": peak,
            "problems": summaries,
        }
        options.json.write_text(json.dumps(document, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
