"""The page of a free network in a browser: the motions that no observation sees are drawn, and switched."""

from importlib.resources import files

import browsing
import pytest

from obseq.report.page import page
from obseq.survey import Datum, Network


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


SHIFT = (
    "const { sights } = page.plan; const [isForward, sense] = arguments;"
    "const own = [...sights.types.keys()].find((k) => sights[sense].has(k));"
    "const kept = [sights.residual, sights.typeOf];"
    "Object.assign(sights, { residual: { values: [0.01] }, typeOf: [own] });"
    "const pair = { a: 0, b: 1, rows: [0], isForward: [isForward] };"
    "const found = sights.shift(pair, [0, 0], [0, 100]);"
    "Object.assign(sights, { residual: kept[0], typeOf: kept[1] }); return found"
)
"""The residual of 0.01 of one observation between a point and another, 100 m to the north of it."""


@pytest.mark.parametrize(
    ("is_forward", "sense", "expected"),
    [
        (True, "aside", (1.0, 0.0)),  # a sight to the north turns to the east
        (False, "aside", (-1.0, 0.0)),  # one to the south to the west
        (True, "ahead", (0.0, 0.01)),
        (False, "ahead", (0.0, -0.01)),
    ],
)
def test_residuals_lie_as_their_observations_do(tmp_path, browser, is_forward, sense, expected) -> None:
    """Computed minus observed: directions count clockwise, distances from where they are observed."""
    path = tmp_path / "demo.html"
    path.write_text(page(demo().adjust().record()), encoding="utf-8")
    browsing.opened(browser, path)
    assert browser.execute_script(SHIFT, is_forward, sense) == pytest.approx(expected)
