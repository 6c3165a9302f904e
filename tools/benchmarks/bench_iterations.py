"""Random problems: whether every one of them arrives, or says why not, and after how many iterations.

Each strategy is compared with what Gauss-Newton needs by nature: the first of 40 iterations whose step is
below the tolerance, or as short as the last ten where these shrink no more and are made of rounding. Of
those that arrive at a lower minimum than Gauss-Newton's, the iterations are not compared with its.

    python tools/benchmarks/bench_iterations.py [--problems 2000] [--json FILE] [KIND...]
"""

import argparse
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from command import command_line, write_json

import obseq
from obseq.codegen import compile_formula
from obseq.formulas.base import Formula
from obseq.formulas.blocks import Angle, Length, Number, Point2, Point3, Pose
from obseq.formulas.functions import Scalar, angle_difference, atan2, sin, sqrt

STRATEGIES = ("gauss-newton", "controlled", "levenberg-marquardt", "dogleg")
NATURAL = 40
LATE = 10
SPARE = 2
"""Iterations more than by nature that nobody minds."""

SAME = 1e-6
"""Share by which sums of squares of one minimum may differ."""


class Wave(Formula):
    """A sine of unknown frequency."""

    def residual(self, a: Number, *, y: Number, x: Number) -> Scalar:
        """Computed minus observed."""
        return sin(a * x) - y


class Reading(Formula):
    """A direction in the plane of a set whose zero is unknown."""

    def residual(self, station: Point2, target: Point2, zero: Angle, *, reading: Angle) -> Scalar:
        """Computed minus observed."""
        bearing = atan2(target.x - station.x, target.y - station.y)
        return angle_difference(bearing - zero, reading)


class Distance(Formula):
    """A distance in the plane."""

    def residual(self, a: Point2, b: Point2, *, distance: Length) -> Scalar:
        """Computed minus observed."""
        return sqrt((b.x - a.x) ** 2 + (b.y - a.y) ** 2) - distance


class Image(Formula):
    """Where a camera that looks along z sees a point."""

    def residual(
        self, camera: Annotated[Pose, "C", "W", "m"], point: Point3, *, i: Number, j: Number
    ) -> tuple[Scalar, Scalar]:
        """Computed minus observed."""
        seen = camera.inverse() @ point
        return seen.x / seen.z - i, seen.y / seen.z - j


@cache
def kernel(formula: type[Formula]) -> Any:
    """The formula, compiled in memory."""
    return compile_formula(formula())


def one_unknown(rng: np.random.Generator) -> obseq.LeastSquares:
    """Few observations of a sine, far from any: large residuals."""
    n = int(rng.integers(3, 9))
    x = np.arange(1.0, n + 1.0)
    system = obseq.LeastSquares()
    (a,) = system.add_scalars(["a"], [rng.uniform(0.1, 2.0)])
    system.add(kernel(Wave), {"a": np.repeat(a, n)}, np.column_stack([rng.normal(0, 2, n), x]), 1.0)
    return system


def trilateration(rng: np.random.Generator) -> obseq.LeastSquares:
    """Five distances in the plane, with gross errors, at any scale."""
    scale = 10.0 ** rng.uniform(-6, 7)
    known = rng.uniform(0, 100, (5, 3)) * [1, 1, 0]
    place = rng.uniform(20, 80, 3) * [1, 1, 0]
    system = obseq.LeastSquares()
    base = system.add_points(list("ABCDE"), scale * known)
    (p,) = system.add_points(["P"], [scale * (place + rng.normal(0, 20, 3) * [1, 1, 0])])
    system.freeze(base)
    system.freeze([p], ["z"])
    lengths = np.linalg.norm(known - place, axis=1) + rng.normal(0, 15, 5)
    system.add("Dist3D", {"p1": base, "p2": [p]}, scale * np.abs(lengths), 10.0 ** rng.uniform(-9, 3))
    return system


def levelling(rng: np.random.Generator) -> obseq.LeastSquares:
    """Loops of height differences from one known height, which may be a national one."""
    n = int(rng.integers(4, 30))
    heights = rng.uniform(0, 10.0 ** rng.uniform(0, 4), n) + rng.choice([0.0, 6.8e6])
    sigma = 10.0 ** rng.uniform(-5, -2)
    start = np.concatenate([np.arange(n), rng.integers(0, n, n)])
    end = np.concatenate([(np.arange(n) + 1) % n, rng.integers(0, n, n)])
    start, end = start[start != end], end[start != end]
    system = obseq.LeastSquares()
    ids = system.add_scalars([f"H{k}" for k in range(n)], np.where(np.arange(n) > 0, 0.0, heights))
    system.freeze(ids[:1])
    one = np.ones((len(start), 1))
    measured = heights[end] - heights[start] + rng.normal(0, sigma, len(start))
    system.add_linear([ids[end], ids[start]], [one, -one], measured, sigma)
    return system


def network(rng: np.random.Generator) -> obseq.LeastSquares:
    """Directions and distances in the plane, 10 m to 100 km wide, in national coordinates or not."""
    n, width = int(rng.integers(4, 13)), 10.0 ** rng.uniform(1, 5)
    north = rng.choice([0.0, 6.8e6])
    true = rng.uniform(0, width, (n, 2)) + np.array([north / 8, north])
    i, j = np.nonzero(~np.eye(n, dtype=bool))
    d = true[j] - true[i]
    zero = rng.uniform(-3, 3, n) * rng.choice([1.0, 1e-3])
    sigma_r, sigma_d = 10.0 ** rng.uniform(-6, -4), 10.0 ** rng.uniform(-4, -2)
    readings = np.arctan2(d[:, 0], d[:, 1]) - zero[i] + rng.normal(0, sigma_r, len(i))
    lengths = np.hypot(*d.T) + rng.normal(0, sigma_d, len(i))
    system = obseq.LeastSquares()
    start = true + rng.normal(0, 1e-3 * width, (n, 2))
    start[:2] = true[:2]
    p = system.add_points([f"P{k}" for k in range(n)], start)
    z = system.add_scalars([f"zero {k}" for k in range(n)], zero + rng.normal(0, 0.01, n))
    system.freeze(p[:2])
    system.add(kernel(Reading), {"station": p[i], "target": p[j], "zero": z[i]}, readings, sigma_r)
    system.add(kernel(Distance), {"a": p[i], "b": p[j]}, lengths, sigma_d)
    return system


def bundle(rng: np.random.Generator) -> obseq.LeastSquares:
    """Three to six cameras over ten to thirty points; two cameras are known."""
    cameras, points = int(rng.integers(3, 7)), int(rng.integers(10, 31))
    scale, far = 10.0 ** rng.uniform(-3, 5), rng.choice([0.0, 1e6])
    world = rng.uniform(-1, 1, (points, 3)) * [1, 1, 0.3] + [0, 0, 4]
    centres = rng.uniform(-1, 1, (cameras, 3)) * [1, 1, 0.2]
    seen = (world[None] - centres[:, None]) + rng.normal(0, 1e-9, (cameras, points, 3))
    image = seen[..., :2] / seen[..., 2:] + rng.normal(0, 1e-4, (cameras, points, 2))
    system = obseq.LeastSquares()
    c = system.add_points([f"C{k}" for k in range(cameras)], scale * (centres + far))
    turned = np.tile(np.eye(3), (cameras, 1, 1))
    r = system.add_rotations([f"C{k}" for k in range(cameras)], turned)
    p = system.add_points(
        [f"P{k}" for k in range(points)], scale * (world + rng.normal(0, 0.05, world.shape) + far)
    )
    system.freeze(c[:2])
    system.freeze(r[:2])
    system.set_values(c[2:], scale * (centres[2:] + rng.normal(0, 0.03, (cameras - 2, 3)) + far))
    i, j = np.divmod(np.arange(cameras * points), points)
    blocks = {"camera.centre": c[i], "camera.rotation": r[i], "point": p[j]}
    system.add(kernel(Image), blocks, image[i, j], 1e-4)
    return system


KINDS: dict[str, Callable[[np.random.Generator], obseq.LeastSquares]] = {
    "one unknown": one_unknown,
    "trilateration": trilateration,
    "levelling": levelling,
    "network": network,
    "bundle": bundle,
}


def natural_count(make: Callable[[], obseq.LeastSquares]) -> tuple[int | None, float]:
    """Iterations that Gauss-Newton needs by nature, None where it does not arrive; its sum of squares."""
    try:
        result = make().solve(max_iterations=NATURAL, tolerance=-1.0)
    except obseq.ObseqError:
        return None, np.inf
    lengths = np.array([step.length for step in result.iterations])
    unit = 1.0 if result.sigma0 is None else result.sigma0
    late, last = lengths[-2 * LATE : -LATE], lengths[-LATE:]
    is_noise = np.median(last) > 0.5 * np.median(late) and last.max() <= max(1e-3 * unit, 1e-9 * lengths[0])
    short = np.flatnonzero(lengths <= max(1e-6 * unit, 3.0 * last.max() if is_noise else 0.0))
    return (int(short[0]) + 1 if short.size else None), result.cost


def outcome(make: Callable[[], obseq.LeastSquares], strategy: str) -> tuple[str, int, float]:
    """How a solution ended, after how many iterations, and its sum of squares."""
    try:
        result = make().solve(max_iterations=200, strategy=strategy)
    except obseq.ObseqError as error:
        return type(error).__name__, 0, np.inf
    end = "arrived" if result.converged else result.stop_reason.name.lower()
    return end, len(result.iterations), result.cost


def bench(kind: str, problems: int) -> list[dict[str, Any]]:
    """One row per strategy: how the problems of a kind ended, how many iterations beyond the natural ones."""
    counts = {strategy: Counter[str]() for strategy in STRATEGIES}
    beyond: dict[str, list[int]] = {strategy: [] for strategy in STRATEGIES}
    iterations: dict[str, list[int]] = {strategy: [] for strategy in STRATEGIES}
    for seed in range(problems):

        def make(seed: int = seed) -> obseq.LeastSquares:
            return KINDS[kind](np.random.default_rng(seed))

        natural, cost = natural_count(make)
        for strategy in STRATEGIES:
            end, number, found = outcome(make, strategy)
            counts[strategy][end] += 1
            if end == "arrived":
                iterations[strategy].append(number)
                if natural is not None and found >= (1.0 - SAME) * cost:
                    beyond[strategy].append(number - natural)
    return [
        {
            "kind": kind,
            "strategy": strategy,
            "ends": dict(counts[strategy]),
            "median": float(np.median(iterations[strategy])),
            "most": max(iterations[strategy]),
            "compared": len(beyond[strategy]),
            "beyond": sum(extra > SPARE for extra in beyond[strategy]),
            "worst": max(beyond[strategy], default=0),
        }
        for strategy in STRATEGIES
    ]


def asked() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument(
        "kinds", nargs="*", default=list(KINDS), help=f"of {', '.join(KINDS)}; all by default"
    )
    parser.add_argument("--problems", type=int, default=2000)
    parser.add_argument("--json", type=Path)
    return parser.parse_args()


def main() -> None:
    """Prints one line per kind and strategy."""
    arguments = asked()
    rows: list[dict[str, Any]] = []
    print(
        "kind, strategy: iterations median and most; beyond the natural number by more than 2 (worst); ends"
    )
    for kind in arguments.kinds:
        for row in bench(kind, arguments.problems):
            rows.append(row)
            print(
                f"{row['kind']:14s} {row['strategy']:20s} {row['median']:5.1f} {row['most']:4d}; "
                f"{row['beyond']} of {row['compared']} ({row['worst']:+d}); {row['ends']}",
                flush=True,
            )
    write_json(arguments.json, rows)


if __name__ == "__main__":
    main()
