"""Seconds to read and to write networks of three sizes in each format: twice the size takes twice the time.

python tools/benchmarks/bench_formats.py --size 50000
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from command import command_line
from field_books import FORMATS as BOOKS
from format_files import CRS, FORMATS

from obseq.errors import InputError
from obseq.formats.conversion import NETWORK_WRITERS
from obseq.survey import Network

STEPS = (4, 2, 1)
"""The smaller networks are smaller by these factors."""
LIMIT = 2.0
"""How much more than proportional the time of the largest one may be: files that fit in no cache."""
SIGMAS = ["distance=3mm", "direction=5sec", "zenith=5sec"]


def seconds(work: Callable[[], object]) -> float:
    """The least of two times."""
    times = []
    for _ in range(2):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


def read(paths: list[Path]) -> Network:
    """A network, from its files."""
    if paths[0].suffix == ".obs":
        return Network.read(paths[0], paths[1], points_crs=CRS)
    if paths[0].name in BOOKS:
        return Network.read_project(paths[:1], sigmas=SIGMAS, point_files=paths[1:])
    asked = paths[0].suffix == ".dat" or b"<LandXML" in paths[0].read_bytes()[:100]
    sigmas = SIGMAS if asked else []
    network = Network.read_project(paths, sigmas=sigmas)
    return replace(
        network, frame=replace(network.frame, refraction_coefficient=float(network.frame.is_plane))
    )


def files_of(folder: Path, name: str, size: int) -> list[Path]:
    """The files of a network in a format."""
    place = folder / f"{name.replace('*', '')}-{size}"
    place.mkdir()
    return FORMATS[name](place, size)


def arguments() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("--size", type=int, default=50_000, help="observations (%(default)s)")
    parser.add_argument("--only", nargs="+", choices=FORMATS, help="these formats (all)")
    return parser.parse_args()


def main() -> int:
    """Print the times; 1 when one grows faster than the network."""
    options = arguments()
    sizes, worst = [options.size // step for step in STEPS], 0.0
    with tempfile.TemporaryDirectory() as folder:
        for name in options.only or FORMATS:
            paths = [files_of(Path(folder), name, size) for size in sizes]
            times = [seconds(lambda given=given: read(given)) for given in paths]
            networks = [read(given) for given in paths]
            worst = max(worst, told(f"read {name}", len(networks[-1].book.observations), times))
            lines = sum(path.read_bytes().count(b"\n") for path in paths[-1])
            print(f"{'':22} {times[-1] / lines * 1e6:7.1f} microseconds a line of {lines}", flush=True)
            for suffix, write in NETWORK_WRITERS.items():
                if not holds(write, networks[0]):
                    continue
                times = [seconds(lambda write=write, given=given: write(given)) for given in networks]
                worst = max(worst, told(f"  {name} to {suffix}", len(networks[-1].book.observations), times))
    return 1 if worst > LIMIT else 0


def holds(write: Callable[[Network], object], network: Network) -> bool:
    """Whether a format holds what is in a network; another one may hold what it cannot."""
    try:
        write(network)
    except InputError:
        return False
    return True


def told(what: str, count: int, times: list[float]) -> float:
    """Prints times; how much more than proportional the last one is."""
    growth = times[-1] / times[0] / STEPS[0]
    shown = " ".join(f"{time:6.2f}" for time in times)
    print(f"{what:22} {count:7} observations {shown} s, {growth:.2f} times proportional", flush=True)
    return growth


if __name__ == "__main__":
    sys.exit(main())
