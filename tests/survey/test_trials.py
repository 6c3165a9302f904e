"""How much of a network is unexplained, before causes are tried and with them."""

import importlib
from pathlib import Path

import numpy as np
import pytest

from obseq.survey.screening.robust import estimate
from obseq.survey.screening.trials import Trials

TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"


@pytest.fixture
def planted(monkeypatch):
    """The bench that plants gross errors in random networks."""
    monkeypatch.syspath_prepend(TOOLS)
    return importlib.import_module("bench_gross_errors")


def of_network(network):
    """The trials of a network as it is."""
    work = network.fieldwork
    model = work.model()
    return Trials(model, estimate(model, work.points, work.book))


def with_mistake(planted, tmp_path, mistake, seed=1):
    random = np.random.default_rng(seed)
    site = planted.made_site(random)
    getattr(planted, mistake)(site, random)
    return of_network(site.read(tmp_path))


def test_contradictions_and_what_is_lost_make_the_disagreement(planted, tmp_path):
    tried = with_mistake(planted, tmp_path, "one_digit")
    found = tried.found
    assert found.disagreement(10.0) == pytest.approx(found.contradictions(10.0).sum())
    found.misfits[0] = np.nan
    assert found.contradictions(10.0)[0] == 0.0
    assert found.disagreement(10.0) == pytest.approx(found.contradictions(10.0).sum() + 1.0)
