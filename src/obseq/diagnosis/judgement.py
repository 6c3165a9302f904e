"""Verdicts: an explanation with what nothing tells from it, and the slips that may be behind it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from obseq.diagnosis.explanation import Explanation, accepted
from obseq.diagnosis.linear_tests import LinearTests
from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.protocol import Change, Model, Place
from obseq.diagnosis.selection import equals, for_a_slip, kept, select
from obseq.diagnosis.verdict import Accusation, Alternative, Status, Verdict
from obseq.errors import ObseqError

MANY = (
    "more contradicts the rest than a few errors do: look for what many observations share (names, units, a "
    "model that is too simple), for sigmas that are too small, or use robust weights"
)
"""In place of a list: the search for single errors ended before nothing stood out any more."""
_SCALINGS = 3
"""Rounds in which the variance factor of the noise is estimated; it grows, and seldom after the second."""
_MEDIAN = 0.455
"""Of chi-square with one degree of freedom."""


def judged(model: Model[Place], found: Explanation[Place], reason: str) -> Verdict:
    """The verdict on a model of which an explanation was found."""
    chosen = list(found.chosen)
    is_accepted = found.is_accepted
    chosen = _of_its_noise(found.tests, chosen) if is_accepted else _beyond_noise(found)
    if not is_accepted and len(chosen) >= found.tests.policy.most:
        spare, said = found.tests.linear.redundancy, f"{reason}; {MANY}" if reason else MANY
        return Verdict(Status.UNEXPLAINED, (), found.tests.cost, spare, said, many=len(chosen))
    if tuple(chosen) != found.chosen:
        found = replace(found, chosen=tuple(chosen), is_told=False)
    found = with_slips(model, found)
    chosen, tests = list(found.chosen), found.tests
    left = max(tests.cost - tests.took(chosen), 0.0)  # a difference of large numbers where little is left
    if is_accepted and chosen and left + tests.due(chosen) / tests.scale > _of_sigmas(tests):
        return Verdict(Status.UNEXPLAINED, (), tests.cost, tests.linear.redundancy, reason)
    redundancy = tests.linear.redundancy - sum(map(tests.rank, chosen))
    if not chosen:  # nothing that was found stands out of the noise
        is_accepted = left <= accepted(redundancy, tests.policy)
    if len(chosen) > 1 and redundancy < tests.policy.half * tests.linear.redundancy:
        return Verdict(Status.UNEXPLAINED, (), tests.cost, tests.linear.redundancy, reason)
    told = {i: _accusation(model, found, chosen, i) for i in chosen}
    remarks = _remarks(tests, chosen) if is_accepted else []
    accused = [told[i] for i in chosen if i not in remarks]
    accused.sort(key=lambda one: -one.test / one.limit)
    explained = Status.EXPLAINED if accused else Status.ACCEPTED
    status = explained if is_accepted else Status.UNEXPLAINED
    return Verdict(status, tuple(accused), left, redundancy, reason, tuple(told[i] for i in remarks))


def _remarks(tests: LinearTests, chosen: list[int]) -> list[int]:
    """Effects within what sigmas announce, where the overall test accepts without them.

    No instrument is free of them. Of enough observations any is significant, and none is an error: that a
    sigma is kept is what is tested (a minimum-effect test; Murphy and Myors 1999).
    """
    small = [i for i in chosen if tests.is_small(i, chosen)]
    rest = [i for i in chosen if i not in small]
    spare = tests.linear.redundancy - sum(map(tests.rank, rest))
    return small if tests.cost - tests.took(rest) <= accepted(spare, tests.policy) else []


def _of_sigmas(tests: LinearTests) -> float:
    """The price of sigmas that are all too small by one factor: minus twice the logarithm of its likelihood.

    Of few spare observations it is often less than that of errors in some of them: nobody is accused then.
    """
    spare = max(tests.linear.redundancy, 1)
    factor = max(tests.cost / spare, 1.0)
    return float(spare * math.log(factor) + tests.cost / factor + tests.policy.sigmas)


def _of_its_noise(tests: LinearTests, chosen: list[int]) -> list[int]:
    """Those that stand out of what the others leave, where that is more than announced, if not by much."""
    left = tests.cost - tests.took(chosen)
    tests.scale = max(1.0, left / max(tests.linear.redundancy - sum(map(tests.rank, chosen)), 1))
    return kept(tests, chosen)


def _beyond_noise(found: Explanation[Place]) -> list[int]:
    """What stands out where the noise is larger than announced: tests reckon with what remains without it."""
    tests, chosen = found.tests, list(found.chosen)
    for _ in range(_SCALINGS):
        left = tests.cost - tests.took(chosen)
        redundancy = max(tests.linear.redundancy - sum(map(tests.rank, chosen)), 1)
        tests.scale = max(tests.scale, left / redundancy)
        other = min((select(tests), select(tests, chosen)), key=tests.price)
        if set(other) == set(chosen):
            break
        chosen = list(other)
    return chosen


def with_slips(model: Model[Place], found: Explanation[Place]) -> Explanation[Place]:
    """The same with a block in place of its rows where a slip explains it: a name, say."""
    tests = found.tests
    for other in () if found.is_told else for_a_slip(tests, found.chosen):
        (block,) = (i for i in other if i not in found.chosen)
        sizes = tests.sizes(other)
        try:
            place, _, _ = model.adjusted(found.place, [Change(i, *sizes[i]) for i in other])
        except ObseqError:
            continue
        if any(slip.is_strong for slip in model.slips(Change(block, *sizes[block]), place)):
            explained = Explanation(tests.price(other), tests, tuple(other), place, found.same)
            return with_slips(model, explained)
    return replace(found, is_told=True)


def _accusation(
    model: Model[Place], found: Explanation[Place], chosen: Sequence[int], index: int
) -> Accusation:
    """One error, with what explains it as well, and its slips: where only another has one, that is first."""
    tests = found.tests
    rest = [j for j in chosen if j != index]
    tests.given(chosen)  # of which that without one follows
    tested = tests.tests(tests.given(rest), rest)
    if not tested.statistic[index]:  # a block that is told for its slip
        took = tests.took(chosen) - tests.took(rest)
        tested.statistic[index], tested.limit[index] = took, tests.limit(tests.rank(index))
    others = equals(tests, tested, index)
    changes = [Change(j, *tests.sizes([*rest, j])[j]) for j in (index, *others)]
    found_others = [Alternative(c, float(tested.statistic[c.index])) for c in changes]
    known = {index, *others}
    if len(chosen) == 1:
        found_others += [Alternative(c, t) for c, t in found.same if c.index not in known]
    best = found_others[0]
    slips = model.slips(best.change, found.place)
    if not any(slip.is_strong for slip in slips):
        told = [(other, model.slips(other.change, found.place)) for other in found_others[1:]]
        strong = [(other, of) for other, of in told if any(slip.is_strong for slip in of)]
        some = [] if slips else [(other, of) for other, of in told if of]
        best, slips = min(strong or some, key=lambda one: one[1][0].misfit, default=(best, slips))
    limit = float(tested.limit[best.change.index])
    rest_of = tuple(one for one in found_others if one is not best)
    return Accusation(best.change, best.test, limit, rest_of, slips)


def noise(model: Model[Place]) -> float:
    """The variance factor of what a linear model leaves without errors that stand out; 0 without any test.

    It begins at that of the median of all tests, which an error that spoils many makes too large, and falls
    as long as errors stand out of it.
    """
    hypotheses = model.hypotheses
    tests = LinearTests(*model.linearised(model.robust(), ()), hypotheses, POLICY)
    found = tests.tests(tests.given(()), blocks=False)
    seen = hypotheses.is_start & (found.statistic > 0.0)
    if not seen.any():
        return 0.0
    tests.scale = float(np.median(found.statistic[seen] / found.noise[seen])) / _MEDIAN
    for _ in range(POLICY.rounds):
        chosen = select(tests)
        spare = tests.linear.redundancy - sum(map(tests.rank, chosen))
        left = tests.cost - tests.took(chosen)
        if not chosen or spare <= 0 or left >= tests.scale * spare:
            break
        tests.scale = left / spare
    return tests.scale
