"""A survey adjusted in Helmert blocks by processes or by Dask, checked against one machine, with times.

python tools/benchmarks/helmert_blocks.py [--points N] [--depth N] [--workers N] [--dask]
"""

from __future__ import annotations

import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any

import numpy as np
from bench_network import survey
from command import command_line

from obseq.leastsquares import solve_in_blocks

if TYPE_CHECKING:
    import argparse


def executor(options: argparse.Namespace) -> Any:
    """Processes of this machine, or a local cluster of Dask."""
    if not options.dask:
        return ProcessPoolExecutor(options.workers, mp_context=get_context("spawn"))
    from distributed import Client, LocalCluster  # type: ignore[import-not-found,unused-ignore]

    return Client(LocalCluster(n_workers=options.workers, threads_per_worker=1, dashboard_address=None))


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
    begin = time.perf_counter()
    with executor(options) as workers:
        found = solve_in_blocks(blocks, options.depth, workers)
    seconds = time.perf_counter() - begin
    print(f"{options.points} points, {blocks.n_unknowns} unknowns, {2**options.depth} leaves")
    print(f"    separators from the root down: {found.separators}")
    print(f"    {seconds:.2f} s for {len(found.costs) - 1} iterations, with start and standard deviations")
    begin = time.perf_counter()
    result = whole.solve(covariance=True)
    print(f"    one machine: {time.perf_counter() - begin:.2f} s for {len(result.iterations)} iterations")
    free = (expected := result.cofactors.variances()) > 0.0
    moved = np.abs(blocks.unknowns.values - whole.unknowns.values).max()
    print(f"    differences: unknowns {moved:.1e} m, ", end="")
    print(f"variances {np.abs(found.variances[free] / expected[free] - 1.0).max():.1e} of them")


if __name__ == "__main__":
    main()
