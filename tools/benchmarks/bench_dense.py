"""Where the sparse solver begins to pay: whole solutions of small systems by either one, in milliseconds.

Each system is solved, all standard deviations included, in a process of its own: once, which loads what the
solver needs (modules, compiled code), and again and again, each time as a new system. Building it is not in
the figures, assembly is. CPU time, so that other work does not matter much.

    python tools/objects.py --into objects --formulas Dist3D
    python tools/benchmarks/bench_dense.py --objects objects
    python tools/benchmarks/bench_dense.py --unknowns 150 300 --rounds 15 --json dense.json

The limit, `selection.SMALL`, is where a process that solves one such system and ends loses nothing by the
sparse solver; with objects, as wheels have them.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from command import command_line, write_json

from obseq.arrays import FloatRows, IntRows
from obseq.compilation import objects
from obseq.leastsquares import LeastSquares

UNKNOWNS = 100, 150, 200, 250, 300, 400, 500, 700, 1000
SIDES = {"dense": 10**9, "sparse": 0}
"""The limits that make a solver that of all systems."""


def survey(unknowns: int) -> LeastSquares:
    """Points of a square grid, joined to those within two and a half sides by distances: some twenty each."""
    side = round((unknowns / 3) ** 0.5)
    grid = 100.0 * np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    first, second = np.triu_indices(len(grid), 1)
    near = np.linalg.norm(grid[first] - grid[second], axis=1) < 250.0
    return distances(grid, np.stack([first[near], second[near]]))


def traverse(unknowns: int) -> LeastSquares:
    """Points along a line, each joined to the next two."""
    number = np.arange(unknowns // 3)
    pairs = [np.stack([number[:-step], number[step:]]) for step in (1, 2)]
    return distances(np.column_stack([100.0 * number, np.zeros(len(number))]), np.concatenate(pairs, axis=1))


def distances(plan: FloatRows, pairs: IntRows) -> LeastSquares:
    """A network of distances between points (n, 2) that are known to a decimetre, and uneven in height."""
    random = np.random.default_rng(0)
    places = np.column_stack([plan, random.uniform(-20.0, 20.0, len(plan))])
    system = LeastSquares()
    names = [f"P{k}" for k in range(len(places))]
    points = system.add_points(names, places + random.normal(0.0, 0.05, places.shape))
    lengths = np.linalg.norm(places[pairs[1]] - places[pairs[0]], axis=1)
    ends = {"p1": points[pairs[0]], "p2": points[pairs[1]]}
    system.add("Dist3D", ends, lengths + random.normal(0.0, 1e-3, len(lengths)), 1e-3)
    system.add_prior(points, places, 0.1)
    return system


def levelling(unknowns: int) -> LeastSquares:
    """Heights at the crossings of a square net of levelled lines."""
    side = round(unknowns**0.5)
    number = np.arange(side * side).reshape(side, side)
    back = np.concatenate([number[:, :-1].ravel(), number[:-1].ravel()])
    fore = np.concatenate([number[:, 1:].ravel(), number[1:].ravel()])
    system, one = LeastSquares(), np.ones((len(back), 1))
    heights = system.add_scalars([f"M{k}" for k in range(side * side)], np.zeros(side * side))
    measured = np.random.default_rng(0).normal(0.0, 1e-3, len(back))
    system.add_linear([heights[back], heights[fore]], [-one, one], measured, 1e-3)
    system.add_prior(heights[:1], [[0.0]], 1e-3)
    return system


def strip(unknowns: int) -> LeastSquares:
    """Images along a strip, as their tie points leave them: six unknowns each, tied to the eight before."""
    images, random = unknowns // 6, np.random.default_rng(0)
    system = LeastSquares()
    names = [f"I{k}" for k in range(images)]
    parts = [system.add_points([f"{name}{part}" for name in names], np.zeros((images, 3))) for part in "ab"]
    for step in range(1, 9):
        back, fore = np.arange(images - step), np.arange(step, images)
        blocks = [part[end] for end in (back, fore) for part in parts]
        for _ in range(6):
            factors = [random.normal(size=(len(back), 3)) for _ in blocks]
            system.add_linear(blocks, factors, random.normal(0.0, 1e-3, len(back)), 1e-3)
    for part in parts:
        system.add_prior(part, np.zeros((images, 3)), 1.0)
    return system


KINDS: dict[str, Callable[[int], LeastSquares]] = {
    "survey": survey,
    "levelling": levelling,
    "traverse": traverse,
    "strip": strip,
}


def spent(system: LeastSquares) -> float:
    """Milliseconds of a solution with the covariances that a report asks for."""
    start = time.process_time()
    system.solve(covariance=True)
    return 1e3 * (time.process_time() - start)


def here(kind: str, unknowns: int, side: str, rounds: int) -> tuple[float, float]:
    """(first, usual) milliseconds of this process with one of the solvers."""
    from obseq.leastsquares.solvers import selection

    levelling(9).solve(covariance=True)  # what both solvers need
    selection.SMALL = SIDES[side]  # type: ignore[misc]
    first = spent(KINDS[kind](unknowns))
    return first, statistics.median(spent(KINDS[kind](unknowns)) for _ in range(rounds))


def apart(kind: str, unknowns: int, side: str, options: argparse.Namespace) -> tuple[float, float]:
    """The same of a process of its own, which finds Python's own compiled files, as usual."""
    command = [
        sys.executable,
        __file__,
        "--alone",
        kind,
        str(unknowns),
        side,
        "--rounds",
        str(options.rounds),
    ]
    command += ["--objects", str(options.objects)] if options.objects else []
    usual_files = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=usual_files)
    first, usual = json.loads(done.stdout)
    return first, usual


def main() -> int:
    """Reads the command line, runs the processes, prints and writes the table."""
    parser = command_line(__doc__)
    parser.add_argument("--kinds", nargs="+", choices=tuple(KINDS), default=tuple(KINDS))
    parser.add_argument("--unknowns", type=int, nargs="+", default=UNKNOWNS)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument(
        "--objects", type=Path, metavar="DIR", help="where machine code is (tools/objects.py)"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the table as JSON")
    parser.add_argument("--alone", nargs=3, metavar=("KIND", "UNKNOWNS", "SOLVER"))
    options = parser.parse_args()
    if options.objects:
        objects.FOLDER = options.objects.absolute()
    if options.alone:
        kind, unknowns, side = options.alone
        print(json.dumps(here(kind, int(unknowns), side, options.rounds)))
        return 0
    rows = []
    print(f"{'':12}{'unknowns':>9}{'dense':>18}{'sparse':>18}   (ms of CPU, first and usual)")
    for kind in options.kinds:
        for unknowns in options.unknowns:
            figures = {side: apart(kind, unknowns, side, options) for side in SIDES}
            shown = "".join(f"{first:9.1f}{usual:9.2f}" for first, usual in figures.values())
            print(f"{kind:12}{unknowns:9}{shown}", flush=True)
            rows.append({"kind": kind, "unknowns": unknowns} | figures)
    write_json(options.json, rows)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
