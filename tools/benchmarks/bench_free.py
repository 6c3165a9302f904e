"""Ordinary networks on the inner datum, of which one coordinate, height or length at height 0 is known.

Each seed is one network of 20 m to 500 m with noise (tests/free_networks.py). Right is: it converges in four
iterations, no observation is dropped or accused, and the redundancy counts three free motions where a
coordinate is held, four where a distance at height 0 shows the height by the curvature of the Earth alone.

Example:
    python tools/benchmarks/bench_free.py --networks 240 --json done.json
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

from command import command_line, write_json
from free_networks import KNOWN, fault, free_case

from obseq import ObseqError


def said_of(seed: int) -> str:
    """What is wrong with the network of a seed; nothing where it is right."""
    try:
        return fault(free_case(seed))
    except ObseqError as error:
        return f"refused: {error}"


def main() -> int:
    """Runs the bench; 1 where some network is not right."""
    parser = command_line(__doc__)
    parser.add_argument("--networks", type=int, default=240, help="how many seeds (default 240)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="what is wrong, by seed")
    arguments = parser.parse_args()
    wrong: dict[int, str] = {}
    for seed in range(arguments.networks):
        if said := said_of(seed):
            wrong[seed] = said
            print(f"{seed:5d} {KNOWN[seed % len(KNOWN)]}: {said}", flush=True)
    print(f"{arguments.networks - len(wrong)} of {arguments.networks} networks are right")
    for known, count in Counter(KNOWN[seed % len(KNOWN)] for seed in wrong).items():
        print(f"{count} wrong with {known} known")
    write_json(arguments.json, wrong)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
