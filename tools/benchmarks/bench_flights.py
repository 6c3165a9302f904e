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
    parser.add_argument("--rpc", type=Path, help="rational polynomials of a real image")
    arguments = parser.parse_args()
    drones(arguments.images, arguments.runs)
    base = read_rpc(arguments.rpc) if arguments.rpc else None
    for correction in ("bias", "affine"):
        satellite(base, correction, 30)


def drones(images: int, runs: int) -> None:
    """Flights of so many images."""
    shares, levers, readouts, sigma0, start = [], [], [], [], time.process_time()
    for seed in range(runs):
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
    cpu = (time.process_time() - start) / runs
    print(f"{images} images, {runs} runs: sigma0 {np.mean(sigma0):.4f}, {cpu:.1f} s of processor each")
    for name, values in (("check points", shares), ("lever arms", levers), ("readouts", readouts)):
        print(f"  {name}: {np.mean(np.abs(values) <= SIGMAS):.3f} within {SIGMAS} sigmas")


def satellite(base: object, correction: str, runs: int) -> None:
    """Blocks of three satellite images."""
    checks, corrections = [], []
    for seed in range(runs):
        made = satellites.scene(base, correction, seed=seed)
        solution = made.block.solve()
        _, differences, covariances = solution.check()
        checks.append(np.abs(differences) / np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)))
        for image, (values, sigmas) in solution.corrections().items():
            corrections.append(np.abs(values - made.corrections[image]) / sigmas)
    shares = [np.mean(np.concatenate(part) <= SIGMAS) for part in (checks, corrections)]
    print(
        f"satellite, {correction}: check points {shares[0]:.3f}, corrections {shares[1]:.3f} within {SIGMAS}"
    )


if __name__ == "__main__":
    main()
