"""Headless Chromium for tests of pages: what it needs, and what pages are asked."""

import importlib.util
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--in-process-gpu",  # a process less to start and to talk to
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1280,900",
)
NAMES = ("chromium", "chromium-browser", "google-chrome")
HOW = "(Debian: apt-get install chromium chromium-driver; pip install 'obseq[browser]')"
PHONE = {"width": 375, "height": 800, "deviceScaleFactor": 2, "mobile": True}
LESS = (
    "for (const data of document.querySelectorAll('[type=\"application/json\"]')) data.textContent = '';"
    "for (const body of document.querySelectorAll('.scroll tbody')) {"
    "  const kept = [...body.rows].slice(0, 3);"
    "  kept.push(body.querySelector('.unused'), body.querySelector('.alarm')?.closest('tr'));"
    "  for (const row of [...body.rows]) if (!kept.includes(row)) row.remove();"
    "}"
)
PAINTED = (
    "const painted = () => arguments[0](performance.now());"
    "requestAnimationFrame(() => requestAnimationFrame(painted))"
)


@contextmanager
def chromium() -> Iterator[Any]:
    """A new headless browser with a profile of its own."""
    program, driver = next(filter(None, map(shutil.which, NAMES)), None), shutil.which("chromedriver")
    if program is None or driver is None:
        pytest.skip(f"no Chromium with its driver {HOW}")
    if importlib.util.find_spec("selenium") is None:
        pytest.skip(f"no selenium {HOW}")
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    with tempfile.TemporaryDirectory() as profile:
        options = webdriver.ChromeOptions()
        options.binary_location = program
        for flag in (*FLAGS, f"--user-data-dir={profile}"):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        with webdriver.Chrome(options=options, service=Service(driver)) as browser:
            yield browser


def opened(browser: Any, path: Path) -> float:
    """Opens a page; milliseconds until it has been painted."""
    for kind in ("browser", "performance"):
        browser.get_log(kind)
    browser.get(path.as_uri())
    return float(browser.execute_async_script(PAINTED))


def axe() -> str:
    """The script that looks for what keeps people from using a page."""
    spec = importlib.util.find_spec("axe_core_python")
    if spec is None or spec.origin is None:
        pytest.skip(f"no axe-core {HOW}")
    return Path(spec.origin).with_name("axe.min.js").read_text(encoding="utf-8")


def violations(browser: Any, *rules: str) -> list[str]:
    """What axe finds wrong on the page, without most rows of its tables: it looks at each cell.

    Nor with the data of its scripts, which it copies, with all the rest, for each rule on the whole page.

    Args:
        browser: Where the page is open.
        rules: What it looks for; everything when none is given.
    """
    browser.execute_script(LESS)
    browser.execute_script(axe())
    wanted = {"resultTypes": ["violations"]} | ({"runOnly": list(rules)} if rules else {})
    asked = "const [wanted, done] = arguments; axe.run(document, wanted).then(done)"
    found = browser.execute_async_script(asked, wanted)
    return [
        f"{item['id']}: {item['help']} ({node['html'][:90]})"
        for item in found["violations"]
        for node in item["nodes"][:2]
    ]
