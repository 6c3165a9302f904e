"""How often the cause of a planted gross error is named, and how often an honest network raises an alarm.

Random networks (seeded) of 100 m to 3 km, of 7 to 14 points or (--large) of 34 to 57, are written as OBS and
COR files in Lambert 93, each with one mistake as people make them: units, elevations, exchanged coordinates
or names, digits. The network is read and searched.

Example:
    python tools/benchmarks/bench_gross_errors.py --networks 100
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import make_network as simulated
import numpy as np
import numpy.typing as npt
from command import command_line, write_json
from gross_mistakes import MISTAKES, PLANE, Planted, Random, Site

from obseq.errors import ObseqError
from obseq.survey import Network, make_points, write_cor, write_obs

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable


@dataclass(frozen=True)
class Extent:
    """How large random networks are.

    Attributes:
        known: numbers of known points, from and to (without it).
        new: the same of new points.
        apart: points are apart by more than this share of the network.
    """

    known: tuple[int, int]
    new: tuple[int, int]
    apart: float


SMALL = Extent((3, 6), (4, 10), 1.0 / 12.0)
LARGE = Extent((4, 9), (30, 50), 1.0 / 200.0)


def made_site(random: Random, extent: Extent = SMALL) -> Site:
    """A network of some known points and new ones, observed from most of its points."""
    n_known, n_new = int(random.integers(*extent.known)), int(random.integers(*extent.new))
    true = _spread_points(n_known + n_new, 10.0 ** random.uniform(2.0, 3.5), extent.apart, random)
    names = [f"K{k + 1}" for k in range(n_known)] + [f"P{k + 1}" for k in range(n_new)]
    book = simulated.measured(names, true, _sights(true, random), random)
    noisy = true[:n_known] + random.normal(0.0, 0.001, (n_known, 3))
    known = make_points(
        names[:n_known], simulated.in_system(noisy, PLANE), np.full((n_known, 3), simulated.SIGMA_KNOWN)
    )
    with tempfile.TemporaryDirectory() as folder:
        write_obs(Path(folder) / "site.obs", book)
        write_cor(Path(folder) / "site.cor", known, PLANE)
        texts = [(Path(folder) / f"site.{kind}").read_text(encoding="utf-8") for kind in ("obs", "cor")]
    lines = [[line.split() for line in text.splitlines()] for text in texts]
    kept = [[words for words in each if words and not words[0].startswith("*")] for each in lines]
    return Site(kept[0], kept[1], names[n_known:])


def _spread_points(n: int, size: float, least: float, random: Random) -> npt.NDArray[np.float64]:
    while True:
        plan = random.uniform(-size / 2.0, size / 2.0, (n, 2))
        apart = np.linalg.norm(plan[:, None] - plan[None, :], axis=2) + np.eye(n) * size
        if apart.min() > size * least:
            return np.column_stack([plan, 100.0 + random.uniform(0.0, size / 10.0, n)])


def _sights(true: npt.NDArray[np.float64], random: Random) -> npt.NDArray[np.int32]:
    """Each of two thirds of the points sees its four to seven nearest."""
    n = len(true)
    apart = np.linalg.norm(true[:, None] - true[None, :], axis=2)
    stations = np.sort(random.permutation(n)[: max(4, 2 * n // 3)])
    pairs = []
    for station in stations:
        nearest = np.argsort(apart[station])[1 : 1 + int(random.integers(4, 8))]
        pairs += [(station, target) for target in nearest]
    return np.array(pairs, np.int32)


@dataclass
class Count:
    """Networks tried, gross errors announced at all, causes named, named as the worst; seconds of search."""

    tried: int = 0
    announced: int = 0
    named: int = 0
    first: int = 0
    seconds: float = 0.0
    missed: tuple[int, ...] = ()


def surveyed(site: Site) -> Network:
    """The network of a site, by way of its files."""
    with tempfile.TemporaryDirectory() as folder:
        return site.read(Path(folder))


def counted(mistake: Callable[[Site, Random], Planted] | None, seeds: range, extent: Extent = SMALL) -> Count:
    """Plants a mistake (none for an honest network) in each network, and counts what is found."""
    count = Count()
    for seed in seeds:
        random = np.random.default_rng(seed)
        site = made_site(random, extent)
        planted = mistake(site, random) if mistake else None
        network = surveyed(site)
        start = time.process_time()
        errors = network.gross_errors()
        count.seconds += time.process_time() - start
        count.tried += 1
        count.announced += bool(errors)
        named = [planted is not None and planted.is_named_by(error) for error in errors]
        count.named += any(named)
        count.first += bool(named and named[0])
        count.missed += () if planted is None or any(named) else (seed,)
    return count


def asked() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("--networks", type=int, default=100, help="networks for each mistake")
    parser.add_argument("--large", action="store_true", help="networks of 34 to 57 points, not of 7 to 14")
    parser.add_argument("--only", nargs="*", help="names of mistakes")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures as JSON")
    return parser.parse_args()


def main() -> int:
    """Runs the bench and prints the table."""
    arguments = asked()
    table = {}
    print(f"{'mistake':28}{'networks':>9}{'announced':>10}{'named':>7}{'first':>7}{'s each':>8}  missed")
    for mistake in (None, *MISTAKES):
        name = mistake.__name__ if mistake else "none (false alarms)"
        if arguments.only and name not in arguments.only:
            continue
        count = counted(mistake, range(arguments.networks), LARGE if arguments.large else SMALL)
        table[name] = vars(count)
        figures = f"{count.tried:9}{count.announced:10}{count.named:7}{count.first:7}"
        print(f"{name:28}{figures}{count.seconds / count.tried:8.3f}  {count.missed[:8]}", flush=True)
    write_json(arguments.json, table)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except ObseqError as error:
        sys.exit(str(error))
