"""What is planted is found as often as was measured: a few seeds of each class, against the rates."""

import json
import sys
from pathlib import Path

import pytest
from scipy import stats

TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"
sys.path.insert(0, str(TOOLS))

import bench_diagnosis as bench  # noqa: E402 (a tool, not part of the package)
from diagnosis_verdicts import Fault, Found, Place, has_cause, verdict_of  # noqa: E402

RATES = json.loads((TOOLS / "diagnosis.json").read_text("utf-8"))
SEEDS = 2
"""Of each class at most: others than those of the committed rates, from 1000 on."""
UNLIKELY = 0.01
"""Probability of so few right ones, where the rate is what was measured, below which a class has lost."""


def least(right, count, seeds):
    """The fewest right ones of some seeds that the rate of others explains."""
    return int(stats.binom.ppf(UNLIKELY, seeds, (right + 1) / (count + 2)))


@pytest.mark.slow
@pytest.mark.parametrize("name", bench.CLASSES)
def test_no_class_has_lost(name):
    before, found = RATES[name], bench.rates(name, range(1))
    wanted = least(before["right"], before["count"], SEEDS)
    if found.right < wanted:
        found = bench.rates(name, range(SEEDS))
    assert found.right >= wanted, found.plain()
    assert "crash" in before["verdicts"] or not found.verdicts["crash"], found.said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "seed"),
    [("block: control digit", 71010), ("site: target", 71008), ("block: exchanged images", 1031)],
)
def test_what_no_start_leads_to_is_found_all_the_same(name, seed):
    """A control point behind cameras; a point of two sights, one to another; four images from any poses."""
    found = bench.rates(name, [seed])
    assert found.verdicts == {"exact": 1}, found.plain()


def test_few_right_ones_are_a_loss_only_where_chance_does_not_explain_them():
    assert least(100, 100, 60) == 57
    assert least(50, 100, 60) == 21
    assert least(0, 100, 60) == 0


def placed(*lines, **more):
    return Place(lines=frozenset(("a", line) for line in lines), **more)


def fault(*lines, **more):
    return Fault(lines=frozenset(("a", line) for line in lines), **more)


@pytest.mark.parametrize(
    ("accused", "verdict"),
    [
        ([[1], [2]], "exact"),
        ([[1], [3, 2]], "in a set"),
        ([[1], [3, 4, 5, 2]], "in a large set"),
        ([[1]], "some"),
        ([[1], [2], [3]], "and more"),
        ([[1], [3]], "wrong"),
        ([], "missed"),
    ],
)
def test_verdicts_of_two_wrong_lines(accused, verdict):
    found = Found("explained", tuple(tuple(map(placed, one)) for one in accused))
    assert verdict_of(found, (fault(1), fault(2))) == verdict


def test_a_group_is_named_by_all_its_lines_or_in_part_and_never_by_more():
    circle = fault(3, 4, alike=(frozenset({("a", 1), ("a", 2)}),))
    accused = [Found("explained", ((placed(*lines),),)) for lines in [(3, 4), (1, 2), (3,), (3, 4, 5)]]
    assert [verdict_of(found, (circle,)) for found in accused] == ["exact", "exact", "some", "wrong"]


def test_silence_is_right_where_nothing_is_wrong_and_doubt_is_no_silence():
    assert verdict_of(Found("accepted"), ()) == "quiet"
    assert verdict_of(Found("explained", ((placed(1),),)), ()) == "false alarm"
    assert verdict_of(Found("undecided"), (fault(1),)) == "undecided"


def test_coordinates_images_and_units_are_named_as_such():
    for mistake, place, other in (
        (
            Fault(points=frozenset({"P1 x"})),
            Place(points=frozenset({"P1 x"})),
            Place(points=frozenset({"P1 y"})),
        ),
        (Fault(images=frozenset("ab")), Place(images=frozenset("ab")), Place(images=frozenset("c"))),
        (Fault(codes=frozenset({"I150"})), Place("I150"), Place("I110")),
    ):
        assert verdict_of(Found("explained", ((place,),)), (mistake,)) == "exact"
        assert verdict_of(Found("explained", ((other,),)), (mistake,)) == "wrong"


def test_the_cause_counts_where_it_is_told_of_the_right_place():
    wrong = fault(1, causes=frozenset({"W100", "S120"}))
    told = [placed(1, causes=frozenset({"W100"})), placed(1, code="S120"), placed(1), placed(2, code="S120")]
    found = [has_cause(Found("explained", ((place,),)), (wrong,)) for place in told]
    assert found == [True, True, False, False]
