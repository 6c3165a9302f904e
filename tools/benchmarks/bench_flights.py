"""Coverage of drone and satellite blocks: how often what is true lies within its precision.

    python tools/benchmarks/bench_flights.py [--images 500] [--runs 10] [--rpc FILE]

A flight has images with RTK centres, three ground control points, a lever arm and a rolling shutter that are
unknown, and a camera that is calibrated by the block. The satellite blocks have three views each.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[2] / "tests" / "images"))
import flights
import satellites

from obseq.formats.rpc.files import read_rpc

SIGMAS = 1.96
LENGTH = 25
"""Images of a strip."""


def main() -> None:
    """Print the shares."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--images", type=int, default=500)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--scenes", type=int, default=300, help="satellite blocks (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the first run (%(default)s)")
    parser.add_argument("--rpc", type=Path, help="rational polynomials of a real image")
    arguments = parser.parse_args()
    first = arguments.seed
    if arguments.runs:
        drones(arguments.images, range(first, first + arguments.runs))
    base = read_rpc(arguments.rpc) if arguments.rpc else None
    for correction in ("bias", "affine"):
        satellite(base, correction, range(first, first + arguments.scenes))


def drones(images: int, seeds: range) -> None:
    """Flights of so many images."""
    shares, levers, readouts, sigma0, start = [], [], [], [], time.process_time()
    for seed in seeds:
        made = flights.flight(max(images // LENGTH, 2), LENGTH, 4 * images, n_check=100, seed=seed)
        solution = made.block.solve()
        found = solution.check_residuals()
        shares.append(np.abs(found.differences) / found.sigmas)
        lever, precision = solution.lever_arm()
        levers.append((lever - flights.LEVER) / precision)
        readout, own = solution.readout("c")
        readouts.append((readout - flights.READOUT) / own)
        sigma0.append(solution.sigma0)
        print(
            f"seed {seed}: sigma0 {solution.sigma0:.4f}, {len(solution.iterations)} iterations, check "
            f"{np.mean(shares[-1] <= SIGMAS):.3f}, lever arm {lever.round(3)} +- {precision.round(3)}, "
            f"readout {1000 * readout:.2f} +- {1000 * own:.2f} ms",
            flush=True,
        )
    cpu = (time.process_time() - start) / len(seeds)
    print(f"{images} images, {len(seeds)} runs: sigma0 {np.mean(sigma0):.4f}, {cpu:.1f} s of processor each")
    for name, values in (("check points", shares), ("lever arms", levers), ("readouts", readouts)):
        print(f"  {name}: {share(values)} within {SIGMAS} sigmas")


def satellite(base: object, correction: str, seeds: range) -> None:
    """Blocks of three satellite images."""
    checks, corrections = [], []
    for seed in seeds:
        made = satellites.scene(base, correction, seed=seed)
        solution = made.block.solve()
        _, differences, covariances = solution.check()
        checks.append(np.abs(differences) / np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)))
        found = solution.corrections().items()
        corrections.append([np.abs(values - made.corrections[k]) / sigmas for k, (values, sigmas) in found])
    print(
        f"satellite, {correction}, {len(seeds)} runs: check points {share(checks)}, corrections "
        f"{share(corrections)} within {SIGMAS}"
    )


def share(runs: list) -> str:
    """The share within so many sigmas, with its standard error.

    What one run finds hangs together: its control is in all of it. So runs are what is independent.
    """
    shares = [np.mean(np.abs(values) <= SIGMAS) for values in runs]
    return f"{np.mean(shares):.3f} +- {np.std(shares, ddof=1) / np.sqrt(len(shares)):.3f}"


if __name__ == "__main__":
    main()
