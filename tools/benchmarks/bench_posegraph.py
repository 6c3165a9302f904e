"""Pose graphs, chordal start and solution: CPU seconds, ours beside GTSAM's, in turn.

Ours solves for the start (rotations, then translations) and from there, both by linear and Gauss-Newton steps
of the engine. GTSAM does the same with `lago` in the plane, `InitializePose3` in space, and
`GaussNewtonOptimizer`. Both begin with the graph in memory, and end at the same sum of squares.

    python tools/benchmarks/bench_posegraph.py [--rounds N] [--json FILE]
"""

import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import Any

from command import command_line, write_json

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "tests" / "leastsquares"))
from posegraph import adjusted, chordal_start, read_graph  # noqa: E402

FOLDER = ROOT.parent / "shared" / "data" / "posegraph-dev"
GRAPHS = ("M3500.g2o", "parking-garage.g2o")  # of INTEL.g2o GTSAM says that it is indeterminate


def ours(file: Path) -> Callable[[], float]:
    """A run of ours: its sum of squares."""
    graph = read_graph(file)
    return lambda: float(adjusted(graph, *chordal_start(graph), max_iterations=50).cost)


def theirs(file: Path) -> Callable[[], float]:
    """A run of GTSAM: its sum of squares."""
    import gtsam

    is_plane = "SE2" in file.read_text("utf-8")
    graph, values = gtsam.readG2o(str(file), not is_plane)
    size, pose, prior = (3, "atPose2", "Pose2") if is_plane else (6, "atPose3", "Pose3")
    unit, held = (gtsam.noiseModel.Isotropic.Sigma(size, sigma) for sigma in (1.0, 1e-3))
    plain = gtsam.NonlinearFactorGraph()  # `lago` takes diagonal weights only
    for edge in map(graph.at, range(graph.size())):
        between = getattr(gtsam, f"BetweenFactor{prior}")
        plain.add(between(*edge.keys(), edge.measured(), unit))
    key = min(values.keys())
    first = getattr(gtsam, f"PriorFactor{prior}")(key, getattr(values, pose)(key), held)
    graph.add(first)
    plain.add(first)
    initialize = gtsam.lago.initialize if is_plane else gtsam.InitializePose3.initialize

    def run() -> float:
        end = gtsam.GaussNewtonOptimizer(graph, initialize(plain)).optimize()
        return float(2.0 * graph.error(end))

    return run


def compare(file: Path, rounds: int) -> dict[str, Any]:
    """Medians of interleaved rounds; ours alone without GTSAM."""
    engines = {"ours": ours(file)} | ({"gtsam": theirs(file)} if find_spec("gtsam") else {})
    costs = {name: run() for name, run in engines.items()}
    seconds: dict[str, list[float]] = {name: [] for name in engines}
    for _ in range(rounds):
        for name, run in engines.items():
            begin = time.process_time()
            run()
            seconds[name].append(time.process_time() - begin)
    figures: dict[str, Any] = {"costs": costs, "seconds": {k: median(v) for k, v in seconds.items()}}
    if "gtsam" in seconds:
        figures["ratio"] = median(b / a for a, b in zip(seconds["ours"], seconds["gtsam"], strict=True))
    return figures


def main() -> None:
    """Reads the command line, benches, prints."""
    parser = command_line(__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures as JSON")
    options = parser.parse_args()
    results = {name: compare(FOLDER / name, options.rounds) for name in GRAPHS}
    for name, figures in results.items():
        print(name, figures)
    write_json(options.json, results)


if __name__ == "__main__":
    main()
