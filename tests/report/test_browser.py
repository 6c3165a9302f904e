"""The page in a browser: it sorts, filters and links tables with the plan, loads nothing and logs nothing."""

import base64
import importlib.util
import json
import sys
from collections.abc import Callable, Iterator
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import browsing
import numpy as np
import pytest
from scipy.special import ndtri

from obseq.report.page import page
from obseq.report.result_file import read_json, to_json
from obseq.survey import Network, Quality

STROKE = 20
"""Milliseconds that the pointer takes from place to place."""

BENCH = Path(__file__).resolve().parents[2] / "tools" / "benchmarks" / "bench_report.py"


def module(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def demo() -> Network:
    data = files("obseq.survey") / "data"
    return Network.read(str(data / "demo.obs"), str(data / "demo.cor"), points_crs="IGNF:LAMB93")


def synthetic(folder: Path) -> Network:
    """The large network of the bench."""
    sys.path.insert(0, str(BENCH.parent))  # benches import one another
    found: Network = module(BENCH).synthetic(folder)
    return found


@pytest.fixture(scope="module")
def pages(tmp_path_factory, browser):
    """Reports by name, made when first asked for, by way of the result file."""
    folder = tmp_path_factory.mktemp("pages")

    def made(name: str, shared: Path | None = None) -> Path:
        path = folder / f"{name}.html"
        if path.exists():
            return path
        if name == "demo":
            network = demo()
        elif name == "polygon":
            network = Network.read_project(shared / "comp3d-polygone-k06" / "project.comp")
        else:
            network = synthetic(folder)
        is_small = name != "large"
        record = network.adjust(quality=Quality(relative=is_small, ellipsoids=is_small)).record()
        if is_small:
            (folder / f"{name}.json").write_text(to_json(record), encoding="utf-8")
            record = read_json(folder / f"{name}.json")
        path.write_text(page(record), encoding="utf-8")
        assert path.stat().st_size <= 3_000_000 + 150 * len(record.observations)
        return path

    return made


@pytest.fixture(scope="module", params=["demo", "polygon"])
def path(request, pages) -> Path:
    shared = request.getfixturevalue("shared_data") if request.param == "polygon" else None
    return pages(request.param, shared)


def show(browser, path: Path | None) -> None:
    """Opens a page anew; nothing: whatever is open is of no use any more."""
    browser.shown = None
    if path is not None:
        browsing.opened(browser, path)


@pytest.fixture
def report(path, browser) -> Path:
    """A page that is open: each test finds it as the one before has left it: nothing is picked."""
    if getattr(browser, "shown", None) != path:
        show(browser, path)
    return path


@pytest.fixture(scope="module")
def violations(browser, seen) -> Callable[..., list[str]]:
    """What axe finds wrong on the page: nothing where it found nothing in the same document before."""
    return partial(browsing.wrong, browser, seen)


@pytest.fixture
def spoilt(report, browser) -> Iterator[Path]:
    """A page of which a test leaves little: who needs it next opens it anew."""
    yield report
    show(browser, None)


def cells(browser, table: str, title: str) -> list[str]:
    """What a column shows, in the rows that are in sight."""
    return browser.execute_script(
        "const [id, title] = arguments; const element = page.tables.get(id).element;"
        "const k = [...element.querySelectorAll('th')].findIndex((th) => th.textContent.startsWith(title));"
        "return [...element.querySelectorAll('tbody tr[data-row]')].map((tr) => tr.children[k].textContent)",
        table,
        title,
    )


def click(browser, selector: str) -> None:
    browser.execute_script("document.querySelector(arguments[0]).click()", selector)


def escape(browser) -> None:
    """Nothing is picked any more, and every row is shown."""
    browser.execute_script("document.dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape' }))")


def write(browser, table: str, text: str) -> None:
    """Writes in the filter of a table."""
    browser.execute_script(
        "const { input } = page.tables.get(arguments[0]); input.value = arguments[1];"
        "input.dispatchEvent(new Event('input', { bubbles: true }))",
        table,
        text,
    )


def choose(browser, name: str, value: str) -> None:
    """Changes one of the settings of the page."""
    if name == "theme":
        browser.execute_script("page.paint(arguments[0])", value)
        return
    browser.execute_script(
        "const form = document.getElementById('settings');"
        "form.elements[arguments[0]].value = arguments[1];"
        "form.dispatchEvent(new Event('change'))",
        name,
        value,
    )


def test_rows_sort_by_any_column(report, browser) -> None:
    worst = [abs(float(text)) for text in cells(browser, "observations", "w") if text != "-"]
    assert len(worst) > 5 and worst == sorted(worst, reverse=True)
    sort = "#s-observations th:nth-child(7) button"
    click(browser, sort)
    state = "return document.querySelector('#s-observations th:nth-child(7)').getAttribute('aria-sort')"
    assert browser.execute_script(state) == "ascending"
    rows = browser.execute_script("return page.tables.get('observations').rows")
    column = browser.execute_script("return page.tables.get('observations').columns[6].values")
    unused = browser.execute_script("return page.tables.get('observations').content.unused")
    assert [(unused[row], column[row]) for row in rows] == sorted(zip(unused, column, strict=True))
    click(browser, sort)
    assert browser.execute_script(state) == "descending"
    browser.execute_script(
        "const table = page.tables.get('observations'); table.order = { key: 'w', sign: -1 };"
        "table.describe(); table.refresh()"
    )


def test_filters_keep_what_they_say(report, browser) -> None:
    write(browser, "observations", "Dist |w|>1")
    assert set(cells(browser, "observations", "type")) == {"Dist"}
    assert all(abs(float(text)) > 1.0 for text in cells(browser, "observations", "w"))
    name = browser.execute_script("return page.content.names[0]")
    write(browser, "observations", f"{name} w<0")
    rows = zip(*(cells(browser, "observations", title) for title in ("from", "to", "w")), strict=True)
    assert all(name in (start, end) and float(w) < 0 for start, end, w in rows)
    write(browser, "observations", "")
    kept = "const table = page.tables.get('observations'); return table.rows.length === table.size"
    assert browser.execute_script(kept)


def test_one_selection_goes_through_the_page(report, browser) -> None:
    click(browser, "#s-observations tbody tr[data-row]")
    ends = [cells(browser, "observations", title)[0] for title in ("from", "to")]
    drawn = browser.execute_script("return page.plan.selection.points.map((k) => page.content.names[k])")
    assert drawn == ends
    box = "return document.getElementById('selbox').textContent"
    assert ends[0] in browser.execute_script(box)
    row = browser.execute_script("return page.selection.row")
    assert browser.execute_script("return location.hash") == f"#o{row}"
    name = browser.execute_script(
        "const { plan } = page; const k = page.observations.columns[1].values[0]; page.choose({ point: k });"
        "plan.scale *= 30; plan.middle = [plan.content.x[k], plan.content.y[k]]; plan.put();"
        "plan.pick(...plan.place(k)); return page.content.names[k]"
    )
    assert browser.execute_script("return decodeURIComponent(location.hash)") == f"#p{name}"
    assert name in browser.execute_script(box)
    browser.execute_script("page.showRows()")
    both = zip(cells(browser, "observations", "from"), cells(browser, "observations", "to"), strict=True)
    assert all(name in ends for ends in both)
    browser.execute_script("page.plan.fit()")
    escape(browser)
    assert browser.execute_script(
        "const table = page.tables.get('observations'); return table.rows.length === table.size"
    )


def test_an_address_selects(report, browser) -> None:
    name = browser.execute_script("return page.content.names[1]")
    browser.get(f"{report.as_uri()}?again#p{name}")
    browser.execute_async_script(browsing.PAINTED)
    assert browser.execute_script("return page.selection.point") == 1
    show(browser, report)


def test_real_clicks_and_wheels_move_and_pick(report, browser) -> None:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    canvas = browser.find_element(By.ID, "map")
    browser.execute_script("document.getElementById('planpane').scrollIntoView()")
    before = browser.execute_script("page.plan.fit(); return [page.plan.scale, ...page.plan.middle]")
    pointer = ActionChains(browser, duration=STROKE)
    pointer.move_to_element(canvas).click_and_hold().move_by_offset(80, 30).release().perform()
    moved = browser.execute_script("return [page.plan.scale, ...page.plan.middle]")
    assert moved[0] == before[0]
    assert moved[1] - before[1] == pytest.approx(-80 / before[0], rel=0.05)
    assert moved[2] - before[2] == pytest.approx(30 / before[0], rel=0.05)
    browser.find_element(By.CSS_SELECTOR, "[data-zoom='1.5']").click()
    assert browser.execute_script("return page.plan.scale") == pytest.approx(1.5 * before[0])
    canvas.send_keys("0")
    assert browser.execute_script("return page.plan.scale") == pytest.approx(before[0], rel=1e-6)
    place = browser.execute_script(
        "const p = page.plan; p.put(); const [, x, y] = p.inside[0];"
        "return [x - p.width / 2, y - p.height / 2]"
    )
    pointer = ActionChains(browser, duration=STROKE)
    pointer.move_to_element_with_offset(canvas, *map(round, place)).click().perform()
    assert browser.execute_script("return page.plan.selection.points.length") >= 1
    escape(browser)
    canvas.send_keys("n")
    assert browser.execute_script("return page.selection.point") is not None
    escape(browser)


def test_types_are_switched_on_the_plan(report, browser) -> None:
    drawn = (
        "const { sights, visible } = page.plan;"
        "return sights.list.filter((pair) => pair.types.some((type) => visible.has(type))).length"
    )
    before = browser.execute_script(drawn)
    switch = "for (const box of document.querySelectorAll('#planbar .menu input')) box.click()"
    browser.execute_script(switch)
    assert before > 0
    assert browser.execute_script(drawn) == 0
    browser.execute_script(switch)


def test_names_stand_apart_and_ellipses_within(report, browser) -> None:
    browsing.check_drawing(browser)


def test_units_and_decimal_marks_are_chosen(spoilt, browser) -> None:
    write(browser, "observations", "Hz")
    (gon,) = cells(browser, "observations", "observed")[:1]
    choose(browser, "angles", "degree")
    (degrees,) = cells(browser, "observations", "observed")[:1]
    choose(browser, "angles", "dms")
    (sexagesimal,) = cells(browser, "observations", "observed")[:1]
    in_metres, small = cells(browser, "points", "x")[0], cells(browser, "points", "sx")[0]
    choose(browser, "lengths", "us-ft")
    assert float(cells(browser, "points", "x")[0]) == pytest.approx(float(in_metres) * 3937 / 1200, abs=4e-4)
    assert float(cells(browser, "points", "sx")[0]) == pytest.approx(float(small) / 304.8006, abs=4e-5)
    choose(browser, "language", "fr")
    (french,) = cells(browser, "observations", "observed")[:1]
    assert float(degrees.split()[0]) == pytest.approx(0.9 * float(gon.split()[0]), abs=2e-5)
    whole, minutes, seconds = map(float, sexagesimal.split()[0].split("-"))
    assert whole + minutes / 60 + seconds / 3600 == pytest.approx(float(degrees.split()[0]), abs=3e-5)
    assert french == sexagesimal.replace(".", ",")
    assert "," in cells(browser, "points", "x")[0]
    for name, value in (("language", "en"), ("lengths", "m"), ("angles", "gon")):
        choose(browser, name, value)


def test_nothing_is_logged_and_nothing_is_asked_of_a_network(report, browser) -> None:
    assert browser.get_log("browser") == []
    asked = browsing.asked(browser)
    assert asked and asked <= {"file", "data"}


def test_axe_finds_nothing(spoilt, browser, violations) -> None:
    for theme, rules in (("light", []), ("dark", ["color-contrast"])):  # the rest is the same page
        choose(browser, "theme", theme)
        assert browser.execute_script("return document.documentElement.dataset.theme") == theme
        assert violations(f"{spoilt.stem} {theme}", *rules) == [], theme


def test_a_phone_shows_it_without_sideways_scrolling(path, browser, violations) -> None:
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", browsing.PHONE)
    try:
        show(browser, path)
        wide = browser.execute_script("return [document.documentElement.scrollWidth, window.innerWidth]")
        assert wide == [375, 375]
        if path.stem == "demo":
            assert violations("demo on a phone") == []
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_charts_are_those_of_the_stored_residuals(report, browser) -> None:
    stored = json.loads(report.with_suffix(".json").read_text(encoding="utf-8"))["observations"]
    residuals = np.array([row["standardised_residual"] for row in stored if row.get("standardised_residual")])
    bars = (
        "return [...document.querySelectorAll('#s-quality .bar title')].map((bar) => Number(bar.textContent))"
    )
    edges = np.concatenate([[-np.inf], np.arange(-4.5, 5.0, 0.5), [np.inf]])
    np.testing.assert_array_equal(browser.execute_script(bars), np.histogram(residuals, edges)[0])
    path = browser.execute_script("return document.querySelector('#s-quality .dot').getAttribute('d')")
    dots = np.array([text.split("a")[0].split() for text in path.split("M")[1:]], dtype=float)
    expected = ndtri((np.arange(len(residuals)) + 0.5) / len(residuals))
    assert len(dots) == len(residuals)
    across, up = np.polyfit(expected, dots[:, 0], 1), np.polyfit(np.sort(residuals), dots[:, 1], 1)
    np.testing.assert_allclose(np.polyval(across, expected), dots[:, 0], atol=0.1)
    np.testing.assert_allclose(np.polyval(up, np.sort(residuals)), dots[:, 1], atol=0.1)


def test_paper_is_short_and_has_the_worst(report, browser) -> None:
    browser.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    paper = browser.execute_script("return document.getElementById('paper').textContent")
    assert browser.execute_script("return page.content.verdict.text") in paper
    size = browser.execute_script("return page.tables.get('observations').size")
    rows = browser.execute_script("return document.querySelectorAll('#paper .two tbody tr').length")
    assert rows == min(size, 400)
    assert browser.execute_script("return document.querySelectorAll('#paper .drawing path').length") > 3
    pdf = browser.execute_cdp_cmd("Page.printToPDF", {"preferCSSPageSize": True})["data"]
    pages = base64.b64decode(pdf).count(b"/Type /Page\n")
    assert 2 <= pages <= (4 if report.stem == "demo" else 9)
    browser.execute_script("window.dispatchEvent(new Event('afterprint'))")
    assert browser.execute_script("return document.getElementById('paper').children.length") == 0


@pytest.mark.slow
def test_ten_thousand_points(pages, browser, violations) -> None:
    """Each check finds the page as the one before it has left it; nothing is logged from first to last."""
    report = pages("large")
    for check in (
        partial(test_a_phone_shows_it_without_sideways_scrolling, violations=violations),  # it opens the page
        test_filters_keep_what_they_say,
        test_rows_sort_by_any_column,
        test_real_clicks_and_wheels_move_and_pick,
        test_one_selection_goes_through_the_page,
        test_types_are_switched_on_the_plan,
        test_nothing_is_logged_and_nothing_is_asked_of_a_network,
    ):
        check(report, browser)
    assert violations("large") == []
