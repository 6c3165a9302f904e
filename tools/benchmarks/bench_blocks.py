"""Blocks of images: what the objects of `obseq.images` cost beside the engine used by hand, and their memory.

    python tools/benchmarks/bench_blocks.py [BAL FILE ...] [--images 200 --points 100000 --rays 5]

Both ways start from the same arrays and names and end with adjusted poses, cameras and points: the objects
(cameras, poses, measures, `solve`), and the same system written by hand. They are run in turn, each first in
every other round; seconds are of the processor, on one thread, and the ratio is the median over rounds.
Without a file: a synthetic block of images on an arc about a cloud of points.
"""

from __future__ import annotations

import statistics
import time
import tracemalloc
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from bal import Problem, read_problem, synthetic_problem
from command import command_line, write_json

from obseq.geometry import exponential
from obseq.images import BundleAdjustment, Camera, ImagePoints, Poses
from obseq.leastsquares import LeastSquares

if TYPE_CHECKING:
    import argparse

FLIP = np.array([1.0, -1.0, -1.0])
"""From axes that look along -z, y up, to those of `obseq.images`."""
SOLVING = {"max_iterations": 50, "tolerance": 1e-6}


@dataclass(frozen=True)
class Given:
    """What both ways are given."""

    images: list[str]
    points: list[str]
    rotations: np.ndarray
    centres: np.ndarray
    interiors: np.ndarray
    coordinates: np.ndarray
    image: np.ndarray
    point: np.ndarray
    pixels: np.ndarray


def given(problem: Problem) -> Given:
    """A problem of the collection in the axes of `obseq.images`, measures by image."""
    turned = exponential(problem.cameras[:, :3]) * FLIP[:, None]
    rotations = np.ascontiguousarray(np.swapaxes(turned, 1, 2))
    centres = -(rotations @ (problem.cameras[:, 3:6] * FLIP)[:, :, None])[:, :, 0]
    order = np.lexsort((problem.point_of, problem.camera_of))
    return Given(
        [f"image {k}" for k in range(len(centres))],
        [f"P{k}" for k in range(len(problem.points))],
        rotations,
        centres,
        problem.cameras[:, 6:],
        problem.points,
        problem.camera_of[order],
        problem.point_of[order],
        (problem.images * FLIP[:2])[order],
    )


def by_objects(data: Given) -> dict[str, Any]:
    """Adjusts with the objects of `obseq.images`."""
    block = BundleAdjustment()
    names = [f"camera of {image}" for image in data.images]
    block.add_cameras(
        *(
            Camera(name, 0, 0, float(row[0]), np.zeros(2), (2, 0, 0), row[1:])
            for name, row in zip(names, data.interiors, strict=True)
        )
    )
    block.freeze_parameters("PP.")
    block.add_poses(Poses.of(data.images, data.centres, data.rotations, cameras=names))
    block.add_approximations(data.points, data.coordinates)
    block.add_measures(ImagePoints.packed(data.images, data.points, data.image, data.point, data.pixels))
    solution = block.solve(datum="none", covariance=False, **SOLVING)
    return {
        "cost": solution.result.cost,
        "iterations": len(solution.iterations),
        "state": (solution.poses.centres, solution.coordinates),
    }


def by_hand(data: Given) -> dict[str, Any]:
    """Adjusts with the engine alone."""
    system = LeastSquares()
    centres = system.add_points([f"{image} centre" for image in data.images], data.centres)
    rotations = system.add_rotations(data.images, data.rotations)
    focal, radial = data.interiors[:, :1], data.interiors[:, 1:]
    values = np.hstack([focal, np.zeros((len(focal), 2)), radial])
    calibrations = system.add_vectors(data.images, values, ["F", "PPx", "PPy", "K1", "K2"])
    points = system.add_points(data.points, data.coordinates)
    system.freeze(calibrations, ["PPx", "PPy"])
    blocks = {
        "point": points[data.point],
        "camera.centre": centres[data.image],
        "camera.rotation": rotations[data.image],
        "calibration": calibrations[data.image],
    }
    system.add("EqColinearityCamPPC_Stenope_Dist_Rad2_Dec0_XY0", blocks, data.pixels, 1.0)
    system.eliminate(points)
    result = system.solve(strategy="levenberg-marquardt", **SOLVING)
    return {
        "cost": result.cost,
        "iterations": len(result.iterations),
        "state": (result.values(centres), result.values(points)),
    }


def timed(work: Any, data: Given) -> tuple[float, dict[str, Any]]:
    """Seconds of CPU, and what came out."""
    start = time.process_time()
    found = work(data)
    return time.process_time() - start, found


def compare(data: Given, rounds: int) -> dict[str, Any]:
    """Medians over rounds, one way after the other."""
    ways = {"objects": by_objects, "by hand": by_hand}
    for work in ways.values():
        work(data)
    runs: dict[str, list[float]] = {name: [] for name in ways}
    found: dict[str, dict[str, Any]] = {}
    for number in range(rounds):
        for name, work in sorted(ways.items(), reverse=number % 2 == 1):
            seconds, found[name] = timed(work, data)
            runs[name].append(seconds)
    ratios = [a / b for a, b in zip(runs["objects"], runs["by hand"], strict=True)]
    gaps = [
        np.abs(a - b).max() for a, b in zip(found["objects"]["state"], found["by hand"]["state"], strict=True)
    ]
    return {
        "objects_seconds": statistics.median(runs["objects"]),
        "by_hand_seconds": statistics.median(runs["by hand"]),
        "ratio": statistics.median(ratios),
        "iterations": found["objects"]["iterations"],
        "half_cost": 0.5 * found["objects"]["cost"],
        "half_cost_by_hand": 0.5 * found["by hand"]["cost"],
        "largest_difference": float(max(gaps)),
    }


def memory(data: Given) -> dict[str, float]:
    """Largest memory of one adjustment with objects, bytes per measure."""
    tracemalloc.start()
    by_objects(data)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return {"peak_megabytes": peak / 1e6, "bytes_per_measure": peak / len(data.image)}


def arguments() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--images", type=int, default=200)
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--rays", type=int, default=5)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--json", type=Path, help="file to write")
    return parser.parse_args()


def main() -> None:
    """Runs the blocks asked for."""
    options = arguments()
    problems = {file.name: read_problem(file) for file in options.files}
    if not problems:
        made = synthetic_problem(options.images, options.points, options.rays * options.points)
        problems = {f"synthetic {options.images} x {options.points}": made}
    results = {}
    for name, problem in problems.items():
        data = given(problem)
        results[name] = compare(data, options.rounds) | memory(data)
        print(f"{name}: {len(data.image)} measures")
        for key, value in results[name].items():
            print(f"    {key:20} {value:.9g}")
    write_json(options.json, results)


if __name__ == "__main__":
    main()
