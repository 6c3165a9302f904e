"""The page of a large network: the worst of each list, counted; the plan says where the others are."""

import json
import re

import pytest

from obseq.report import part
from obseq.report.page import adjustment_page, page


@pytest.fixture
def large(monkeypatch, plain, make):
    """Forty points on a line, each observed from the first; the page shows twelve of a list."""
    monkeypatch.setattr(part, "MOST", 12)
    (one,), (point,) = plain["observations"][:1], plain["points"][:1]
    names = [f"P{k}" for k in range(40)]
    spread = {"ellipse": {"semi_major": 0.001, "semi_minor": 0.001, "bearing": 0.0}}
    points = [
        point | spread | {"name": name, "x": 10.0 * k, "y": 0.0, "known": ""} for k, name in enumerate(names)
    ]
    points[7] |= {"ellipse": spread["ellipse"] | {"semi_major": 0.5}}
    rows = [
        one | {"from": "P0", "to": name, "line": k, "normalised_residual": 0.01 * k}
        for k, name in enumerate(names)
    ]
    rows[5]["normalised_residual"] = -9.0
    stations = [{"origin": name, "orientation": "#VERT", "g0": 0.0} for name in names]
    return make(points=points, observations=rows, stations=stations, n_observations=40)


def columns(found, name):
    table = next(item for item in found.tables if item["id"] == name)
    return table, {item["title"]: item["values"] for item in table["columns"]}


def test_the_worst_are_shown_and_counted(large) -> None:
    found = adjustment_page(large)
    table, shown = columns(found, "observations")
    assert shown["line"] == [5, *range(29, 40)]
    assert table["about"].startswith(
        "The worst and the weakest 12 of 40 observations; the result file has all."
    )
    points, shown = columns(found, "points")
    names = [found.names[k] for k in shown["point"]]
    assert "P7" in names and len(names) == 12 and "12 of 40 points" in points["about"]
    assert shown["observations"][names.index("P0")] == 40  # of all, not of those that are shown
    assert len(columns(found, "stations")[1]["station"]) == 12
    (told,) = [item for part in found.lists for item in part.items if item.title.startswith("A part")]
    assert "12 of 40 observations, 12 of 40 points, 12 of 40 stations" in told.text


def test_cards_speak_of_all_and_lead_to_rows_of_the_page(large) -> None:
    found = adjustment_page(large)
    (card,) = [card for card in found.cards if card.label.startswith("largest")]
    assert card.value == "9.00"
    assert columns(found, "observations")[1]["line"][card.to.row] == 5
    (weakest,) = [card for card in found.cards if card.label == "weakest point"]
    assert found.names[weakest.to.point] == "P7"


def test_the_plan_says_where_all_points_are(large) -> None:
    density = adjustment_page(large).plan["density"]
    assert sum(count for *_, count in density["cells"]) == 40
    assert density["step"] == pytest.approx(390.0 / part.CELLS)
    content = re.search(r'<script id="content"[^>]*>(.*?)</script>', page(large), re.DOTALL)
    assert content is None or json.loads(content[1])["plan"]["density"] == density


def test_a_small_network_is_shown_whole(record) -> None:
    found = adjustment_page(record)
    assert "density" not in found.plan
    assert not [item for part in found.lists for item in part.items if item.title.startswith("A part")]
