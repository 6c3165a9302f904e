"""A survey adjusted in Helmert blocks by processes or by Dask, checked against one machine, with times.

python tools/benchmarks/helmert_blocks.py [--points N] [--depth N] [--workers N] [--dask]
"""

from __future__ import annotations

import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from bench_network import survey
from command import command_line

from obseq.leastsquares import solve_in_blocks

if TYPE_CHECKING:
    import argparse


class Pools:
    """Processes of this machine, each with its own leaves."""

    def __init__(self, workers: int) -> None:
        context = get_context("spawn")
        self.pools = [ProcessPoolExecutor(1, mp_context=context) for _ in range(workers)]

    def submit(self, function: Any, file: str, *arguments: Any) -> Any:
        """Sends work on a leaf to where that leaf is kept."""
        return self.pools[int(Path(file).stem) % len(self.pools)].submit(function, file, *arguments)

    def close(self) -> None:
        """Ends the processes."""
        for pool in self.pools:
            pool.shutdown()


class DaskWorkers:
    """Workers of a Dask cluster, here a local one. If one is lost, another takes its leaves over."""

    def __init__(self, workers: int) -> None:
        from distributed import Client, LocalCluster  # type: ignore[import-not-found,unused-ignore]

        self.client = Client(LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None))

    def submit(self, function: Any, file: str, *arguments: Any) -> Any:
        """Sends work on a leaf to where that leaf is kept."""
        present = sorted(self.client.scheduler_info(n_workers=-1)["workers"])
        worker = present[int(Path(file).stem) % len(present)]
        return self.client.submit(function, file, *arguments, workers=[worker], pure=False)

    def close(self) -> None:
        """Ends the cluster."""
        self.client.close()
        self.client.cluster.close()


def arguments() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("--points", type=int, default=10_000)
    parser.add_argument("--depth", type=int, default=3, help="2 to this power leaves")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--dask", action="store_true")
    return parser.parse_args()


def main() -> None:
    """Adjusts a survey in blocks, and at once; prints times and differences."""
    options = arguments()
    whole, blocks = survey(options.points, 1), survey(options.points, 1)
    executor: Any = DaskWorkers(options.workers) if options.dask else Pools(options.workers)
    begin = time.perf_counter()
    found = solve_in_blocks(blocks, options.depth, executor)
    seconds = time.perf_counter() - begin
    executor.close()
    print(f"{options.points} points, {blocks.n_unknowns} unknowns, {2**options.depth} leaves")
    print(f"    separators from the root down: {found.separators}")
    print(f"    {seconds:.2f} s for {len(found.costs) - 1} iterations, with start and standard deviations")
    begin = time.perf_counter()
    result = whole.solve(covariance=True)
    seconds = time.perf_counter() - begin
    print(f"    one machine: {seconds:.2f} s for {len(result.iterations)} iterations")
    expected = result.cofactors.variances()
    free = expected > 0.0
    moved = np.abs(blocks.unknowns.values - whole.unknowns.values).max()
    print(f"    differences: unknowns {moved:.1e} m, ", end="")
    print(f"variances {np.abs(found.variances[free] / expected[free] - 1.0).max():.1e} of them")


if __name__ == "__main__":
    main()
