"""Random levelling loops and mixed networks through files: does each converge, and in how many iterations?

Seeded networks from 10 m to 100 km are written as OBS and COR files and adjusted. Levelling is of loops on
known plans; mixed networks have directions, zenith angles, distances and height differences, of sigmas from
0.1 to 10 times the usual ones. A network that does not converge, that leaves something out or announces a
gross error is listed with what it said.

Example:
    python tools/benchmarks/bench_random_networks.py --networks 2000
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import make_network as simulated
import numpy as np
from command import command_line, write_json

from obseq.errors import ObseqError
from obseq.survey import Network

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    Files = tuple[list[str], list[str]]

Random = np.random.Generator


def levelling(random: Random) -> Files:
    """Lines of the OBS and COR files of a levelled network: a loop through all points, and shortcuts."""
    n, size = int(random.integers(3, 15)), 10.0 ** random.uniform(1.0, 5.0)
    true = _points(n, size, random)
    heights = _heights(true)
    sigma = 10.0 ** random.uniform(-4.5, -2.0)
    lines = [(k, (k + 1) % n) for k in range(n)]
    lines += [tuple(random.choice(n, 2, replace=False).tolist()) for _ in range(int(random.integers(0, n)))]
    obs = [
        f"4 P{a} P{b} {heights[b] - heights[a] + random.normal(0.0, sigma):.6f} {sigma:.6g}" for a, b in lines
    ]
    cor = [f"5 P0 {_listed(true[0])} 0.0005"]
    cor += [f"4 P{k} {true[k, 0]:.4f} {true[k, 1]:.4f} {random.normal(0.0, 10.0):.3f}" for k in range(1, n)]
    return obs, cor


def mixed(random: Random) -> Files:
    """Lines of the OBS and COR files of a network with all usual observations, half of it approximate."""
    n, size = int(random.integers(5, 12)), 10.0 ** random.uniform(1.0, 5.0)
    true = _points(n, size, random)
    heights, better = _heights(true), 10.0 ** random.uniform(-1.0, 1.0)
    angle, length = simulated.SIGMA_ANGLE * better, simulated.SIGMA_DISTANCE * better
    obs: list[str] = []
    for station in range(0, n, 2):
        g0 = float(random.uniform(-np.pi, np.pi))
        targets = [k for k in random.permutation(n).tolist() if k != station][: int(random.integers(4, n))]
        obs += _round(true, station, targets, g0, (angle, length), random)
    obs += [
        f"4 P{a} P{b} {heights[b] - heights[a] + random.normal(0.0, length):.6f} {length:.6g}"
        for a, b in [tuple(random.choice(n, 2, replace=False).tolist()) for _ in range(3)]
    ]
    known = [f"1 P{k} {_listed(true[k])} 0.002" for k in range(3)]
    rough = true + random.normal(0.0, 0.01 * size, true.shape) * (1.0, 1.0, 0.1)
    return obs, known + [f"0 P{k} {_listed(rough[k])}" for k in range(3, n) if random.random() < 0.5]


def _round(
    true: FloatArray,
    station: int,
    targets: list[int],
    g0: float,
    sigmas: tuple[float, float],
    random: Random,
) -> list[str]:
    pairs = np.array([(station, target) for target in targets], np.int32)
    noise = random.normal(0.0, 1.0, (len(pairs), 3)) * (sigmas[0], sigmas[0], sigmas[1])
    exact = simulated.exact_values(true, pairs, np.full(len(pairs), g0))
    values = exact + noise
    gon = 200.0 / np.pi
    lines: list[str] = []
    for k, target in enumerate(targets):
        hz, zenith, distance = values[k]
        reading = (hz * gon) % 400.0
        lines += [
            f"{5 if k else 7} P{station} P{target} {reading:.7f} {sigmas[0] * gon:.6g}",
            f"6 P{station} P{target} {zenith * gon:.7f} {sigmas[0] * gon:.6g}",
            f"3 P{station} P{target} {distance:.6f} {sigmas[1]:.6g}",
        ]
    return lines


def _points(n: int, size: float, random: Random) -> FloatArray:
    """Points of the frame, on a terrain of at most 300 m, none too near to another."""
    while True:
        plan = random.uniform(-size / 2.0, size / 2.0, (n, 2))
        apart = np.linalg.norm(plan[:, None] - plan[None, :], axis=2) + np.eye(n) * size
        if apart.min() > size / 20.0:
            return np.column_stack([plan, random.uniform(0.0, min(size / 10.0, 300.0), n)])


def _heights(true: FloatArray) -> FloatArray:
    """Ellipsoidal heights of points of the frame."""
    return np.asarray(simulated.in_system(true, simulated.PLANE)[:, 2])


def _listed(xyz: FloatArray) -> str:
    return " ".join(f"{value:.4f}" for value in xyz.tolist())


KINDS: dict[str, Callable[[Random], Files]] = {"levelling": levelling, "mixed": mixed}


@dataclass
class Outcome:
    """What became of the networks of one kind.

    Attributes:
        iterations: how often each number of iterations was needed.
        said: by seed, what the others said.
    """

    iterations: Counter[int] = field(default_factory=Counter)
    said: dict[int, str] = field(default_factory=dict)


def outcome(kind: str, seeds: range) -> Outcome:
    """Adjusts the networks of some seeds."""
    result = Outcome()
    with tempfile.TemporaryDirectory() as folder:
        for seed in seeds:
            said = _adjusted(Path(folder), KINDS[kind](np.random.default_rng([seed, len(kind)])))
            if isinstance(said, int):
                result.iterations[said] += 1
            else:
                result.said[seed] = said
    return result


def _adjusted(folder: Path, files: Files) -> int | str:
    """The number of iterations, or what went wrong."""
    paths = folder / "random.obs", folder / "random.cor"
    for path, lines in zip(paths, files, strict=True):
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    try:
        adjustment = Network.read(*paths, frame=simulated.FRAME).adjust()
    except ObseqError as error:
        return f"refused: {error}"
    if adjustment.gross_errors or adjustment.left_out:
        return f"announced: {adjustment.warnings[0]}"
    if not adjustment.converged:
        return f"not converged: {adjustment.solution.stop_reason.value}"
    return len(adjustment.solution.iterations)


def main() -> int:
    """Runs the bench and prints what became of the networks."""
    parser = command_line(__doc__)
    parser.add_argument("--networks", type=int, default=2000, help="networks of each kind")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures as JSON")
    arguments = parser.parse_args()
    table = {}
    for kind in KINDS:
        result = outcome(kind, range(arguments.networks))
        counts = ", ".join(f"{k}: {count}" for k, count in sorted(result.iterations.items()))
        converged = sum(result.iterations.values())
        print(f"{kind}: {converged} of {arguments.networks} converged; iterations {counts}", flush=True)
        for seed, said in list(result.said.items())[:20]:
            print(f"  {seed}: {said[:300]}")
        table[kind] = {"iterations": dict(result.iterations), "said": result.said}
    write_json(arguments.json, table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
