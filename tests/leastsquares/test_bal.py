"""A bundle adjustment of 21 cameras and 11,315 eliminated points, against Ceres."""

import json

import pytest
from bal import bundle, read_problem


@pytest.mark.slow
def test_trafalgar_reaches_the_cost_of_ceres(shared_data):
    folder = shared_data / "bal-trafalgar-21"
    expected = json.loads((folder / "expected.json").read_text())
    problem = read_problem(folder / "problem-21-11315-pre.txt")
    system = bundle(problem)
    assert system.n_unknowns == expected["parameters"]
    assert system.n_observations == expected["residuals"]
    result = system.solve(strategy="levenberg-marquardt", max_iterations=50)
    assert result.converged
    assert result.iterations[0].cost / 2 == pytest.approx(expected["initial_cost"], rel=1e-10)
    assert result.cost / 2 == pytest.approx(expected["final_cost"], rel=1e-8)
