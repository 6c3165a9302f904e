"""What cannot explain a network is not tried, and what explains it is never passed over."""

import importlib
from pathlib import Path

import numpy as np
import pytest

from obseq.survey.screening import trials
from obseq.survey.screening.groups import group_cause
from obseq.survey.screening.known_points import known_point_cause
from obseq.survey.screening.robust import estimate
from obseq.survey.screening.trials import Trials

TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"


@pytest.fixture
def planted(monkeypatch):
    """The bench that plants gross errors in random networks."""
    monkeypatch.syspath_prepend(TOOLS)
    return importlib.import_module("bench_gross_errors")


@pytest.fixture
def attempts(monkeypatch):
    """The networks that are computed to try a cause."""
    made = []
    monkeypatch.setattr(trials, "estimate", lambda *arguments: made.append(arguments) or estimate(*arguments))
    return made


def of_network(network):
    """The fieldwork of a network, and the trials of it as it is."""
    work = network.fieldwork
    model = work.model()
    return work, Trials(model, estimate(model, work.points, work.book))


def with_mistake(planted, tmp_path, mistake, seed=1):
    random = np.random.default_rng(seed)
    site = planted.made_site(random)
    getattr(planted, mistake)(site, random)
    return of_network(site.read(tmp_path))


@pytest.mark.parametrize("seed", [1, 2])
def test_one_wrong_observation_is_put_down_to_no_group_and_no_known_point(planted, tmp_path, attempts, seed):
    work, tried = with_mistake(planted, tmp_path, "one_elevation", seed)
    assert tried.found.has_shape
    assert not tried.may_lie_in_known_points
    active = np.flatnonzero(tried.found.book.observations.active)
    assert tried.may_lie_in(active)
    assert not tried.may_lie_in(np.setdiff1d(active, tried.found.suspects)[:20])
    attempts.clear()
    assert group_cause(tried) is None
    assert known_point_cause(tried, work.point_system) is None
    assert not attempts


@pytest.mark.parametrize("seed", [1, 4])
def test_a_wrong_known_point_may_explain_its_network(planted, tmp_path, seed):
    _, tried = with_mistake(planted, tmp_path, "mistyped_coordinate", seed)
    assert tried.found.has_shape
    assert tried.may_lie_in_known_points


def test_where_much_contradicts_nothing_is_ruled_out(planted, tmp_path):
    _, tried = with_mistake(planted, tmp_path, "all_in_degrees")
    assert not tried.found.has_shape
    assert tried.may_lie_in_known_points
    assert tried.may_lie_in(np.arange(3))


def test_contradictions_and_what_is_lost_make_the_disagreement(planted, tmp_path):
    _, tried = with_mistake(planted, tmp_path, "one_digit")
    found = tried.found
    assert found.disagreement(10.0) == pytest.approx(found.contradictions(10.0).sum())
    found.misfits[0] = np.nan
    assert found.contradictions(10.0)[0] == 0.0
    assert found.disagreement(10.0) == pytest.approx(found.contradictions(10.0).sum() + 1.0)
