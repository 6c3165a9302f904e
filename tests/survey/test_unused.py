"""Observations that are switched off have the residuals that the solution gives them, and change nothing."""

import math

import numpy as np
import pytest

from obseq.report.adjusted import outcome
from obseq.report.page import adjustment_page
from obseq.report.summary import Detail, summary
from obseq.survey import Network

PLACES = {"A": (0.0, 0.0, 0.0), "B": (100.0, 0.0, 3.0), "C": (60.0, 80.0, 10.0)}


def network(folder, *lines: str) -> Network:
    """Two known points and a free one, seen from both; and more lines."""
    rows = [f"{int(name in 'AB')} {name} {x} {y} {z} 0.001" for name, (x, y, z) in PLACES.items()]
    (folder / "n.cor").write_text("\n".join([*rows, "1 D 500 500 5 0.001"]) + "\n", encoding="utf-8")
    found = ["7 A B 100 0.001", "5 A C 40.9666 0.001", "3 A C 100.5 0.002", "6 A C 93.657 0.001"]
    found += ["3 B C 89.72 0.002", "4 A C 10.0 0.002", *lines]
    (folder / "n.obs").write_text("\n".join(found) + "\n", encoding="utf-8")
    return Network.read(folder / "n.obs", folder / "n.cor", frame="Local")


OFF = (
    "-3 A C 100.7 0.002",
    "-5 A C 41.5 0.001",
    "-6 A C 93.0 0.001",
    "-4 A C 10.2 0.002",
    "-3 A D 700 0.002",
)


def test_they_are_computed_minus_observed_at_the_solution(tmp_path) -> None:
    found = network(tmp_path, *OFF).adjust()
    place = found.points.coordinates[found.points.names.index("C")]
    distance, direction, zenith, rise, far = found.residuals[6:]
    start = found.points.coordinates[found.points.names.index("A")]
    assert distance == pytest.approx(math.dist(start, place) - 100.7, abs=1e-9)
    assert rise == pytest.approx(place[2] - start[2] - 10.2, abs=1e-6)
    assert far == pytest.approx(math.dist(start, found.points.coordinates[3]) - 700.0, abs=1e-9)
    used = found.residuals[[1, 3]] + np.array([40.9666, 93.657]) * math.pi / 200.0  # the adjusted values
    assert [direction, zenith] == pytest.approx(used - np.array([41.5, 93.0]) * math.pi / 200.0, abs=1e-12)


def test_they_change_nothing(tmp_path) -> None:
    plain, found = network(tmp_path).adjust(), network(tmp_path, *OFF).adjust()
    np.testing.assert_array_equal(plain.points.coordinates, found.points.coordinates)
    assert (plain.sigma0, plain.solution.redundancy) == (found.sigma0, found.solution.redundancy)
    np.testing.assert_array_equal(plain.residuals, found.residuals[:6])


def test_text_and_page_show_them_last_and_apart(tmp_path) -> None:
    record = network(tmp_path, *OFF).adjust().record()
    assert all(row.residual is not None for row in record.observations)
    lines = summary(outcome(record), detail=Detail(shown=("residuals",))).splitlines()
    told = ["  not used  " in line for line in lines if "  yes  " in line or "  not used  " in line]
    assert told[:11] == [False] * 6 + [True] * 5
    (table,) = (item for item in adjustment_page(record).tables if item["id"] == "observations")
    (values,) = (item["values"] for item in table["columns"] if item["key"] == "residual")
    assert None not in values and table["unused"] == [0] * 6 + [1] * 5
    assert not any(
        item.to and item.to.row in range(6, 11)
        for part in adjustment_page(record).lists
        for item in part.items
    )


def test_what_the_solution_knows_nothing_of_has_none(tmp_path) -> None:
    found = network(tmp_path, "-3 A Nowhere 50 0.002", "-5 B C 10 0.001").adjust()
    assert np.isnan(found.residuals[6:]).all()  # no place; no instrument on B was oriented
