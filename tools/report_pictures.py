"""Photograph pages of reports for the documentation: `python tools/report_pictures.py POLYGON.comp`.

The project is a total station's network of some fifty points; the pictures go to docs/pictures. It needs
Chromium with its driver, and `obseq[browser]`.
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from obseq.report import page
from obseq.survey import Datum, Quality

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

    from obseq.records.adjustment import AdjustmentRecord

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
PHONE = {"width": 375, "height": 800, "deviceScaleFactor": 1, "mobile": True}
SETTINGS = (
    "const form = document.getElementById('settings');"
    "form.elements.theme.value = arguments[0]; form.elements.language.value = arguments[1];"
    "form.dispatchEvent(new Event('change')); document.getElementById('plan').scrollIntoView()"
)


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
    yield "demo", networks["demo"].adjust(quality=everything).record("Demo")
    yield "polygon", networks["project"].adjust(quality=everything).record("Polygon K06")
    yield "free", networks["project"].adjust(datum=Datum("inner")).record("Polygon K06, free")
    yield "large", networks["synthetic"].adjust().record("Ten thousand points")


def photograph(browser: Any, opened: Any, path: Path, name: str) -> None:
    """The pictures of one page: light, and on a phone or dark with French numbers."""
    opened(browser, path)
    browser.execute_script(SETTINGS, "light", "en")
    browser.save_screenshot(str(PICTURES / f"report-{name}.png"))
    if name != "polygon":
        return
    browser.execute_script(SETTINGS, "dark", "fr")
    browser.save_screenshot(str(PICTURES / "report-dark.png"))
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
    opened(browser, path)
    browser.save_screenshot(str(PICTURES / "report-phone.png"))
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


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
        for title, record in records(networks):
            path = Path(name) / f"{title}.html"
            path.write_text(page(record), encoding="utf-8")
            photograph(browser, browsing.opened, path, title)


if __name__ == "__main__":
    main()
