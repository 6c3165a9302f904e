"""The page of a free network in a browser: the motions that no observation sees are drawn, and switched."""

import importlib.util
from importlib.resources import files
from pathlib import Path

import pytest

from obseq.report import page
from obseq.survey import Datum, Network

SPEC = importlib.util.spec_from_file_location("browsing", Path(__file__).with_name("browsing.py"))
browsing = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(browsing)


@pytest.fixture(scope="module")
def browser():
    with browsing.chromium(browsing.BRIEF) as found:
        yield found


def demo() -> Network:
    data = files("obseq.survey") / "data"
    return Network.read(str(data / "demo.obs"), str(data / "demo.cor"), points_crs="IGNF:LAMB93")


def test_what_nothing_determines_is_drawn_and_switched(tmp_path, browser) -> None:
    path = tmp_path / "free.html"
    path.write_text(page(demo().adjust(datum=Datum("inner")).record()), encoding="utf-8")
    browsing.opened(browser, path)
    colours = (
        "const seen = new Set(); const { context } = page.plan; const stroke = context.stroke.bind(context);"
        "context.stroke = (path) => { seen.add(context.strokeStyle); return stroke(path); };"
        "page.plan.paint(new CanvasSheet(context, page.plan.width, page.plan.height));"
        "context.stroke = stroke; return TYPE_COLOURS.map((colour) => seen.has(colour))"
    )
    names = browser.execute_script("return page.plan.motions.names")
    assert any("rotation about z" in name for name in names)
    turn = next(k for k, name in enumerate(names) if "rotation about z" in name)
    assert browser.execute_script(colours)[: len(names)] == [k == turn for k in range(len(names))]
    box = f"#planbar .menu:nth-of-type(2) label:nth-of-type({turn + 1}) input"
    browser.execute_script("document.querySelector(arguments[0]).click()", box)
    assert not any(browser.execute_script(colours))
    assert browser.get_log("browser") == []
