"""Seconds to read and to write networks of two sizes in each format: the larger takes as many times longer.

python tools/benchmarks/bench_formats.py --size 50000
"""

import argparse
import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from obseq.survey import Network
from obseq.survey.conversion import NETWORK_WRITERS

STEPS = 10
"""The smaller network is smaller by this factor."""
LIMIT = 2.0
"""How much more than proportional the time of the larger one may be: files that fit in no cache."""
SIGMAS = ["distance=3mm", "direction=5sec", "zenith=5sec"]


def positions(n: int) -> list[tuple[str, float, float, float]]:
    """Points of a square grid: name, east, north, height."""
    side = math.isqrt(n) + 1
    return [(f"P{k}", 100.0 * (k % side), 100.0 * (k // side), 10.0 + k % 7) for k in range(n)]


def sights(n: int) -> Iterator[tuple[int, int, list[tuple[float, float, float]]]]:
    """Set-ups: origin, first target, and azimuth (deg), zenith (deg), distance to four points after it."""
    points = positions(n // 12 + 5)
    for k in range(n // 12):
        measured = []
        for j in range(1, 5):
            east, north, up = (points[k + j][axis] - points[k][axis] for axis in (1, 2, 3))
            flat = math.hypot(east, north)
            zenith = math.degrees(math.atan2(flat, up))
            measured.append((math.degrees(math.atan2(east, north)) % 360, zenith, math.hypot(flat, up)))
        yield k, k + 1, measured


def gama(n: int) -> Iterator[str]:
    """A network of Gama."""
    yield '<gama-local><network axes-xy="en"><points-observations direction-stdev="10"'
    yield ' zenith-angle-stdev="10" distance-stdev="5">'
    for k, (name, east, north, up) in enumerate(positions(n // 12 + 5)):
        part = 'fix="xyz"' if k % 10 == 0 else 'adj="xyz"'
        yield f'<point id="{name}" x="{east}" y="{north}" z="{up}" {part} />'
    for origin, first, measured in sights(n):
        yield f'<obs from="P{origin}">'
        for j, (azimuth, zenith, distance) in enumerate(measured):
            yield f'<direction to="P{first + j}" val="{azimuth / 0.9:.5f}" />'
            yield f'<z-angle to="P{first + j}" val="{zenith / 0.9:.5f}" />'
            yield f'<s-distance to="P{first + j}" val="{distance:.4f}" />'
        yield "</obs>"
    yield "</points-observations></network></gama-local>"


def starnet(n: int) -> Iterator[str]:
    """A data file of STAR*NET."""
    yield ".3D\n.UNITS Meters GONS\n.ORDER EN"
    for k, (name, east, north, up) in enumerate(positions(n // 12 + 5)):
        yield f"C {name} {east} {north} {up}" + (" ! ! !" if k % 10 == 0 else "")
    for origin, first, measured in sights(n):
        yield f"DB P{origin}"
        for j, (azimuth, zenith, distance) in enumerate(measured):
            yield f"DM P{first + j} {azimuth / 0.9:.5f} {distance:.4f} {zenith / 0.9:.5f} 1 0.005 1"
        yield "DE"


def landxml(n: int) -> Iterator[str]:
    """A survey in LandXML."""
    yield '<LandXML><Units><Metric linearUnit="meter" angularUnit="grads"/></Units><CgPoints>'
    for k, (name, east, north, up) in enumerate(positions(n // 12 + 5)):
        known = ' pntSurv="control"' if k % 10 == 0 else ""
        yield f'<CgPoint name="{name}"{known}>{north} {east} {up}</CgPoint>'
    yield "</CgPoints><Survey>"
    for origin, first, measured in sights(n):
        yield f'<InstrumentSetup id="s{origin}" stationName="P{origin}"/>'
        yield f'<ObservationGroup setupID="s{origin}">'
        for j, (azimuth, zenith, distance) in enumerate(measured):
            yield f'<RawObservation horizAngle="{azimuth / 0.9:.5f}" zenithAngle="{zenith / 0.9:.5f}"'
            yield f' slopeDistance="{distance:.4f}"><TargetPoint pntRef="P{first + j}"/></RawObservation>'
        yield "</ObservationGroup>"
    yield "</Survey></LandXML>"


FORMATS: dict[str, Callable[[int], Iterator[str]]] = {".gkf": gama, ".dat": starnet, ".xml": landxml}


def seconds(work: Callable[[], object]) -> float:
    """The least of two times."""
    times = []
    for _ in range(2):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


def read(path: Path) -> Network:
    """A network, from its file."""
    return Network.read_project(path, sigmas=[] if path.suffix == ".gkf" else SIGMAS, refraction=1.0)


def main() -> int:
    """Print the times; 1 when one grows faster than the network."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--size", type=int, default=50_000, help="observations (%(default)s)")
    options = parser.parse_args()
    sizes = (options.size // STEPS, options.size)
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for suffix, lines in FORMATS.items():
            paths = [Path(folder) / f"{size}{suffix}" for size in sizes]
            for path, size in zip(paths, sizes, strict=True):
                path.write_text("\n".join(lines(size)))
            times = [seconds(lambda path=path: read(path)) for path in paths]
            worst = max(worst, told(f"read {suffix}", len(read(paths[1]).book.observations), times))
        networks = [read(Path(folder) / f"{size}.gkf") for size in sizes]
        for suffix, write in NETWORK_WRITERS.items():
            try:
                times = [seconds(lambda write=write, network=network: write(network)) for network in networks]
            except ValueError as error:
                print(f"write {suffix}: {error}")
                continue
            worst = max(worst, told(f"write {suffix}", len(networks[1].book.observations), times))
    return 1 if worst > LIMIT else 0


def told(what: str, count: int, times: list[float]) -> float:
    """Prints two times; how much more than proportional the second one is."""
    growth = times[1] / times[0] / STEPS
    print(f"{what:12} {count:7} observations {times[1]:6.2f} s, {growth:.2f} times proportional")
    return growth


if __name__ == "__main__":
    sys.exit(main())
