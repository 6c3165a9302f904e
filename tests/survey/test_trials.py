"""What cannot explain a network is not tried, and what explains it is never passed over."""

import importlib
from pathlib import Path

import numpy as np
import pytest

from obseq.survey.screening.groups import _groups
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


@pytest.mark.parametrize("seed", [1, 3])
def test_one_wrong_length_is_put_down_to_no_point_that_neither_sees_nor_is_seen(planted, tmp_path, seed):
    tried = with_mistake(planted, tmp_path, "one_in_millimetres", seed)
    assert tried.found.has_shape
    observations, rows = tried.found.book.observations, tried.found.suspects
    ends = {*observations.from_points[rows].tolist(), *observations.to_points[rows].tolist()}
    groups = list(_groups(tried.found))
    assert groups
    assert {group.origin for group in groups} - {-1} <= ends


def test_where_much_contradicts_the_shape_is_not_known(planted, tmp_path):
    tried = with_mistake(planted, tmp_path, "all_in_degrees")
    assert not tried.found.has_shape


def test_contradictions_and_what_is_lost_make_the_disagreement(planted, tmp_path):
    tried = with_mistake(planted, tmp_path, "one_digit")
    found = tried.found
    assert found.disagreement(10.0) == pytest.approx(found.contradictions(10.0).sum())
    found.misfits[0] = np.nan
    assert found.contradictions(10.0)[0] == 0.0
    assert found.disagreement(10.0) == pytest.approx(found.contradictions(10.0).sum() + 1.0)
