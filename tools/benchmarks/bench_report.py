"""The HTML report in a browser: how large it is, and how long it takes to open.

Three networks: the demo, a project file if one is named, and a synthetic one of 10,000 points. Each page is
opened several times in a headless Chromium of its own; the time is that until it has been painted.

Example:
    python tools/benchmarks/bench_report.py --project polygon.comp --times 5
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import statistics
import sys
import tempfile
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import make_network
import numpy as np

from obseq.report.page import page
from obseq.survey import Network

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

BROWSING = Path(__file__).resolve().parents[2] / "tests" / "report" / "browsing.py"
MOST_BYTES, BYTES_OF_ONE = 3_000_000, 150
POINTS, OBSERVATIONS = 10_000, 60_000


def browsing() -> ModuleType:
    """How the tests open pages."""
    spec = importlib.util.spec_from_file_location("browsing", BROWSING)
    if spec is None or spec.loader is None:
        raise SystemExit(f"{BROWSING} is missing")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def synthetic(folder: Path) -> Network:
    """A network of 10,000 points."""
    chance = np.random.default_rng(1)
    true = make_network.terrain(POINTS, 50.0, chance)
    names = [f"P{row + 1}" for row in range(POINTS)]
    book = make_network.measured(names, true, make_network.sights(POINTS, OBSERVATIONS), chance)
    make_network.write_obs(folder / "n.obs", book)
    known = make_network.known_points(names, true, 100, make_network.FRAME, chance)
    make_network.write_cor(folder / "n.cor", known, "")
    return Network.read(folder / "n.obs", folder / "n.cor", frame=make_network.FRAME)


def networks(folder: Path, project: Path | None) -> Iterator[tuple[str, Network]]:
    """The networks by name."""
    data = files("obseq.survey") / "data"
    yield "demo", Network.read(str(data / "demo.obs"), str(data / "demo.cor"), points_crs="IGNF:LAMB93")
    if project:
        yield project.stem, Network.read_project(project)
    yield "synthetic", synthetic(folder)


def main() -> None:
    """Prints size and times of each page."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--project", type=Path, help="a project file to make a page of, too")
    options.add_argument("--times", type=int, default=5)
    given = options.parse_args()
    browser_of = browsing()
    print(f"load of the machine {os.getloadavg()[0]:.1f}, {os.cpu_count()} processors")
    with tempfile.TemporaryDirectory() as name:
        for title, network in networks(Path(name), given.project):
            record = network.adjust().record()
            path = Path(name) / f"{title}.html"
            path.write_text(page(record), encoding="utf-8")
            limit = MOST_BYTES + BYTES_OF_ONE * len(record.observations)
            print(f"{title}: {len(record.points)} points, {len(record.observations)} observations")
            print(f"  {path.stat().st_size / 1e6:.2f} MB, at most {limit / 1e6:.2f}")
            with browser_of.chromium() as browser:
                times = sorted(browser_of.opened(browser, path) for _ in range(given.times))
            middle = statistics.median(times)
            print(
                f"  opened in {times[0]:.0f} to {times[-1]:.0f} ms, the middle one {middle:.0f}", flush=True
            )


if __name__ == "__main__":
    sys.exit(main())
