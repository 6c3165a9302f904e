"""A solution as text, JSON and tables."""

import json

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.geometry import exponential
from obseq.leastsquares import LeastSquares


@pytest.fixture
def solved():
    """The mean of three observations of a number, and a rotation that nothing moves."""
    system = LeastSquares()
    ids = system.add_scalars(["x"], [0.0])
    turn = system.add_rotations(["turn"], exponential([[0.1, 0.2, 0.3]]))
    system.freeze(turn)
    labels = ["first", "second", "third"]
    system.add_linear([np.repeat(ids, 3)], [np.ones((3, 1))], [1.0, 2.0, 6.0], 0.5, labels)
    return system.solve(covariance="all")


def test_summary_says_how_it_ended_and_what_is_worst(solved):
    text = solved.summary()
    # Mean 3; residuals 2, 1, -3 of sigma 0.5; sum of squares 56; sigma0 = sqrt(56 / 2).
    assert "3 observations, 0 constraints, 1 unknowns: redundancy 2" in text
    assert "sigma0 5.2915" in text
    assert text.index("linear third: -6.00 sigma") < text.index("linear first: +4.00 sigma")


def test_columns_have_names_values_and_precisions(solved):
    columns = solved.unknowns()
    rows = dict(zip(columns["name"], columns["value"], strict=True))
    assert rows["x"] == pytest.approx(3.0)
    assert [rows[f"turn.rotation.{axis}"] for axis in "xyz"] == pytest.approx([0.1, 0.2, 0.3])
    # Precision: 0.5 / sqrt(3), times sigma0.
    assert columns["precision"][0] == pytest.approx(0.5 / np.sqrt(3) * np.sqrt(28))
    assert columns["frozen"].tolist() == [False, True, True, True]


def test_json_is_valid_and_complete(solved):
    read = json.loads(solved.to_json())
    assert (read["format"], read["redundancy"], read["converged"]) == ("obseq-least-squares", 2, True)
    assert [row["residual"] for row in read["observations"]] == pytest.approx([2.0, 1.0, -3.0])
    assert read["unknowns"][0]["name"] == "x"


def test_numbers_that_are_not_defined_are_null():
    system = LeastSquares()
    ids = system.add_scalars(["x"], [0.0])
    system.add_prior(ids, [[1.0]], 1.0)
    read = json.loads(system.solve().to_json())
    assert read["sigma0"] is None
    assert read["unknowns"][0]["precision"] is None
    assert read["precision"] == "a priori"


def test_tables_of_packages_that_are_not_there_are_refused(solved):
    with pytest.raises(InputError, match="unknown table package 'excel'"):
        solved.unknowns("excel")
