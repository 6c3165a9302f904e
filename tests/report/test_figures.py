"""Every figure of the page is in the result file: each column of a table is a field of one of its lists."""

import base64
import gzip
import json
import math
import re
from importlib.resources import files

import numpy as np
import pytest

from obseq.report.page import page
from obseq.report.result_file import read_json, to_json
from obseq.survey import Datum, Network, Quality

EVERYTHING = Quality(relative=True, ellipses=0.95, ellipsoids=True, effects=True, inner=True)
SOURCES = {
    "observations": "observations",
    "points": "points",
    "known": "constraints",
    "stations": "stations",
    "by-type": "types",
    "by-station": "setups",
    "ellipsoids": "points",
    "relative": "relative",
    "components": "variance_components",
}
"""The list of the result file behind each table."""


def demo() -> Network:
    data = files("obseq.survey") / "data"
    return Network.read(str(data / "demo.obs"), str(data / "demo.cor"), points_crs="IGNF:LAMB93")


@pytest.fixture(scope="module", params=["everything", "free", "components"])
def both(request, tmp_path_factory, shared_data):
    """The page of a stored result, and the result as it is in the file."""
    if request.param == "everything":
        adjusted = demo().adjust(quality=EVERYTHING)
    elif request.param == "free":
        adjusted = demo().adjust(quality=Quality(ellipses=0.9), datum=Datum("inner"))
    else:
        modane = Network.read_project(shared_data / "comp3d-modane" / "project.comp")
        adjusted = modane.adjust(quality=Quality(variance_components=True))
    record = adjusted.record("a title")
    path = tmp_path_factory.mktemp("figures") / "result.json"
    path.write_text(to_json(record), encoding="utf-8")
    assert page(read_json(path)) == page(record)  # to the byte
    return page(record), json.loads(path.read_text(encoding="utf-8"))


def content_of(text: str) -> dict:
    found = re.search(r'<script type="application/json" id="content">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    content: dict = json.loads(found[1])
    for table in content["tables"]:
        for column in table["columns"]:
            column["values"] = unpacked(column["values"])
    return content


def unpacked(values: list | dict) -> list:
    """What a long column holds."""
    if isinstance(values, list):
        return values
    size = int(values["type"][1])
    raw = np.frombuffer(gzip.decompress(base64.b64decode(values["bytes"])), np.uint8)
    numbers = np.frombuffer(raw.reshape(size, -1).T.tobytes(), f"<{values['type']}").tolist()
    is_whole = values["type"] == "i4"
    return [None if math.isnan(value) or (is_whole and value < 0) else value for value in numbers]


def flat(value, path="") -> dict[str, object]:
    """The numbers and texts inside a plain value, by their paths."""
    if isinstance(value, dict):
        return {k: v for key, item in value.items() for k, v in flat(item, f"{path}.{key}").items()}
    if isinstance(value, list):
        return {k: v for key, item in enumerate(value) for k, v in flat(item, f"{path}.{key}").items()}
    return {path: value}


def fields_of(rows: list) -> dict[str, list]:
    """The fields of the rows of a list of the file, each as a column."""
    each = [flat(row) for row in rows]
    return {path: [row.get(path) for row in each] for path in {key for row in each for key in row}}


def places_of(table: dict, column: dict) -> list[float]:
    """Rounding of each value of a column on the page: of lengths 5e-6 m, of angles 5e-10."""
    lengths = {"length": 5.1e-6}.get(column["quantity"], 5.1e-10)
    if column["quantity"] == "observed":
        return [5.1e-10 if angular else 5.1e-6 for angular in table["angular"]]
    return [lengths] * len(column["values"])


def is_same(shown: list, places: list[float], stored: list) -> bool:
    """Whether a column shows a field, to the digits that the page keeps; angles of circles within a turn."""
    if len(shown) != len(stored):
        return False
    for mine, place, theirs in zip(shown, places, stored, strict=True):
        if (mine is None) != (theirs is None) or isinstance(theirs, str | bool):
            return False
        if mine is not None and not (
            math.isclose(mine, theirs, rel_tol=0.0, abs_tol=place)
            or (place < 1e-6 and math.isclose(mine, theirs, rel_tol=5.1e-5))
            or (place < 1e-6 and math.isclose(mine, theirs % math.tau, rel_tol=0.0, abs_tol=place))
        ):
            return False
    return True


def test_each_column_is_a_field_of_the_file(both) -> None:
    text, stored = both
    compared = 0
    for table in content_of(text)["tables"]:
        if table["id"] == "undetermined":
            continue
        fields = fields_of(stored[SOURCES[table["id"]]])
        if table["id"] == "relative":
            both_ways = zip(fields[".precision"], fields[".distance"], strict=True)
            fields["ppm"] = [1e6 * precision / distance for precision, distance in both_ways]
        for column in table["columns"]:
            if column["quantity"] in ("text", "choice", "point") or column["key"] == "observations":
                continue
            places = places_of(table, column)
            assert any(is_same(column["values"], places, field) for field in fields.values()), (
                f"{table['id']}: {column['title']} is no field of the file"
            )
            compared += len(column["values"])
    assert compared > 200


def test_motions_and_iterations_are_those_of_the_file(both) -> None:
    text, stored = both
    content = content_of(text)
    (charts,) = (part["charts"] for part in content["sections"] if part["key"] == "quality")
    (steps,) = (chart["iterations"] for chart in charts if chart["kind"] == "convergence")
    assert [[row["sigma0"], row["step"]] for row in steps] == [
        [row["sigma0"], row["max_step"]] for row in stored["iterations"]
    ]
    tables = {table["id"]: table for table in content["tables"]}
    motions = stored.get("undetermined") or []
    assert ("undetermined" in tables) == bool(motions)
    if motions:
        along = [column["values"] for column in tables["undetermined"]["columns"][-3:]]
        moves = [move for motion in motions for move in motion["moves"]]
        assert [list(row) for row in zip(*along, strict=True)] == moves


def test_the_plan_is_that_of_the_file(both) -> None:
    text, stored = both
    plan, points = content_of(text)["plan"], stored["points"]
    for axis in "xy":
        assert plan[axis] == pytest.approx([point[f"crs_{axis}"] for point in points], abs=1e-4)
    cos, sin = plan["turn"]
    for mine, field in (("major", "semi_major"), ("minor", "semi_minor"), ("bearing", "bearing")):
        turn = math.atan2(sin, cos) if mine == "bearing" else 0.0
        wanted = [point["ellipse"][field] - turn for point in points]
        assert plan[mine] == pytest.approx(wanted, rel=1e-3, abs=1e-4)
    moved = [point.get("moved") for point in points]
    np.testing.assert_allclose(
        [shift for shift in plan["moved"] or [] if shift],
        [(cos * x - sin * y, sin * x + cos * y) for x, y, _ in filter(None, moved)] if plan["moved"] else [],
        atol=1e-5,
    )
