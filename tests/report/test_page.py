import json
import re
from html.parser import HTMLParser

import pytest

from obseq.report import page
from obseq.survey import Network

VOID = {"meta", "input"}


class Checker(HTMLParser):
    """Notes elements that are not closed in order, and everything the page would load."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loaded: list[str] = []

    def handle_starttag(self, tag, attrs) -> None:
        self.loaded += [value for name, value in attrs if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag) -> None:
        assert self.open.pop() == tag


def checked(text: str) -> str:
    checker = Checker()
    checker.feed(text)
    checker.close()
    assert checker.open == []
    assert checker.loaded == []
    return text


def content(text: str) -> dict:
    """What the page holds for its script."""
    return json.loads(re.search(r'<script type="application/json" id="content">(.*?)</script>', text)[1])


def table(text: str, name: str) -> dict:
    return next(table for table in content(text)["tables"] if table["id"] == name)


def values(found: dict, title: str) -> list:
    return next(column["values"] for column in found["columns"] if column["title"] == title)


def test_the_page_is_well_formed_and_asks_for_nothing(record) -> None:
    text = checked(page(record))
    assert "default-src 'none'" in text
    assert not re.search(r"https?://(?!www\.w3\.org/)", text)


def test_it_shows_the_fit_and_sorts_by_the_worst_residual(record) -> None:
    text = page(record)
    assert "1.25; chi-square test at 95 %: 1.25; between 0.348 and 1.669 is expected: accepted" in text
    found = table(text, "observations")
    column, sign = found["sort"]
    assert (found["columns"][column]["title"], sign) == ("normalised", -1)
    assert values(found, "residual") == pytest.approx([row.residual for row in record.observations], rel=1e-4)


def test_tables_hold_metres_and_radians_of_the_record(record) -> None:
    found = table(page(record), "observations")
    assert found["angular"] == [0, 1, 1, 0]
    assert found["unused"] == [0, 0, 0, 1]
    assert values(found, "observed") == pytest.approx([row.value for row in record.observations], abs=1e-5)
    adjusted = [row.adjusted for row in record.observations]
    assert values(found, "adjusted") == pytest.approx(adjusted, abs=1e-5)
    points = table(page(record), "points")
    assert values(points, "x") == [point.x for point in record.points]
    assert values(points, "sx") == [point.sx for point in record.points]


def test_known_points_stations_and_others_are_told_apart(plain, make) -> None:
    plain["points"][0]["known"] = "xyZ"
    text = page(make())
    assert content(text)["plan"]["marks"] == [3, 0, 0]
    classes = next(column for column in table(text, "points")["columns"] if column["title"] == "class")
    assert [classes["choices"][k] for k in classes["values"]] == ["known xyZ, station", "free", "free"]


def test_what_nothing_determines_is_on_the_plan(make) -> None:
    lost = {"what": "point T", "name": "T", "reason": "one sight", "observations": [], "place": [5, 6, 7]}
    text = page(make(left_out=[lost]))
    plan = content(text)["plan"]
    assert content(text)["names"][3] == "T"
    assert (plan["x"][3], plan["y"][3], plan["marks"][3]) == (5, 6, 4)
    assert "LEFT OUT, because nothing determines them: point T" in text


def test_a_sight_to_a_point_without_a_place_is_a_ray(tmp_path) -> None:
    """East is at 0 of the circle of A: a direction of 350 gon leads to the north-east, where X must be."""
    known = "".join(
        f"1 {name} {x} {y} 0 0.001\n" for name, x, y in (("A", 0, 0), ("B", 100, 0), ("C", 0, 100))
    )
    (tmp_path / "a.cor").write_text(f"{known}0 D 90 90 0\n", encoding="utf-8")
    sights = ["7 A B 0 0.001", "5 A C 300 0.001", "5 A X 350 0.001", "3 A Y 20 0.01", "6 A D 100 0.001"]
    sights += [f"3 {name} D {length} 0.002" for name, length in (("A", 127.28), ("B", 90.55), ("C", 90.55))]
    (tmp_path / "a.obs").write_text("\n".join(sights) + "\n", encoding="utf-8")
    record = Network.read(tmp_path / "a.obs", tmp_path / "a.cor", frame="Local").adjust().record()
    plan = content(page(record))["plan"]
    assert plan["unplaced"] == ["X", "Y"]
    ((station, east, north, name),) = plan["rays"]
    assert (record.points[station].name, name) == ("A", "X")
    assert (east, north) == pytest.approx((0.5**0.5, 0.5**0.5), abs=1e-5)


def test_names_are_escaped(plain, make) -> None:
    plain["points"][0]["name"] = "</script><b>&$x"
    text = checked(page(make()))
    assert content(text)["names"][0] == "</script><b>&$x"
    assert "<b>" not in text


def test_its_head_says_what_it_was_made_from(make) -> None:
    operation = {"system": "IGNF:LAMB93", "description": "Inverse of Lambert", "accuracy": 0.5}
    head = {"title": "Dam, May", "files": ["a.obs", "b.cor"], "refraction": 0.13, "operations": [operation]}
    text = page(make(**head))
    assert "<title>Dam, May</title>" in text
    for words in (
        "a.obs, b.cor",
        "coefficient 0.13",
        "IGNF:LAMB93 to WGS 84 by PROJ: Inverse of Lambert (accuracy 0.5 m)",
    ):
        assert words in text


def test_an_empty_network_has_a_page(make) -> None:
    text = checked(page(make(points=[], observations=[], stations=[])))
    assert content(text)["plan"] is None


def test_warnings_are_on_the_page(make) -> None:
    assert "<dt>warning</dt><dd >w &lt; 1</dd>" in page(make(warnings=["w < 1"])).replace(' class=""', " ")
