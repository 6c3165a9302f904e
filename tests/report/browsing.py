"""Headless Chromium for tests of pages: what it needs, and what pages are asked."""

import hashlib
import importlib.util
import json
import re
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
    "--app=data:,",  # a window without a field for addresses, which is made of pages of its own
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1280,900",
)
BRIEF = "--js-flags=--single-threaded --no-opt"
"""For what runs once: nothing is compiled at length, by no other thread."""

NAMES = ("chromium", "chromium-browser", "google-chrome")
HOW = "(Debian: apt-get install chromium chromium-driver; pip install 'obseq[browser]')"
PHONE = {"width": 375, "height": 800, "deviceScaleFactor": 2, "mobile": True}
LESS = (
    "for (const data of document.querySelectorAll('[type=\"application/json\"]')) data.textContent = '';"
    "for (const body of document.querySelectorAll('.scroll tbody')) {"
    "  const kinds = new Set(['space']);"
    "  [...body.rows].forEach((row, k) => {"
    "    const parts = [row, ...row.querySelectorAll('[class]')];"
    "    const kind = parts.map((part) => part.className).join(' ').trim();"
    "    if (kinds.has(kind) && (k > 1 || kind === 'space')) row.remove();"
    "    kinds.add(kind);"
    "  });"
    "}"
)
PAINTED = (
    "const [done] = arguments; const painted = () => done(performance.now());"
    "const look = () => (document.documentElement.dataset.ready !== 'no'"
    "  ? requestAnimationFrame(() => requestAnimationFrame(painted)) : setTimeout(look, 5)); look()"
)
"""Waits until the script of a page has made it, and it is painted."""


RUN = re.compile(r"[0-9a-f]{12}, \d{4}-\d\d-\d\dT[\d:+]+;|/[^ <]*/pages\d+/")
"""The words of a page for the run of the program, and the folder of large networks."""


@contextmanager
def chromium(*more: str) -> Iterator[Any]:
    """A new headless browser with a profile of its own, and more flags."""
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
        for flag in (*FLAGS, *more, f"--user-data-dir={profile}"):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        with webdriver.Chrome(options=options, service=Service(driver)) as browser:
            yield browser


def opened(browser: Any, path: Path) -> float:
    """Opens a page; milliseconds until it has been painted."""
    for kind in ("browser", "performance"):
        browser.get_log(kind)
    browser.get(path.as_uri())
    browser.shown = path
    return float(browser.execute_async_script(PAINTED))


def axe() -> str:
    """The script that looks for what keeps people from using a page."""
    spec = importlib.util.find_spec("axe_core_python")
    if spec is None or spec.origin is None:
        pytest.skip(f"no axe-core {HOW}")
    return Path(spec.origin).with_name("axe.min.js").read_text(encoding="utf-8")


def lighten(browser: Any) -> None:
    """Leaves of each table two rows of each kind, if they are alike, and nothing of the data of the scripts.

    Rows of other kinds stay too. The data is no element that anybody sees.
    """
    browser.execute_script(LESS)


def state(browser: Any, *rules: str) -> str:
    """Digest of all that `violations` depends on: document, window, browser, axe; which run made it apart."""
    window = browser.execute_script("return [innerWidth, innerHeight, devicePixelRatio, scrollX, scrollY]")
    document = RUN.sub("", browser.execute_script("return document.documentElement.outerHTML"))
    tools = [browser.capabilities["browserVersion"], axe(), Path(__file__).read_text("utf-8")]
    return hashlib.sha256(json.dumps([document, window, rules, tools]).encode()).hexdigest()


def violations(browser: Any, *rules: str) -> list[str]:
    """What axe finds wrong on the page, and where.

    Args:
        browser: Where the page is open.
        rules: What it looks for; everything when none is given.
    """
    browser.execute_script(f"{axe()}; axe.configure({{ noHtml: true }})")  # no copy of each element
    wanted = {"resultTypes": ["violations"]} | ({"runOnly": list(rules)} if rules else {})
    asked = "const [wanted, done] = arguments; axe.run(document, wanted).then(done)"
    found = browser.execute_async_script(asked, wanted)
    return [
        f"{item['id']}: {item['help']} ({' '.join(node['target'])[:90]})"
        for item in found["violations"]
        for node in item["nodes"][:2]
    ]


def wrong(browser: Any, seen: Any, name: str, *rules: str) -> list[str]:
    """What axe finds wrong on the page: nothing where it found nothing in the same document before."""
    lighten(browser)
    now = state(browser, *rules)
    if seen.has(f"axe/{name}", now):
        return []
    found = violations(browser, *rules)
    if not found:
        seen.add(f"axe/{name}", now)
    return found


def asked(browser: Any) -> set[str]:
    """How the page asked for whatever it asked for since it was opened."""
    messages = [json.loads(row["message"])["message"] for row in browser.get_log("performance")]
    return {
        row["params"]["request"]["url"].split(":")[0]
        for row in messages
        if row["method"] == "Network.requestWillBeSent"
    }


def check_drawing(browser: Any) -> None:
    """What is drawn: no two names overlap, and no ellipse of the whole plan leaves it."""
    boxes, ellipses, size = browser.execute_script(
        "const { plan } = page; plan.fit(); plan.put(); const [names, rings] = [[], []];"
        "const sheet = new CanvasSheet(plan.context, plan.width, plan.height);"
        "const box = (t, x, y, how) => [x, y - 10, x + sheet.wide(t, 12, how.weight), y + 2];"
        "sheet.text = (...told) => { if (told[3].halo) names.push(box(...told)); };"
        "const size = (k) => (plan.content.major[k] ?? 0) * plan.ellipseScale;"
        "for (const [k, x, y] of plan.inside) rings.push([x, y, size(k)]);"
        "plan.drawNames(sheet); return [names, rings, [plan.width, plan.height]]"
    )
    assert boxes
    for k, one in enumerate(boxes):
        for other in boxes[:k]:
            assert one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]
    for x, y, radius in ellipses:
        assert radius <= x <= size[0] - radius and radius <= y <= size[1] - radius
