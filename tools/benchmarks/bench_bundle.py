"""Bundle adjustment: seconds of an iteration, ours beside Ceres, one thread each, in turn.

    python tools/benchmarks/bench_bundle.py [FILE of the collection Bundle Adjustment in the Large ...]

Without a file, a synthetic problem of 50 cameras, 10,000 points and 40,000 observations. Ceres is that of the
system (Debian: libceres-dev), called by `bench_bundle.cpp` with its best solver for such problems,
derivatives by automatic differentiation and AVX. Times are of the processor, for all Levenberg-Marquardt
iterations divided by their number; what is done once (structure, first use) is left out on both sides.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from shutil import which
from statistics import median
from typing import TYPE_CHECKING, Any

from bal import Problem, bundle, read_problem, synthetic_problem, write_problem

if TYPE_CHECKING:
    from obseq.leastsquares import LeastSquares

SOURCE = Path(__file__).with_suffix(".cpp")
OPTIONS = ("-O3", "-march=native", "-DEIGEN_MAX_ALIGN_BYTES=16", "-std=c++17", "-I/usr/include/eigen3")
CERES = Path("/usr/include/ceres/ceres.h")


@dataclass(frozen=True)
class Run:
    """What one engine did: seconds of an iteration, their number, half the sum of squares at both ends."""

    seconds: float
    iterations: int
    first_cost: float
    last_cost: float


def rival(folder: Path) -> Path | None:
    """The compiled rival; None without a compiler or without Ceres."""
    if which("g++") is None or not CERES.exists():
        return None
    program = folder / "rival"
    subprocess.run(["g++", *OPTIONS, str(SOURCE), "-o", str(program), "-lceres", "-lglog"], check=True)
    return program


def run_rival(program: Path, file: Path, iterations: int) -> Run:
    """One run of Ceres."""
    command = [str(program), str(file), str(iterations)]
    alone = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    answer = subprocess.run(command, check=True, capture_output=True, text=True, env=alone).stdout.split()
    done = int(answer[1])
    return Run(float(answer[0]) / done, done, float(answer[2]), float(answer[3]))


def run_ours(system: LeastSquares, start: Any, iterations: int) -> Run:
    """One run of ours from the start; equations and solver are there already."""
    from obseq.leastsquares.assembly.threads import blas_threads
    from obseq.leastsquares.iterations.arrival import Options
    from obseq.leastsquares.iterations.runs import iterations_of
    from obseq.leastsquares.iterations.strategies import strategy_of

    system.unknowns.restore(start)
    analysis = system.analysis(reduced=True)
    equations = analysis.equations
    run = iterations_of(strategy_of("levenberg-marquardt"), equations, analysis.solver)
    begin = time.process_time()
    with blas_threads(1):
        done = run(Options(iterations, -1.0), 1, lambda _: None, lambda _: None).iterations
    seconds = time.process_time() - begin
    last = sum(equations.sums_of_squares().values())
    return Run(seconds / len(done), len(done), done[0].cost / 2, last / 2)


def compare(problem: Problem, program: Path | None, iterations: int, rounds: int) -> dict[str, Any]:
    """Medians of interleaved rounds; ours does as many iterations as Ceres needs."""
    system = bundle(problem)
    start = system.unknowns.state()
    run_ours(system, start, 1)
    ours, theirs = [], []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "problem.txt"
        write_problem(problem, file)
        for _ in range(rounds):
            if program is not None:
                theirs.append(run_rival(program, file, iterations))
                iterations = theirs[-1].iterations
            ours.append(run_ours(system, start, iterations))
    figures: dict[str, Any] = {"ours": summary(ours)}
    if theirs:
        ratios = [a.seconds / b.seconds for a, b in zip(ours, theirs, strict=True)]
        figures |= {"ceres": summary(theirs), "ratio": median(ratios)}
    return figures


def summary(runs: list[Run]) -> dict[str, float]:
    """Median seconds of an iteration; the rest is the same in all rounds."""
    return vars(runs[0]) | {"seconds": median(run.seconds for run in runs)}


def main() -> None:
    """Runs the problems asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--iterations", type=int, default=10)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--json", type=Path, help="file to write")
    options = parser.parse_args()
    problems = {file.name: read_problem(file) for file in options.files}
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        program = rival(Path(folder))
        if program is None:
            print("no g++ or no Ceres here: ours alone")
        for name, problem in (problems or {"synthetic": synthetic_problem()}).items():
            results[name] = compare(problem, program, options.iterations, options.rounds)
            show(name, problem, results[name])
    if options.json:
        options.json.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


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
        print(f"    ours / ceres {figures['ratio']:.2f}")


if __name__ == "__main__":
    main()
