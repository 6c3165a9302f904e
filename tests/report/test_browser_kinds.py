"""Pages of every kind of result: nobody is kept out, nothing is asked or logged, nothing overlaps."""

import base64

import browsing
import pytest
import sites

from obseq.report.page import document

pytestmark = pytest.mark.slow
WIDTHS = {"wide": 1400, "phone": 390}
KEYS = (
    "const key = (one, key) => one.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true }));"
    "const first = document.querySelector('#list button.item'); first.focus(); first.click();"
    "const [id, table] = [...page.tables].find(([, one]) => one.isLinked);"
    "document.querySelector(`#tabs [aria-controls='s-${id}']`)?.click();"
    "table.scroll.focus(); key(table.scroll, 'ArrowDown'); key(table.scroll, 'ArrowDown');"
    "const row = table.body.querySelector('[aria-selected=true]');"
    "const told = byId('selbox').textContent;"
    "return [document.activeElement === table.scroll, row !== null, location.hash, told]"
)
"""From the first finding to a row of a table, by keys."""


@pytest.fixture(
    scope="module",
    params=["site", "thousand", "plan", "comparison", "block", "whole", "levelling", "free"],
)
def path(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    found = folder / f"{request.param}.html"
    found.write_text(document(sites.page_of(request.param, folder)), encoding="utf-8")
    return found


@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_keeps_anybody_out(path, width, browser, seen) -> None:
    """What axe finds in both themes; no sideways scroll; nothing is logged, nothing is asked of a network."""
    metrics = {"width": WIDTHS[width], "height": 900, "deviceScaleFactor": 1, "mobile": width == "phone"}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    try:
        browsing.opened(browser, path)
        sides = browser.execute_script("return [document.documentElement.scrollWidth, window.innerWidth]")
        assert sides[0] <= sides[1] == WIDTHS[width]
        for theme, rules in (("light", []), ("dark", ["color-contrast"])):  # the rest is the same page
            browser.execute_script("page.paint(arguments[0])", theme)
            assert browsing.wrong(browser, seen, f"{path.stem} {width} {theme}", *rules) == [], theme
        assert browser.get_log("browser") == []
        assert browsing.asked(browser) <= {"file", "data"}
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_names_stand_apart_and_ellipses_within(path, browser) -> None:
    """In each view that the page offers."""
    browsing.opened(browser, path)
    views = browser.execute_script("return (page.content.plan.views ?? []).length")
    assert (views == 2) is (path.stem == "block")
    for k in range(max(views, 1)):
        browser.execute_script("if (arguments[1]) page.view(page.content.plan.views[arguments[0]])", k, views)
        browsing.check_drawing(browser)


@pytest.mark.parametrize("path", ["block"], indirect=True)
def test_an_arrow_far_beyond_the_others_is_short_and_says_so(path, browser) -> None:
    """One gross error neither makes the others invisible nor leaves its frame."""
    browsing.opened(browser, path)
    far, told = browser.execute_script(
        "const content = structuredClone(page.content.sections[0].charts[0]);"
        "content.dx[0] = 500; content.suspected = [0]; const figure = imageFrame(content);"
        "const d = figure.querySelector('path.arrow').getAttribute('d');"
        "const [x, y, to] = d.match(/-?[\\d.]+/g).map(Number);"
        "return [Math.abs(to - x), figure.textContent]"
    )
    assert 60.0 < far < 67.0 and "are drawn shorter" in told


def test_keys_lead_from_the_verdict_to_a_row(path, browser) -> None:
    browsing.opened(browser, path)
    is_focused, is_picked, address, told = browser.execute_script(KEYS)
    assert is_focused and is_picked
    assert len(address) > 2 and told.strip()


def test_a_next_step_is_copied(path, browser) -> None:
    browsing.opened(browser, path)
    copied = (
        "const told = []; page.copy = (text) => told.push(text);"
        "for (const one of document.querySelectorAll('#list .copy button')) one.click(); return told"
    )
    steps = [
        item["copy"]
        for part in browser.execute_script("return page.content.lists")
        for item in part["items"]
        if item.get("copy")
    ]
    assert browser.execute_script(copied) == steps
    assert steps or path.stem not in ("site", "thousand")


@pytest.mark.parametrize("path", ["site"], indirect=True)
def test_paper_is_short(path, browser) -> None:
    """As the design states for 25 points."""
    browsing.opened(browser, path)
    browser.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    pdf = browser.execute_cdp_cmd("Page.printToPDF", {"preferCSSPageSize": True})["data"]
    sheets = base64.b64decode(pdf).count(b"/Type /Page\n")
    assert 3 <= sheets <= 5
