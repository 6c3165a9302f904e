"""Random levelling and mixed networks from 10 m to 100 km converge, without false alarms."""

import importlib
from pathlib import Path

import pytest

from obseq.survey import Network

TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"


@pytest.mark.parametrize(("kind", "most"), [("levelling", 4), ("mixed", 8)])
def test_random_networks_converge(monkeypatch, kind, most):
    monkeypatch.syspath_prepend(TOOLS)
    result = importlib.import_module("bench_random_networks").outcome(kind, range(15))
    assert result.said == {}
    assert sum(result.iterations.values()) == 15
    assert max(result.iterations) <= most


@pytest.mark.parametrize(
    ("case", "files"),
    [
        ("trilateration", ("t.obs", "t.cor")),
        ("centring-zero", ("centring.obs", "centring.cor")),
        ("centring-zero", ("reverse.obs", "centring.cor")),
    ],
)
def test_field_cases_are_placed_and_adjusted(shared_data, case, files):
    paths = [shared_data / "field-cases" / case / name for name in files]
    adjustment = Network.read(*paths, frame="RTL*2.4*48.8*0*EPSG:4326").adjust()
    assert adjustment.converged
    assert (adjustment.left_out, adjustment.gross_errors, adjustment.replaced) == ((), (), ())


@pytest.mark.parametrize("frame", ["RTL*657700*6860700*0*IGNF:LAMB93", "RTL"])
def test_the_field_case_of_a_bad_approximation(shared_data, frame):
    folder = shared_data / "field-cases" / "bad-approximation"
    adjustment = Network.read(folder / "demo.obs", folder / "demo.cor", frame, "IGNF:LAMB93").adjust()
    assert [item.name for item in adjustment.replaced] == ["PtB"]
    assert adjustment.sigma0 == pytest.approx(1.76552, abs=5e-6)
