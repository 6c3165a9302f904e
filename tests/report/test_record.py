import json
import math

from obseq.report import to_json


def test_numbers_are_exact(record) -> None:
    assert json.loads(to_json(record)) == record


def test_one_line_per_point_and_observation(record) -> None:
    lines = to_json(record).splitlines()
    assert sum('"crs_x"' in line for line in lines) == 3
    assert sum('"normalised_residual"' in line for line in lines) == 4


def test_what_json_cannot_write_is_null(record) -> None:
    record["sigma0"] = math.inf
    record["points"][0]["sx"] = math.nan
    read = json.loads(to_json(record))
    assert read["sigma0"] is None
    assert read["points"][0]["sx"] is None


def test_names_keep_their_letters(record) -> None:
    record["points"][0]["name"] = "Clocher Saint-Étienne"
    assert "Clocher Saint-Étienne" in to_json(record)


def test_an_empty_list_is_valid(record) -> None:
    assert json.loads(to_json(record | {"stations": []}))["stations"] == []
