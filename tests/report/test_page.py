import base64
import gzip
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from msgspec import structs

from obseq.records.shown_units import ShownUnits
from obseq.report.page import adjustment_page, document, page
from obseq.report.part import MOST
from obseq.report.said import length, name, small
from obseq.report.said import plain as said
from obseq.report.tables.packed import packed
from obseq.report.tables.units import Units
from obseq.survey import Network

VOID = {"meta"}


class Checker(HTMLParser):
    """Notes elements that are not closed in order, and everything the page would load."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loaded: list[str] = []

    def handle_starttag(self, tag, attrs) -> None:
        self.loaded += [value for name, value in attrs if name in ("src", "href") and value[:1] != "#"]
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


def finding(text: str, title: str) -> dict:
    return next(item for found in content(text)["lists"] for item in found["items"] if item["title"] == title)


def card(text: str, label: str) -> dict:
    return next(item for item in content(text)["cards"] if item["label"] == label)


def test_the_page_is_well_formed_and_asks_for_nothing(record) -> None:
    text = checked(page(record))
    assert "default-src 'none'" in text
    assert not re.search(r"https?://(?!www\.w3\.org/)", text)


def test_the_frame_of_a_page_is_small(record) -> None:
    """Script and styles as they are read, without data; nothing is loaded beside them."""
    text = page(record)
    data = re.search(r'<script type="application/json" id="content">(.*?)</script>', text)[1]
    assert len(text.encode()) - len(data.encode()) < 110_000


def test_sigma0_stands_beside_what_is_expected_of_it(record) -> None:
    found = card(page(record), "sigma0")
    assert (found["value"], found["tag"]) == ("1.25", ["ok", "as expected"])
    assert (found["figure"]["lower"], found["figure"]["upper"]) == (0.348, 1.669)
    observations = table(page(record), "observations")
    assert observations["order"] == "w"
    assert values(observations, "residual") == pytest.approx(
        [row.residual for row in record.observations], rel=1e-4
    )


def test_the_verdict_has_the_level_of_what_decides(plain, make) -> None:
    def level(**changes) -> tuple[str, str]:
        found = content(page(make(**changes)))["verdict"]
        return found["level"], found["text"]

    assert level()[0] == "ok"
    assert level(converged=False)[0] == "bad"
    test = plain["global_test"] | {"sigma0": 2.0, "passed": False}
    assert level(global_test=test) == (
        "warn",
        "The residuals are too large for their sigmas: sigma0 is 2, 0.35 to 1.67 is expected.",
    )
    accused = {
        "code": "S100",
        "what": "Hz A -> C (site.obs:2)",
        "text": "is wrong",
        "test": 49.0,
        "limit": 9.0,
    }
    accused |= {"observations": [{"file": "site.obs", "line": 2, "row": 1}], "size": [0.5], "sigma": [0.1]}
    found = {"status": "explained", "left": 1.0, "redundancy": 3, "accused": [accused], "reason": ""}
    assert (
        level(diagnosis=found)[1] == "Not usable yet: 1 observation looks wrong. Check it, then adjust again."
    )
    assert level(diagnosis=found | {"accused": [], "status": "undecided"})[0] == "bad"


def test_suspected_errors_lead_to_their_rows_and_spoil_no_precision(plain, make) -> None:
    accused = {
        "code": "S100",
        "what": "Hz A -> C (site.obs:2)",
        "text": "is wrong",
        "test": 49.0,
        "limit": 9.0,
    }
    accused |= {"observations": [{"file": "site.obs", "line": 2, "row": 1}], "size": [0.5], "sigma": [0.1]}
    found = {"status": "explained", "left": 1.0, "redundancy": 3, "accused": [accused], "reason": ""}
    record = make(diagnosis=found, precision="a posteriori")
    text = page(record)
    item = finding(text, "Hz A \u2192 C")
    assert (item["to"], item["size"], item["where"]) == (
        {"table": "observations", "row": 1},
        "off by 5.0 \u03c3",
        "site.obs:2",
    )
    assert content(text)["first"] == {"table": "observations", "row": 1}
    assert values(table(text, "points"), "frame sx") == pytest.approx(
        [point.sx / 1.25 for point in record.points], rel=1e-4
    )
    assert "given sigmas" in table(text, "points")["about"]
    quiet = page(make(precision="a posteriori"))
    assert values(table(quiet, "points"), "frame sx") == [point.sx for point in record.points]


def test_tables_hold_metres_and_radians_of_the_record(record) -> None:
    found = table(page(record), "observations")
    assert found["angular"] == [0, 1, 1, 0]
    assert found["unused"] == [0, 0, 0, 1]
    assert values(found, "observed") == pytest.approx([row.value for row in record.observations], abs=1e-5)
    adjusted = [row.adjusted for row in record.observations]
    assert values(found, "adjusted") == pytest.approx(adjusted, abs=1e-5)
    points = table(page(record), "points")
    assert values(points, "frame x") == [point.x for point in record.points]
    assert values(points, "x") == [point.crs_x for point in record.points]


def test_known_points_stations_and_others_are_told_apart(plain, make) -> None:
    plain["points"][0]["known"] = "xyZ"
    text = page(make())
    assert content(text)["plan"]["marks"] == [3, 0, 0]
    kinds = next(column for column in table(text, "points")["columns"] if column["title"] == "kind")
    assert [kinds["choices"][k] for k in kinds["values"]] == ["known xyZ", "point", "point"]


def test_what_nothing_determines_is_on_the_plan(make) -> None:
    lost = {"what": "point T", "name": "T", "reason": "one sight", "observations": [], "place": [5, 6, 7]}
    text = page(make(left_out=[lost]))
    plan = content(text)["plan"]
    assert content(text)["names"][3] == "T"
    assert (plan["x"][3], plan["y"][3], plan["marks"][3]) == (650005.0, 6860006.0, 4)  # on the map
    assert finding(text, "point T is left out")["text"] == "one sight"
    assert (
        content(text)["verdict"]["text"] == "Usable, but 1 point or station is not determined and left out."
    )


def test_long_columns_are_bytes_that_give_their_numbers_back() -> None:
    chance = np.random.default_rng(3)
    lengths = [*chance.normal(0.0, 1e6, 500).tolist(), None]
    for values_, quantity, kind, size in (
        (lengths, "length", "f8", 8),
        (lengths, "small", "f4", 4),
        ([*chance.integers(0, 9, 500).tolist(), None], "choice", "i4", 4),
    ):
        found = packed(values_, quantity)
        raw = gzip.decompress(base64.b64decode(found["bytes"]))
        straight = np.frombuffer(raw, np.uint8).reshape(size, -1).T.tobytes()
        back = np.frombuffer(straight, f"<{kind}")
        assert found["type"] == kind
        assert back[-1] == -1 if kind == "i4" else np.isnan(back[-1])
        assert back[:-1] == pytest.approx(np.array(values_[:-1]), rel=1e-7 if kind == "f4" else 0.0)
    assert packed(lengths[:10], "length") == lengths[:10]


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


def test_its_provenance_says_what_it_was_made_from(make) -> None:
    operation = {"system": "IGNF:LAMB93", "description": "Inverse of Lambert", "accuracy": 0.5}
    head = {"title": "Dam, May", "files": ["a.obs", "b.cor"], "refraction": 0.13, "operations": [operation]}
    text = page(make(**head, warnings=["w < 1"]))
    assert "<title>Dam, May</title>" in text
    (provenance,) = (part for part in content(text)["sections"] if part["key"] == "provenance")
    facts = [tuple(fact) for fact in provenance["facts"]]
    for fact in (
        ("files", "a.obs, b.cor"),
        ("refraction", "coefficient 0.13"),
        ("operation", "IGNF:LAMB93 to WGS 84 by PROJ: Inverse of Lambert (accuracy 0.5 m)"),
    ):
        assert fact in facts
    assert finding(text, "Warning")["text"] == "w < 1"


def test_an_empty_network_has_a_page(make) -> None:
    text = checked(page(make(points=[], observations=[], stations=[])))
    assert content(text)["plan"] is None


def test_numbers_in_sentences_are_written_in_any_units() -> None:
    sentence = f"off by {small(0.0123)} and {small(1e-5, 'rad')} at {length(12.5)}"
    assert said(sentence, Units(ShownUnits())) == "off by 12.30 mm and 0.637 mgon at 12.5000 m"
    assert said(sentence, Units(ShownUnits("ft", "dms"))) == "off by 0.04035 ft and 2.06 sec at 41.0105 ft"
    assert said(name("{{length|1|}}"), Units(ShownUnits())) == "{ {length|1|}}"


def test_a_large_network_has_its_worst_and_weakest_observations(plain, make) -> None:
    """What the page leaves out is said; what is accused is never left out, and leads to its row."""
    (row,) = [row for row in plain["observations"] if row["line"] == 1]
    count = MOST + 1000
    rows = [
        row | {"line": k + 1, "residual": 1e-6 * k, "normalised_residual": 1e-3 * k} for k in range(count)
    ]
    accused = {
        "code": "S100",
        "what": "Dist A -> B (site.obs:4)",
        "text": "is wrong",
        "test": 49.0,
        "limit": 9.0,
    }
    accused |= {"observations": [{"file": "site.obs", "line": 4, "row": 3}], "size": [0.5], "sigma": [0.1]}
    found = {"status": "explained", "left": 1.0, "redundancy": 3, "accused": [accused], "reason": ""}
    text = page(make(observations=rows, n_observations=count, diagnosis=found))
    observations = table(text, "observations")
    assert observations["size"] == MOST
    assert f"{MOST} of {count} observations" in observations["about"]
    raw = next(column for column in observations["columns"] if column["title"] == "line")["values"]["bytes"]
    shuffled = np.frombuffer(gzip.decompress(base64.b64decode(raw)), np.uint8)
    lines = np.frombuffer(shuffled.reshape(8, -1).T.tobytes(), "<f8")
    assert lines[content(text)["first"]["row"]] == 4
    assert {1, 2, 3} & set(lines) == set()
    assert count in lines


def test_a_page_without_data_is_small(record) -> None:
    empty = structs.replace(adjustment_page(record), tables=[], plan=None, lists=(), cards=(), sections=())
    assert len(document(empty).encode()) < 95_000  # the design's budget
