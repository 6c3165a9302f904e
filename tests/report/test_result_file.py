import json
import math

import pytest
from msgspec.structs import replace

from obseq.errors import InputError
from obseq.report.result_file import read_json, to_json


def test_numbers_are_exact_and_come_back(record, plain, tmp_path) -> None:
    (tmp_path / "a.json").write_text(to_json(record), encoding="utf-8")
    read = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert {key: read[key] for key in plain} == plain
    assert read_json(tmp_path / "a.json") == record


def test_one_line_per_point_and_observation(record) -> None:
    lines = to_json(record).splitlines()
    assert sum('"crs_x"' in line for line in lines) == 3
    assert sum('"normalised_residual"' in line for line in lines) == 4


def test_what_json_cannot_write_is_null(record) -> None:
    read = json.loads(to_json(replace(record, sigma0=math.inf, variance_factor=math.nan)))
    assert (read["sigma0"], read["variance_factor"]) == (None, None)


def test_a_variance_factor_that_is_not_defined_is_null_and_may_be_missing(record, tmp_path) -> None:
    unknown = replace(record, variance_factor=None)
    text = to_json(unknown)
    assert '"variance_factor": null' in text
    for written in (text, text.replace('"variance_factor": null,', "")):
        (tmp_path / "a.json").write_text(written, encoding="utf-8")
        assert read_json(tmp_path / "a.json") == unknown


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("a\x1b[2Jb", "a\\u001b[2Jb"),
        ("c\x9bd", "c\\u009bd"),
        ("\u202eright", "\\u202eright"),
        ("e\x7f", "e\\u007f"),
    ],
)
def test_what_a_terminal_would_obey_is_escaped_and_comes_back(name, written, plain, make) -> None:
    plain["points"][0]["name"] = name
    text = to_json(make())
    assert written in text
    assert name not in text
    assert json.loads(text)["points"][0]["name"] == name


WRONG = {
    "[]": "not the result of an adjustment",
    "{": "not a result file",
    '{"format": "obseq-derivative-checks"}': "not the result of an adjustment",
    '{"format": "obseq-adjustment", "version": 2}': "another version",
    '{"format": "obseq-adjustment", "version": 1}': "missing required field `n_observations`",
    "[" * 100_000: "not a result file",
    '{"sigma0": NaN}': "NaN is not a finite number",
}


@pytest.mark.parametrize("text", WRONG, ids=lambda text: text[:50])
def test_what_is_no_result_is_refused(text, tmp_path) -> None:
    (tmp_path / "a.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=WRONG[text]):
        read_json(tmp_path / "a.json")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"redundancy": 1.5}, "redundancy: Expected `int`"),
        ({"converged": 1}, "converged: Expected `bool`"),
        ({"points": {}}, "points: Expected `array`"),
        ({"points": [3]}, r"points\[0\]: Expected `object`"),
        (
            {"iterations": [{"sigma0": 1.0, "max_step": "x"}]},
            r"iterations\[0\].max_step: Expected `float",
        ),
        ({"frame": None}, "frame: Expected `str`"),
        (
            {"run": {"identifier": "a", "created": "b", "versions": {"obseq": 1}}},
            r"run.versions\[...\]: Expected `str`",
        ),
    ],
)
def test_a_wrong_value_is_named(change, message, make) -> None:
    with pytest.raises(InputError, match=message):
        make(**change)


def test_fields_of_later_versions_are_left_aside(make, record) -> None:
    assert make(added_later=[1, 2]) == record


def test_names_keep_their_letters(plain, make) -> None:
    plain["points"][0]["name"] = "Clocher Saint-Étienne"
    assert "Clocher Saint-Étienne" in to_json(make())


def test_an_empty_list_is_valid(make) -> None:
    assert json.loads(to_json(make(stations=[])))["stations"] == []


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (
            '"n_unknowns": ',
            '"n_unknowns": 1, "n_unknowns": ',
            'the key "n_unknowns" comes twice in one object',
        ),
        ('"converged": true', '"converged": true, "sigma0": 1e999', "1e999 is not a finite number"),
        ('"name":"B"', '"name":"A"', "point A comes twice"),
    ],
)
def test_no_value_takes_the_place_of_another(before, after, said, record, tmp_path) -> None:
    text = to_json(record)
    assert before in text
    (tmp_path / "a.json").write_text(text.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(InputError, match=said):
        read_json(tmp_path / "a.json")
