"""Mistakes of many values are compared by what they leave; sigmas and errors are told by plain numbers."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from obseq.diagnosis.policy import POLICY
from obseq.errors import InputError
from obseq.records.diagnosis import AccusedRecord, PlaceRecord
from obseq.report.tables.units import METRIC
from obseq.survey.causes.cause import Rewritten
from obseq.survey.diagnosing import rewritings
from obseq.survey.diagnosing.odd_sigmas import odd_sigmas
from obseq.survey.diagnosing.snooping import _rejection
from obseq.survey.kinds.registry import codes_where

NONE = np.zeros(0, int)


class Points(dict):
    """Three points, of which a network may have placed some."""

    def __init__(self, names="ABC"):
        self.names, self.index = names, {"A": 0, "B": 1, "C": 2}

    def __len__(self):
        return len(self.names)


class Net:
    """A network that leaves so many contradictions without each mistake; at a glance, and in the end."""

    units = METRIC

    def __init__(self, left, soon=None, active=6, known=2, others=None, names="ABC"):
        self.left, self.at_a_glance, self.others = left, left if soon is None else soon, others or {}
        observations = SimpleNamespace(active=np.arange(10) < active)
        self.given = SimpleNamespace(book=SimpleNamespace(observations=observations), points=Points(names))
        self.known, self.asked = known, []

    def contradictions(self, place):
        left = self.at_a_glance if place == "soon" else self.left
        if left is None:
            raise InputError("no place")
        return left, np.zeros(60, bool), np.zeros(12, bool)

    def soon(self):
        return "soon"

    def robust(self):
        return SimpleNamespace(coordinates=np.arange(9.0).reshape(3, 3))

    def like(self, name):
        self.asked.append(name)
        if name not in self.others:
            raise InputError("no start")
        return self.others[name]


def mistake(name, slip="W100", **about):
    return Rewritten("S200", slip, name, f"{name} is wrong", NONE, NONE, Points(), name, **about)


def best(model, *parts):
    found = model.contradictions("robust")
    return rewritings._best(model, lambda points, book: book, found, parts)


def test_the_mistake_that_leaves_least_is_told_and_what_leaves_as_much_beside_it():
    model = Net(40.0, others={"a": Net(9.0), "b": Net(5.0), "c": Net(5.05), "d": Net(5.2)})
    found = best(model, [mistake(name) for name in "abcd"])
    assert found.rewriting.what == "b" and found.left == 5.0
    assert [one.what for one in found.others] == ["c"]


def test_a_mistake_that_no_slip_explains_must_be_better_by_half_a_contradiction():
    for left, wanted in ((4.6, "a"), (4.4, "b")):
        model = Net(40.0, others={"a": Net(5.0), "b": Net(left)})
        assert best(model, [mistake("a"), mistake("b", slip="")]).rewriting.what == wanted


@pytest.mark.parametrize(("left", "is_told"), [(19.9, True), (20.1, False)])
def test_a_mistake_is_told_where_it_leaves_less_than_half(left, is_told):
    assert (best(Net(40.0, others={"a": Net(left)}), [mistake("a")]) is not None) == is_told
    assert best(Net(40.0), [mistake("a")]) is None and best(Net(40.0)) is None


def test_later_parts_are_tried_only_where_the_first_leave_more_than_noise():
    noise = 72 / POLICY.suspect**2 + POLICY.equal
    for left, wanted in ((noise - 0.01, "a"), (noise + 0.01, "b")):
        model = Net(40.0, others={"a": Net(left), "b": Net(0.0)})
        assert best(model, [mistake("a")], [mistake("b")]).rewriting.what == wanted


def test_what_looks_worse_at_a_glance_than_the_network_as_it_is_is_not_computed():
    model = Net(40.0, soon=30.0, others={"a": Net(1.0, soon=31.0), "b": Net(2.0, soon=29.0)})
    assert best(model, [mistake("a"), mistake("b")]).rewriting.what == "b"
    many = {name: Net(9.0 - 0.5 * k, soon=float(10 + k)) for k, name in enumerate("abcdefg")}
    found = best(Net(40.0, others=many), [mistake(name) for name in reversed("abcdefg")])
    assert found.rewriting.what == "abcdefg"[POLICY.trials - 1]  # of those that look best some are computed


def test_once_nothing_is_left_only_what_looks_as_good_is_computed():
    model = Net(40.0, others={"a": Net(0.5), "b": Net(0.45, soon=2.0), "c": Net(0.4, soon=2.2)})
    found = best(model, [mistake(name) for name in "abc"])
    assert found.rewriting.what == "b"


def test_observations_that_a_mistake_loses_are_contradictions():
    model = Net(40.0, others={"a": Net(5.0, active=4), "b": Net(6.9), "c": Net(6.8, active=8)})
    found = best(model, [mistake("a"), mistake("b"), mistake("c")])
    assert found.rewriting.what == "c" and found.left == 6.8
    assert [one.what for one in found.others] == []
    model = Net(40.0, others={"a": Net(5.0, active=4), "b": Net(6.95)})
    found = best(model, [mistake("a"), mistake("b")])
    assert [found.rewriting.what, *(one.what for one in found.others)] == ["b", "a"] and found.left == 6.95


def test_places_without_a_mistake_add_words_or_say_that_it_is_another():
    model = Net(40.0, others={"a": Net(5.0, names="CA"), "b": Net(6.0)})
    seen = []
    told = mistake("a", told=lambda places: seen.append(places) or "; indeed")
    found = best(model, [told, mistake("b")])
    assert found.rewriting.text == "a is wrong; indeed" and found.given is told
    np.testing.assert_array_equal(seen[0], [[3, 4, 5], [np.nan] * 3, [0, 1, 2]])
    other = mistake("a", told=lambda places: None)
    assert best(model, [other, mistake("b")]).rewriting.what == "b"


def test_feet_are_no_mistake_of_files_in_feet():
    model = Net(40.0, others={"a": Net(5.0), "b": Net(6.0)})
    feet = SimpleNamespace(written=SimpleNamespace(length=SimpleNamespace(factor=1.0 / 0.3048)))
    assert best(model, [mistake("a", slip="W106"), mistake("b")]).rewriting.what == "a"
    model.units = feet
    assert best(model, [mistake("a", slip="W106"), mistake("b")]).rewriting.what == "b"


def sigmas_of(sigmas, residuals, standardised=None, active=None, other=4):
    """Height differences with sigmas and residuals (m), and distances that are all alike."""
    n = len(sigmas)
    rise, length = (codes_where(lambda kind, name=name: kind.name == name)[0] for name in ("DH", "Dist"))
    types = np.array([rise] * n + [length] * other)
    rows = SimpleNamespace(types=types, active=np.ones(n + other, bool))
    if active is not None:
        rows.active[:n] = active
    numbers = None
    if standardised is not None:
        numbers = SimpleNamespace(
            blunder=np.append(-2.0 * np.array(residuals), np.zeros(other)),
            standardised=np.append(standardised, np.zeros(other)),
        )
    adjustment = SimpleNamespace(
        book=SimpleNamespace(observations=rows, label="row {}".format),
        residuals=np.append(residuals, np.zeros(other)),
        sigmas=np.append(sigmas, np.full(other, 5.0)),
        quality=SimpleNamespace(observations=numbers),
    )
    return odd_sigmas(adjustment, METRIC)


ALIKE, QUIET = [0.001, 0.0012, 0.0009, 0.001], [0.0] * 4


def test_a_sigma_that_hides_an_error_or_makes_one_is_told_with_the_usual_one():
    (said,) = sigmas_of([*ALIKE, 0.2], [*QUIET, 0.05])
    assert said.startswith("the sigma of row 4 is 200 times larger than the usual one of DH")
    assert "(1.00 mm)" in said and "hides a misfit of 50.0" in said and "50 times the usual one" in said
    (said,) = sigmas_of([*ALIKE, 1e-5], [*QUIET, 0.002], [*QUIET, -9.0])
    assert "100 times smaller" in said and "lets the tests reject a misfit of -4.00 mm" in said
    assert "4 times the usual one" in said


@pytest.mark.parametrize(
    ("sigmas", "residuals", "standardised"),
    [
        ([*ALIKE, 0.099], [*QUIET, 0.05], None),  # not out of line
        ([*ALIKE, 0.2], [*QUIET, 0.0059], None),  # no error
        ([*ALIKE, 0.2], [*QUIET, 0.05], [*QUIET, 3.1]),  # the tests see it
        ([*ALIKE, 1e-5], [*QUIET, 0.002], [*QUIET, 2.9]),  # they see nothing
        ([*ALIKE, 1e-5], [*QUIET, 0.05], [*QUIET, -9.0]),  # it is an error anyway
        ([*ALIKE, 0.2], [*QUIET, np.nan], None),
        ([*ALIKE[:2], 0.2], [0.0, 0.0, 0.05], None),  # of three nothing is usual
        ([0.001, 0.001, 0.001, 0.1, 0.1, 0.1, 1e-6, 1e-6], [0.0] * 3 + [0.05] * 5, None),  # most are
    ],
)
def test_a_sigma_is_not_told_where_nothing_depends_on_it(sigmas, residuals, standardised):
    assert sigmas_of(sigmas, residuals, standardised) == ()


def test_sigmas_of_observations_that_are_switched_off_are_not_looked_at():
    assert sigmas_of([*ALIKE, 0.2], [*QUIET, 0.05], active=[True] * 4 + [False]) == ()
    assert len(sigmas_of([*ALIKE, 0.2, 1.0], [*QUIET, 0.05, 0.06])) == 2


def rejection(test, limit, size, lines=(3,), sigma=0.002):
    places = tuple(PlaceRecord("a.obs", line, line) for line in lines)
    one = AccusedRecord(
        "S100", "it", places, text="", size=size, sigma=(sigma,) * len(size), unit="m", test=test, limit=limit
    )
    return _rejection(one, POLICY, SimpleNamespace(label="row {}".format))


def test_one_wrong_observation_is_told_by_w_and_its_chance_among_all_tests():
    limit = chi2.isf(1e-4, 1)
    found = rejection(25.0, limit, (0.03,), (3, 8))
    assert found.observation == "row 3" and (found.row, found.companions, found.degrees) == (3, 1, 1)
    assert (
        found.statistic == 5.0 and found.blunder == 0.03 and found.critical is None and found.blunders == ()
    )
    tests = np.log1p(-POLICY.false_alarm) / np.log1p(-1e-4)
    assert found.p_value == pytest.approx(1.0 - (1.0 - chi2.sf(25.0, 1)) ** tests, rel=1e-6)
    assert rejection(limit, limit, (0.03,)).p_value == pytest.approx(POLICY.false_alarm)
    # the bias that is found with the power of the tests: two-sided normal, 80 %
    assert found.detectable == pytest.approx(0.002 * (np.sqrt(limit) + 0.8416), rel=1e-3)


def test_a_wrong_vector_is_told_by_its_squares_and_all_components():
    limit = chi2.isf(1e-4, 3)
    found = rejection(30.0, limit, (0.03, -0.01, 0.02), (3, 4, 5))
    assert found.statistic == 30.0 and found.critical == limit and found.degrees == 3
    assert found.blunders == (0.03, -0.01, 0.02) and found.detectable is None and found.companions == 2
    tests = np.log1p(-POLICY.false_alarm) / np.log1p(-1e-4)
    assert found.p_value == pytest.approx(1.0 - (1.0 - chi2.sf(30.0, 3)) ** tests, rel=1e-6)
