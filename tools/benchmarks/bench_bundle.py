"""Bundle adjustment: seconds of an iteration and of the whole, ours beside Ceres, in turn.

    python tools/benchmarks/bench_bundle.py [FILE of the collection Bundle Adjustment in the Large ...]
    python tools/benchmarks/bench_bundle.py --synthetic 100x30000x150000 200x100000x500000 --threads 1 2

Without a file, a synthetic problem of 50 cameras, 10,000 points and 40,000 observations. Ceres is that of the
system (Debian: libceres-dev), called by `bench_bundle.cpp` with the best of its solvers for each problem,
found by a first run of each: dense by Eigen or LAPACK, or sparse. Its derivatives are by automatic
differentiation and AVX. Times are for all Levenberg-Marquardt iterations divided by their number, of the
processor with one thread and of the clock with more; what is done once (structure, first use) is left out.
The whole begins with arrays and ends where each has converged by its own test. The same cost is the higher of
the two last costs, to a part in a million; the time to it is the whole up to the first step that reaches it.
Memory is what is resident at most beyond the program and the arrays, each in a process of its own.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from shutil import which
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np
from bal import Problem, bundle, read_problem, synthetic_problem, write_problem
from command import command_line, write_json

if TYPE_CHECKING:
    import argparse

    from obseq.leastsquares import LeastSquares

SOURCE = Path(__file__).with_suffix(".cpp")
OPTIONS = ("-O3", "-march=native", "-DEIGEN_MAX_ALIGN_BYTES=16", "-std=c++17", "-I/usr/include/eigen3")
SOLVERS = "eigen", "lapack", "sparse"
SYNTHETIC = "50x10000x40000"
MOST = 50
"""Iterations of a whole solution, at most."""
SAME = 1e-6
"""Share of a cost that does not count."""


@dataclass(frozen=True)
class Run:
    """What one engine did.

    Attributes:
        seconds: of an iteration.
        iterations: their number.
        first_cost: half the sum of squares at the start.
        last_cost: the same at the end.
        whole: seconds of the whole; 0 where it was not measured.
        memory: bytes resident at most beyond the program and the problem; 0 where they were not measured.
        trace: seconds from the beginning of the whole, and the cost then, step by step.
    """

    seconds: float
    iterations: int
    first_cost: float
    last_cost: float
    whole: float = 0.0
    memory: float = 0.0
    trace: tuple[tuple[float, float], ...] = ()

    def reached(self, cost: float) -> float:
        """Seconds until the cost is no higher than this one."""
        return next(seconds for seconds, found in self.trace if found <= cost * (1.0 + SAME))


def rival(folder: Path) -> Path | None:
    """The compiled rival; None without a compiler or without Ceres."""
    if which("g++") is None:
        return None
    program = folder / "rival"
    command = ["g++", *OPTIONS, str(SOURCE), "-o", str(program), "-lceres", "-lglog"]
    is_there = subprocess.run(command, check=False, capture_output=True).returncode == 0
    return program if is_there else None


def run_rival(program: Path, file: Path, iterations: int, threads: int, solver: str) -> Run:
    """One run of Ceres."""
    command = [str(program), str(file), str(iterations), str(threads), solver]
    blas = {"OPENBLAS_NUM_THREADS": str(threads), "OMP_NUM_THREADS": str(threads)}
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=os.environ | blas)
    seconds, count, *others = map(float, done.stdout.split())
    trace = tuple(zip(others[4::2], others[5::2], strict=True))
    return Run(seconds / count, int(count), *others[:4], trace)


def best_solver(program: Path, file: Path, iterations: int, threads: int) -> str:
    """The solver with which Ceres takes least time for this problem."""
    seconds = {name: run_rival(program, file, min(iterations, 4), threads, name).seconds for name in SOLVERS}
    return min(SOLVERS, key=lambda name: seconds[name])


def run_ours(system: LeastSquares, start: Any, iterations: int, threads: int = 1) -> Run:
    """One run of ours from the start; equations and solver are there already."""
    clock = time.process_time if threads == 1 else time.perf_counter
    from obseq.leastsquares.iterations.arrival import Options
    from obseq.leastsquares.iterations.runs import iterations_of
    from obseq.leastsquares.iterations.strategies import strategy_of
    from obseq.leastsquares.solvers.blas import one_blas_thread

    system.unknowns.restore(start)
    analysis = system.analysis(reduced=True)
    equations = analysis.equations
    run = iterations_of(strategy_of("levenberg-marquardt"), equations, analysis.solver)
    begin = clock()
    with one_blas_thread():
        done = run(Options(iterations, -1.0), 1, lambda _: None, lambda _: None).iterations
    seconds = clock() - begin
    last = sum(equations.sums_of_squares().values())
    return Run(seconds / len(done), len(done), done[0].cost / 2, last / 2)


def whole_of_ours(problem: Problem, threads: int) -> Run:
    """From arrays to the solution."""
    clock = time.process_time if threads == 1 else time.perf_counter
    begin, ends = clock(), []
    system = bundle(problem, threads=threads)
    options = {"max_iterations": MOST, "strategy": "levenberg-marquardt"}
    result = system.solve(**options, progress=lambda _: ends.append(clock() - begin))
    whole, iterations = clock() - begin, result.iterations
    costs = [*(each.cost / 2 for each in iterations[1:]), result.cost / 2]  # each is that of its beginning
    trace = tuple(zip(ends, costs, strict=True))
    return Run(whole / len(iterations), len(iterations), iterations[0].cost / 2, costs[-1], whole, 0.0, trace)


def memory_of_ours(folder: Path, problem: Problem, threads: int) -> float:
    """Bytes that a process of its own takes for the whole beyond what it has loaded."""
    file = folder / "problem.npz"
    np.savez(file, **vars(problem))
    command = [sys.executable, __file__, "--peak", str(file), "--threads", str(threads)]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def peak(file: Path, threads: int) -> float:
    """The same, in this process; a small problem is solved first, and loads what there is to load."""
    with np.load(file) as arrays:
        problem = Problem(**arrays)
    whole_of_ours(synthetic_problem(5, 100, 400), threads)
    Path("/proc/self/clear_refs").write_text("5")  # from here on the peak counts
    before = resident("VmRSS")
    whole_of_ours(problem, threads)
    return resident("VmHWM") - before


def resident(name: str) -> float:
    """Bytes by the name of a line of /proc/self/status."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024.0 * next(float(line.split()[1]) for line in lines if line.startswith(name + ":"))


def compare(
    problem: Problem, program: Path | None, iterations: int, rounds: int, threads: int
) -> dict[str, Any]:
    """Medians of interleaved rounds; ours does as many iterations as Ceres needs."""
    system = bundle(problem, threads=threads)
    start = system.unknowns.state()
    run_ours(system, start, 1, threads)
    ours, theirs, wholes, sames, memories, solver = [], [], [], [], [], ""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "problem.txt"
        write_problem(problem, file)
        if program is not None:
            solver = best_solver(program, file, iterations, threads)
        for _ in range(rounds):
            if program is not None:
                theirs.append(run_rival(program, file, iterations, threads, solver))
                iterations = theirs[-1].iterations
            ours.append(run_ours(system, start, iterations, threads))
            if program is not None:
                rival, own = run_rival(program, file, MOST, threads, solver), whole_of_ours(problem, threads)
                wholes.append(rival.whole / own.whole)
                cost = max(rival.last_cost, own.last_cost)
                sames.append(rival.reached(cost) / own.reached(cost))
                memories.append(rival.memory)
        if program is not None:
            memory = median(memories) / memory_of_ours(Path(folder), problem, threads)
    figures: dict[str, Any] = {"threads": threads, "ours": summary(ours)}
    if theirs:
        ratios = [a.seconds / b.seconds for a, b in zip(ours, theirs, strict=True)]
        figures |= {"ceres": summary(theirs), "solver": solver, "ratio": median(ratios)}
        figures |= {"whole": median(wholes), "same": median(sames), "memory": memory}
    return figures


def summary(runs: list[Run]) -> dict[str, float]:
    """Median seconds of an iteration; the rest is the same in all rounds."""
    first = {name: value for name, value in vars(runs[0]).items() if name != "trace"}
    return first | {"seconds": median(run.seconds for run in runs)}


def arguments() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--synthetic", nargs="+", default=[], metavar="CAMERASxPOINTSxOBSERVATIONS")
    parser.add_argument("--threads", type=int, nargs="+", default=[1])
    parser.add_argument("--iterations", type=int, default=10)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--json", type=Path, help="file to write")
    parser.add_argument("--peak", type=Path, metavar="FILE", help="print the memory of one problem, and end")
    return parser.parse_args()


def main() -> None:
    """Runs the problems asked for."""
    options = arguments()
    if options.peak:
        print(peak(options.peak, options.threads[0]))
        return
    problems = {file.name: read_problem(file) for file in options.files}
    asked = options.synthetic if options.files or options.synthetic else [SYNTHETIC]
    problems |= {f"synthetic {text}": synthetic_problem(*map(int, text.split("x"))) for text in asked}
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        program = rival(Path(folder))
        if program is None:
            print("no g++ or no Ceres here: ours alone")
        for name, problem in problems.items():
            for threads in options.threads:
                label = f"{name}, {threads} thread" + "s" * (threads > 1)
                results[label] = compare(problem, program, options.iterations, options.rounds, threads)
                show(label, problem, results[label])
    write_json(options.json, results)


def show(name: str, problem: Problem, figures: dict[str, Any]) -> None:
    """Prints the figures of one problem."""
    cameras, points, images = len(problem.cameras), len(problem.points), len(problem.images)
    print(f"{name}: {cameras} cameras, {points} points, {images} observations")
    for engine in ("ours", "ceres"):
        if engine in figures:
            run = figures[engine]
            print(
                f"    {engine:6}{1e3 * run['seconds']:9.2f} ms per iteration, {run['iterations']} of them, "
                f"cost {run['first_cost']:.6f} -> {run['last_cost']:.8g}"
            )
    if "ratio" in figures:
        print(f"    ours / ceres ({figures['solver']}) {figures['ratio']:.2f}", flush=True)
        whole, same, memory = figures["whole"], figures["same"], figures["memory"]
        print(
            f"    ceres / ours: the whole {whole:.2f}, to the same cost {same:.2f}, memory {memory:.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
