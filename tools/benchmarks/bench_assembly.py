"""From observations to normal equations: ours against MMVII's one observation at a time, as ratios.

Synthetic networks of distances and of horizontal directions are assembled by `obseq.leastsquares` and by
`bench_assembly.cpp` (MMVII's algorithm, with its copies and allocations), interleaved in one process.
Times are of the processor. Both start from the same unknowns and observations and must find the same
normal matrix.

    python tools/benchmarks/bench_assembly.py [--json FILE] [--rounds N]
"""

from __future__ import annotations

import argparse
import ctypes
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from command import write_json

from obseq.geometry import exponential
from obseq.leastsquares import LeastSquares

if TYPE_CHECKING:
    from obseq.leastsquares.assembly.normal_equations import NormalEquations

SOURCE = Path(__file__).with_suffix(".cpp")
SIGMA = 1e-3


@dataclass(frozen=True)
class Network:
    """A network for both sides.

    Attributes:
        name: what is printed.
        equations: ours.
        starts: (n, n_blocks) first unknown of each block, for the rival.
        stations: (n,) number of the rotation of each observation.
        rotations: (n_stations, 9) column by column.
        measured: (n,) observations.
        dense: whether the rival keeps a dense normal matrix.
    """

    name: str
    equations: NormalEquations
    starts: np.ndarray
    stations: np.ndarray
    rotations: np.ndarray
    measured: np.ndarray
    dense: bool


def grid(n_points: int) -> np.ndarray:
    """Points of a square grid of 50 m, with heights, numbered row by row."""
    side = int(np.ceil(np.sqrt(n_points)))
    numbers = np.arange(n_points)
    waves = 5.0 * np.sin(numbers * 0.7)
    return np.column_stack([50.0 * (numbers % side), 50.0 * (numbers // side), waves])


def neighbours(first: np.ndarray, n_points: int, rng: np.random.Generator) -> np.ndarray:
    """For each point another one, at most two rows and columns of the grid away."""
    side = int(np.ceil(np.sqrt(n_points)))
    shift = rng.integers(-2, 3, len(first)) + side * rng.integers(-2, 3, len(first))
    other = (first + shift) % n_points
    return np.where(other == first, (first + 1) % n_points, other)


def distances(n_points: int, n: int, dense: bool) -> Network:
    """Distances between near points; each point observes as many."""
    rng = np.random.default_rng(1)
    points = grid(n_points)
    system = LeastSquares()
    ids = system.add_points([f"P{k}" for k in range(n_points)], points)
    first = np.arange(n) * n_points // n
    second = neighbours(first, n_points, rng)
    measured = np.linalg.norm(points[second] - points[first], axis=1) + rng.normal(0.0, SIGMA, n)
    system.add("Dist3D", {"p1": ids[first], "p2": ids[second]}, measured, SIGMA)
    starts = np.column_stack([3 * first, 3 * second])
    name = f"Dist3D {n_points} points, {n} observations"
    return Network(name, system.equations(), starts, np.zeros(n, np.int64), np.zeros((1, 9)), measured, dense)


def directions(n_points: int, n: int, dense: bool) -> Network:
    """Horizontal directions of near points; each point is a station, observed set after set."""
    rng = np.random.default_rng(2)
    points = grid(n_points)
    rotations = exponential(np.column_stack([np.zeros((n_points, 2)), rng.uniform(0.0, 6.0, n_points)]))
    system = LeastSquares()
    ids = system.add_points([f"P{k}" for k in range(n_points)], points)
    turns = system.add_rotations([f"S{k}" for k in range(n_points)], rotations)
    station = np.arange(n) * n_points // n
    target = neighbours(station, n_points, rng)
    local = np.einsum("nji,nj->ni", rotations[station], points[target] - points[station])
    measured = np.arctan2(local[:, 0], local[:, 1]) + rng.normal(0.0, 1e-5, n)
    blocks = {"station.centre": ids[station], "station.rotation": turns[station], "target": ids[target]}
    system.add("TopoHz", blocks, measured, SIGMA)
    starts = np.column_stack([3 * station, 3 * (n_points + station), 3 * target])
    columns = np.swapaxes(rotations, 1, 2).reshape(-1, 9)
    name = f"TopoHz {n_points} points, {n} observations"
    return Network(name, system.equations(), starts, station, columns, measured, dense)


def compiled(folder: Path) -> ctypes.CDLL | None:
    """The rival as a library, or None without a compiler."""
    compiler = shutil.which("g++")
    if compiler is None:
        return None
    library = folder / "rival.so"
    options = ["-O3", "-march=native", "-std=c++17", "-shared", "-fPIC"]
    subprocess.run([compiler, *options, str(SOURCE), "-o", str(library)], check=True)
    loaded = ctypes.CDLL(str(library))
    loaded.assemble.restype = ctypes.c_double
    return loaded


def rival_time(library: ctypes.CDLL, network: Network) -> tuple[float, float]:
    """Seconds and checksum of the rival."""
    pointer = ctypes.c_void_p
    values = network.equations.table.values
    seconds = ctypes.c_double()
    arrays = [
        np.ascontiguousarray(a)
        for a in (network.starts, network.stations, network.rotations, network.measured)
    ]
    checksum = library.assemble(
        int(network.starts.shape[1] == 3),
        int(network.dense),
        ctypes.c_int64(len(network.measured)),
        *(pointer(array.ctypes.data) for array in arrays),
        ctypes.c_double(SIGMA**-2),
        pointer(values.ctypes.data),
        len(values),
        ctypes.byref(seconds),
    )
    return seconds.value, checksum


def our_time(network: Network) -> tuple[float, float]:
    """Seconds and checksum of ours, from the unknowns to the values of the sparse matrix."""
    start = time.process_time()
    linearisation = network.equations.assemble()
    return time.process_time() - start, float(np.sum(np.square(linearisation.values)))


def compare(network: Network, library: ctypes.CDLL | None, rounds: int) -> dict[str, object]:
    """Medians of interleaved rounds, in nanoseconds per observation."""
    our_time(network)
    ours, rivals, ratios = [], [], []
    for _ in range(rounds):
        seconds, checksum = our_time(network)
        ours.append(seconds)
        if library is not None:
            other, expected = rival_time(library, network)
            if abs(checksum - expected) > 1e-8 * expected:
                sys.exit(f"{network.name}: the two normal matrices differ: {checksum} and {expected}")
            rivals.append(other)
            ratios.append(other / seconds)
    scale = 1e9 / len(network.measured)
    return {
        "name": network.name,
        "rival": "dense" if network.dense else "sparse",
        "ours_ns": scale * float(np.median(ours)),
        "rival_ns": scale * float(np.median(rivals)) if rivals else None,
        "ratio": float(np.median(ratios)) if ratios else None,
    }


def networks() -> list[Network]:
    """Those that are timed: few points or many, the rival's matrix dense or sparse."""
    return [
        distances(100, 20_000, True),
        distances(100, 20_000, False),
        distances(10_000, 60_000, False),
        directions(100, 20_000, True),
        directions(100, 20_000, False),
        directions(10_000, 60_000, False),
    ]


def asked() -> argparse.Namespace:
    """What the command line asks for."""
    parser = argparse.ArgumentParser(description="observations to normal equations, against MMVII's pattern")
    parser.add_argument("--json", type=Path, help="write the figures here")
    parser.add_argument("--rounds", type=int, default=11, help="interleaved rounds (default 11)")
    return parser.parse_args()


def main() -> None:
    """Runs the bench and prints its table."""
    arguments = asked()
    with tempfile.TemporaryDirectory() as folder:
        library = compiled(Path(folder))
        if library is None:
            print("no g++ here: the rival is not timed")
        rows = [compare(network, library, arguments.rounds) for network in networks()]
    print(f"{'network':44}{'rival matrix':>14}{'ours ns':>10}{'rival ns':>10}{'ratio':>8}")
    for row in rows:
        rival = f"{row['rival_ns']:10.0f}{row['ratio']:8.1f}" if row["ratio"] else f"{'-':>10}{'-':>8}"
        print(f"{row['name']:44}{row['rival']:>14}{row['ours_ns']:10.1f}{rival}")
    write_json(arguments.json, rows)


if __name__ == "__main__":
    main()
