"""Photograph pages of reports: `python tools/report_pictures.py POLYGON.comp BLOCK.xml`.

The project is a total station's network of some fifty points, the block one of DBAT. The pictures go to
docs/pictures. It needs Chromium with its driver, and `obseq[browser]`.
"""

from __future__ import annotations

import contextlib
import importlib.util
import sys
import tempfile
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.cli.main import main as obseq
from obseq.report.compared import comparison_page
from obseq.report.page import page
from obseq.report.planned import plan_page
from obseq.survey import Datum, Network, Quality, compare, plan, simulate

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

    from obseq.records.adjustment import AdjustmentRecord

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
PHONE = {"width": 375, "height": 800, "deviceScaleFactor": 1, "mobile": True}
SETTINGS = "page.paint(arguments[0])"


def bench() -> ModuleType:
    """The bench of reports: its networks, and how it opens pages."""
    path = ROOT / "tools" / "benchmarks" / "bench_report.py"
    sys.path.insert(0, str(path.parent))  # benches import one another
    spec = importlib.util.spec_from_file_location("bench_report", path)
    if spec is None or spec.loader is None:
        raise SystemExit(f"{path} is missing")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def records(networks: dict[str, Any]) -> Iterator[tuple[str, AdjustmentRecord]]:
    """The records by name of their picture."""
    everything = Quality(relative=True, ellipses=0.95)
    with contextlib.chdir(str(files("obseq.survey") / "data")):  # names without folders
        demo = Network.read("demo.obs", "demo.cor", points_crs="IGNF:LAMB93")
        yield "demo", demo.adjust(quality=everything).record("Demo")
    yield "polygon", networks["project"].adjust(quality=everything).record("Polygon K06")
    yield "free", networks["project"].adjust(datum=Datum("inner")).record("Polygon K06, free")
    yield "large", networks["synthetic"].adjust().record("Ten thousand points")


def photograph(browser: Any, opened: Any, path: Path, name: str) -> None:
    """The pictures of one page: light; one of them dark, and on a phone."""
    opened(browser, path)
    browser.execute_script(SETTINGS, "light")
    browser.save_screenshot(str(PICTURES / f"report-{name}.png"))
    if name != "polygon":
        return
    browser.execute_script(SETTINGS, "dark")
    browser.save_screenshot(str(PICTURES / "report-dark.png"))
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
    opened(browser, path)
    browser.save_screenshot(str(PICTURES / "report-phone.png"))
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def grid(folder: Path) -> Any:
    """A site of twenty points, four of them known, that is to be measured from six stations."""
    places = np.array([(40.0 * (k % 5), 45.0 * (k // 5), 2.0 * (k % 3)) for k in range(20)])
    known, stations = (0, 4, 15, 19), (0, 4, 7, 12, 15, 19)
    points = [
        f"{1 if k in known else 0} P{k} {x} {y} {z} {0.002 if k in known else ''}"
        for k, (x, y, z) in enumerate(places.tolist())
    ]
    (folder / "site.cor").write_text("\n".join(points) + "\n", encoding="utf-8")
    lines = []
    for origin in stations:
        targets = [k for k in range(20) if 0.0 < np.linalg.norm(places[k] - places[origin]) < 130.0]
        for code, target in zip([7] + [5] * len(targets), targets, strict=False):
            length = np.linalg.norm(places[target] - places[origin])
            lines += [f"{code} P{origin} P{target} 0 0.0006", f"6 P{origin} P{target} 100 0.001"]
            lines.append(f"3 P{origin} P{target} {length:.4f} 0.002")
    (folder / "site.obs").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return simulate(Network.read(folder / "site.obs", folder / "site.cor", frame="Local"), noise=False)


def pages(folder: Path, networks: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """The texts of the pages by name of their picture."""
    yield from ((name, page(record)) for name, record in records(networks))
    site = grid(folder)
    yield "plan", plan_page(plan(site).record())
    first, second = (simulate(site, seed).adjust() for seed in (1, 2))
    yield "compare", comparison_page(compare(first, second).record())


def main() -> None:
    """Write the pictures."""
    reports = bench()
    browsing = reports.browsing()
    with tempfile.TemporaryDirectory() as name, browsing.chromium() as browser:
        project = Path(sys.argv[1])
        networks = {
            "project" if title == project.stem else title: network
            for title, network in reports.networks(Path(name), project)
        }
        for title, text in pages(Path(name), networks):
            path = Path(name) / f"{title}.html"
            path.write_text(text, encoding="utf-8")
            photograph(browser, browsing.opened, path, title)
        block = Path(name) / "block.html"
        obseq(["bundle", "--dbat", sys.argv[2], "--html", str(block)])
        photograph(browser, browsing.opened, block, "block")


if __name__ == "__main__":
    main()
