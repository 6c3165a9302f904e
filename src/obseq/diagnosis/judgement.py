"""Verdicts: an explanation with what nothing tells from it, and the slips that may be behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.diagnosis.protocol import Change
from obseq.diagnosis.selection import for_a_slip, gains, inside, select
from obseq.diagnosis.verdict import Accusation, Alternative, Status, Verdict

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.diagnosis.explanation import Explanation
    from obseq.diagnosis.linear_tests import LinearTests, Tested
    from obseq.diagnosis.protocol import Model, Place

_SCALINGS = 3
"""Rounds in which the variance factor of the noise is estimated; it grows, and seldom after the second."""


def judged(model: Model[Place], found: Explanation[Place], reason: str) -> Verdict:
    """The verdict on a model of which an explanation was found."""
    chosen = list(found.chosen)
    is_accepted = found.is_accepted
    if not is_accepted:
        chosen = _beyond_noise(found)
    chosen = _with_slips(model, found, chosen)
    tests = found.tests
    left = tests.cost - tests.given(chosen).took
    redundancy = tests.linear.redundancy - sum(map(tests.rank, chosen))
    accused = [_accusation(model, found, chosen, i) for i in chosen]
    accused.sort(key=lambda one: -one.test / one.limit)
    explained = Status.EXPLAINED if accused else Status.ACCEPTED
    status = explained if is_accepted else Status.UNEXPLAINED
    return Verdict(status, tuple(accused), left, redundancy, reason)


def _beyond_noise(found: Explanation[Place]) -> list[int]:
    """What stands out where the noise is larger than announced: tests reckon with what remains without it."""
    tests, chosen = found.tests, list(found.chosen)
    for _ in range(_SCALINGS):
        left = tests.cost - tests.given(chosen).took
        redundancy = max(tests.linear.redundancy - sum(map(tests.rank, chosen)), 1)
        tests.scale = max(tests.scale, left / redundancy)
        other = min((select(tests), select(tests, chosen)), key=tests.price)
        if set(other) == set(chosen):
            break
        chosen = list(other)
    return chosen


def _with_slips(model: Model[Place], found: Explanation[Place], chosen: list[int]) -> list[int]:
    """The same with a block in place of its rows where a slip explains it: a name, say."""
    tests = found.tests
    for block in for_a_slip(tests, chosen):
        gone = inside(tests, chosen, block)
        other = [*(i for i in chosen if i not in gone), block]
        change = Change(block, *tests.sizes(other)[block])
        if any(slip.is_strong for slip in model.slips(change, found.place)):
            chosen = other
    return chosen


def _accusation(
    model: Model[Place], found: Explanation[Place], chosen: Sequence[int], index: int
) -> Accusation:
    """One error, with what explains it as well, and its slips: where only another has one, that is first."""
    tests = found.tests
    rest = [j for j in chosen if j != index]
    tested = tests.tests(tests.given(rest), rest)
    if not tested.statistic[index]:  # a block that is told for its slip
        took = tests.given(chosen).took - tests.given(rest).took
        tested.statistic[index], tested.limit[index] = took, tests.limit(tests.rank(index))
    others = _equals(tests, tested, rest, index)
    changes = [Change(j, *tests.sizes([*rest, j])[j]) for j in (index, *others)]
    found_others = [Alternative(c, float(tested.statistic[c.index])) for c in changes]
    known = {index, *others}
    if len(chosen) == 1:
        found_others += [Alternative(c, t) for c, t in found.same if c.index not in known]
    best = found_others[0]
    slips = model.slips(best.change, found.place)
    if not any(slip.is_strong for slip in slips):
        for other in found_others[1:]:
            told = model.slips(other.change, found.place)
            if any(slip.is_strong for slip in told):
                best, slips = other, told
                break
    limit = float(tested.limit[best.change.index])
    rest_of = tuple(one for one in found_others if one is not best)
    return Accusation(best.change, best.test, limit, rest_of, slips)


def _equals(tests: LinearTests, tested: Tested, rest: Sequence[int], index: int) -> list[int]:
    """What nothing tells from a hypothesis, the best first; not what holds all of it and more."""
    gain = gains(tests, tested)
    own = (
        gain[index]
        if np.isfinite(gain[index])
        else (tested.statistic[index] - tested.limit[index] - tests.rarity[index])
    )
    near = np.flatnonzero(gain >= own - tests.policy.margin)
    mine = set(tests.hypotheses.of(index).tolist())
    return [
        int(j)
        for j in near[np.argsort(-gain[near], kind="stable")].tolist()
        if j != index and not mine <= set(tests.hypotheses.of(j).tolist())
    ]
