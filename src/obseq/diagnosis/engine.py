"""The search for errors: tests at a robust place, proved by adjustments.

1. Where the adjustment as given is accepted by all tests, nothing is wrong.
2. A robust start leads near the truth. There tests are exact in the size of errors, whatever it is.
3. Hypotheses are selected by linear algebra, and the model is adjusted with them, until they stay the same.
4. What is not linear is applied, not extrapolated. What is not explained is looked for from other places.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Generic

import numpy as np

from obseq.diagnosis.explanation import Explanation, accepted, better, change_of, with_equals
from obseq.diagnosis.judgement import judged, with_slips
from obseq.diagnosis.linear_tests import LinearTests
from obseq.diagnosis.policy import POLICY, Policy
from obseq.diagnosis.protocol import Change, Model, Place
from obseq.diagnosis.selection import (
    equals,
    gains,
    inside,
    is_less,
    merged,
    needed,
    select,
    suspected_blocks,
    suspects,
)
from obseq.diagnosis.verdict import ASTRAY, UNDETERMINED, Status, Verdict
from obseq.errors import ObseqError, SingularSystemError

Told = Callable[[str], None]


def diagnose(model: Model[Place], policy: Policy = POLICY, told: Told | None = None) -> Verdict:
    """What is wrong with a model, or that nothing is."""
    search = Search(model, policy, told)
    return search.at_first() or search.patiently()


class Search(Generic[Place]):
    """One diagnosis: what it has spent, and what it found."""

    def __init__(self, model: Model[Place], policy: Policy, told: Told | None = None) -> None:
        self._model, self._policy = model, policy
        self._hypotheses = model.hypotheses
        self._steps, self._told, self._reason = 0, told, ASTRAY
        self._last: tuple[Place, LinearTests] | None = None
        self._is_large = False
        self._places: list[tuple[Place | None, bool]] = []
        self._best: Explanation[Place] | None = None
        self.count = 0

    def at_first(self) -> Verdict | None:
        """That nothing is wrong, or the few errors that explain a model; None where it takes patience.

        Then `count` is how many were found.
        """
        solution = self._solution()
        if solution is not None:
            if (verdict := self._of_nothing(solution)) is not None:
                return verdict
            if (best := self._by_one(solution)) is not None:
                return judged(self._model, best, "")
        robust = self._robust(())
        self._places = [(robust, True), (solution, False)]
        try:
            self.count = 0 if robust is None else self._too_many(robust)
        except ObseqError:  # nothing can be tested where all determines too little
            return None
        if robust is None or self.count:
            return None
        self._from_next()
        best = self._best
        self.count = 0 if best is None else len(best.chosen)
        return self.patiently() if best and best.is_accepted and self.count <= self._policy.few else None

    def at_rest(self) -> None:
        """Forgets tests that can be made again: of a large model they are most of what is held."""
        self._last = None

    def patiently(self) -> Verdict:
        """What is wrong, from all places where that may be seen."""
        best = self._from_all_places()
        if best is None:
            return Verdict(Status.UNDECIDED, reason=self._reason)
        spent = f"not all explanations were tried: the {self._budget} iterations for that are spent"
        reason = spent if self._is_spent and self._budget else ""
        verdict = judged(self._model, best, reason)
        if reason and verdict.status is Status.UNEXPLAINED:  # no adjustment proves what is listed so far
            return Verdict(Status.UNDECIDED, (), verdict.left, verdict.redundancy, reason)
        return verdict

    def _solution(self) -> Place | None:
        """Where the adjustment as given ended, if it is a place to test anything at."""
        return self._testable(self._model.solution)

    def _testable(self, found: Callable[[], Place | None]) -> Place | None:
        """A place, if it is found, and observations determine the unknowns there."""
        try:
            place = found()
            if place is not None:
                self._tests(place)
        except ObseqError as error:
            self._reason = UNDETERMINED if isinstance(error, SingularSystemError) else self._reason
            return None
        return place

    def _of_nothing(self, solution: Place) -> Verdict | None:
        """That a solution shows nothing, or nothing that has a name; else None."""
        tests = self._tests(solution)
        gained = gains(tests, tests.tests(tests.given(()), blocks=False))
        told = np.flatnonzero(np.isfinite(gained)).tolist()
        is_accepted = tests.cost <= accepted(tests.linear.redundancy, self._policy)
        if is_accepted and all(tests.is_small(i, [i]) for i in told):
            return judged(self._model, Explanation(0.0, tests, tuple(select(tests)), solution), "")
        spare = tests.linear.redundancy
        return None if told else Verdict(Status.UNEXPLAINED, (), tests.cost, spare)

    @property
    def _budget(self) -> int:
        return self._policy.steps_of_large if self._is_large else self._policy.steps

    @property
    def _is_spent(self) -> bool:
        return self._steps >= self._budget

    def _tests(self, place: Place, applied: Sequence[Change] = ()) -> LinearTests:
        """The tests at a place; of what is applied the columns stand where the change now is."""
        if not applied and self._last is not None and self._last[0] is place:
            return self._last[1]
        linear, columns = self._model.linearised(place, applied)
        for change in applied:  # back to no change, along the tangent
            own = self._hypotheses.of(change.index)
            linear.residuals[:] += columns.effect(own, change.size)
        tests = LinearTests(linear, columns, self._hypotheses, self._policy)
        self._last = None if applied else (place, tests)
        self._is_large = linear.n > self._policy.large
        return tests

    def _from_all_places(self) -> Explanation[Place] | None:
        """The best explanation from the robust place; from least squares, or without the worst rows."""
        while self._is_wanted() and self._places:
            self._from_next()
        best = self._best
        if best is None:
            return self._by_a_slip()
        if best.is_accepted and not self._is_spent:
            best = self._best = self._with_one_for_several(best)
        if not self._is_wanted():
            return best
        if best.is_accepted and not self._is_spent:
            best = self._in_place_of_several(best)
        # of few spare observations some errors take too many: then they hardly are as many
        are_many = len(best.chosen) > max(2.0, self._policy.share * best.tests.linear.redundancy)
        if are_many or (not best.is_accepted and _stands_out(best)):
            best = self._without_the_worst(best)
        return best

    def _by_a_slip(self) -> Explanation[Place] | None:
        """From robust starts without a block that needs a slip, where one explains it, or another, then.

        Of two sights that place a point, one of them to another point, nothing else tells which is right.
        """
        place = self._robust(())
        blocks = [] if place is None else suspected_blocks(self._tests(place), for_a_slip=True)
        for index in blocks[: self._policy.trials]:
            assert place is not None
            start = self._robust((change_of(self._tests(place), index),))
            found = None if start is None else self._adapted(start, is_robust=True)
            if found is not None and found.is_accepted:
                found = with_slips(self._model, found)
                if self._hypotheses.needs_slip[list(found.chosen)].any():
                    return found
        return None

    def _from_next(self) -> None:
        """Looks from the next place, if it is one."""
        place, is_robust = self._places.pop(0)
        found = None if place is None else self._adapted(place, is_robust=is_robust)
        best = better(self._best, found)
        if best is not None and best.is_accepted and len(best.chosen) > 1:
            best = with_slips(self._model, best)
        self._best = best

    def _is_wanted(self) -> bool:
        """Whether another place may show something better: several errors may be the price of a wrong one.

        Few errors do not carry a large model far away.
        """
        best = self._best
        if best is None:
            return True
        is_one = best.is_accepted and len(best.chosen) == 1
        return not is_one and not (self._is_large and len(best.chosen) >= self._policy.most)

    def _too_many(self, robust: Place) -> int:
        """How many rows are off at a robust place, if they are many and no few errors explain it.

        More than may be told, or most of a kind: such as the known coordinates.
        """
        tests, policy, hypotheses = self._tests(robust), self._policy, self._hypotheses
        alone = np.flatnonzero(hypotheses.is_start)
        off = np.abs(tests.off[hypotheses.columns[hypotheses.starts[:-1][alone]]]) > policy.suspect
        shares = [
            off[hypotheses.family[alone] == one].mean() for one in set(hypotheses.family[alone].tolist())
        ]
        count = int(np.count_nonzero(off))
        is_shared = policy.half < max(shares, default=0.0) and count < policy.half * tests.linear.redundancy
        if count <= (policy.few if is_shared else policy.most):
            return 0
        few = select(tests, suspected_blocks(tests)[: policy.few], most=policy.few)
        return 0 if _explain(tests, few) else count

    def _by_one(self, solution: Place) -> Explanation[Place] | None:
        """One hypothesis that explains all that least squares show, and is proved by its adjustment."""
        tests = self._tests(solution)
        if not _explain(tests, select(tests, most=1)):
            return None
        found = self._adapted(solution, is_robust=False)
        is_proved = found is not None and found.is_accepted and len(found.chosen) == 1
        return found if is_proved else None

    def _with_one_for_several(self, best: Explanation[Place]) -> Explanation[Place]:
        """The same from an adjustment with one row out in place of several: far off, one looks like many."""
        other = best.tests.one_for_several(best.chosen) if len(best.chosen) > 1 else best.chosen
        if len(other) == len(best.chosen):
            return best
        try:
            place, _ = self._adjusted(best.place, [change_of(best.tests, i) for i in other])
        except ObseqError:
            return best
        found, _ = self._settled(place, (), is_robust=True)
        return better(best, found) or best

    def _in_place_of_several(self, best: Explanation[Place]) -> Explanation[Place]:
        """From a start without what is as good as each of several: far off, one error looks like many."""
        shared = Counter[int]()
        for index in best.chosen if len(best.chosen) > 1 else ():
            rest = [j for j in best.chosen if j != index]
            found = best.tests.tests(best.tests.given(rest), rest, blocks=False)
            shared.update(equals(best.tests, found, index))
        several = [i for i, count in shared.most_common() if count > 1 and self._hypotheses.is_start[i]]
        return self._restarted(best, several)

    def _restarted(self, best: Explanation[Place], which: Sequence[int]) -> Explanation[Place]:
        """The best explanation from robust starts, each without one of some hypotheses."""
        for index in which[: self._policy.trials]:
            if self._is_spent:
                break
            place = self._robust((change_of(best.tests, index),))
            found = None if place is None else self._adapted(place, is_robust=True)
            best = better(best, found) or best
            if best.is_accepted and len(best.chosen) == 1:
                break
        return best

    def _spend(self, steps: int) -> None:
        """Counts iterations, and tells how many of those that it may spend are spent."""
        self._steps += steps
        if self._told is not None and self._budget:
            spent = min(self._steps, self._budget)
            self._told(f"search for errors: iteration {spent} of {self._budget}")

    def _robust(self, without: Sequence[Change]) -> Place | None:
        self._spend(26)
        return self._testable(lambda: self._model.robust(without))

    def _without_the_worst(self, best: Explanation[Place]) -> Explanation[Place]:
        """From a robust start without the row of the largest test, which may have spoiled the first."""
        tests = best.tests
        statistic = tests.tests(tests.given(()), blocks=False).statistic
        worst = [i for i in np.argsort(-statistic).tolist() if self._hypotheses.is_start[i]]
        worst = [i for i in worst[: self._policy.trials] if statistic[i] > 0.0]
        for index in worst:
            best = self._restarted(best, [index])
            if best.is_accepted and len(best.chosen) == 1:
                break
        return best

    def _adapted(self, place: Place, *, is_robust: bool) -> Explanation[Place] | None:
        """The best explanation from a place; what is not linear is tried as what it is."""
        best, bent = self._settled(place, (), is_robust=is_robust)
        if best is not None and best.is_accepted and not self._hypotheses.is_block[list(best.chosen)].any():
            return best  # what is not linear in it was applied: tests tell what is as good
        found = [best] if best is not None else []
        for change in bent:
            other, _ = self._settled(place, (change,), is_robust=is_robust)
            found += [other] if other is not None else []
            if other is not None and other.is_accepted and self._is_one_bent(other):
                break
        if not found:
            return None
        found.sort(key=lambda one: one.price)
        return with_equals(found, self._policy)

    def _is_one_bent(self, found: Explanation[Place]) -> bool:
        """Whether an explanation is one hypothesis whose effect is not linear, applied as what it is."""
        return len(found.chosen) == 1 and bool(self._hypotheses.is_bent[found.chosen[0]])

    def _settled(
        self, place: Place, applied: tuple[Change, ...], *, is_robust: bool
    ) -> tuple[Explanation[Place] | None, tuple[Change, ...]]:
        """Selection, adjustment and linearisation until they stay the same; and changes to try."""
        best: Explanation[Place] | None = None
        before: tuple[int, ...] | None = None
        bent: tuple[Change, ...] = ()
        try:
            if applied:
                place, _ = self._adjusted(place, applied)
            for turn in range(self._policy.rounds):
                tests = self._tests(place, applied)
                bent = self._to_try(tests) if turn == 0 and not applied else bent
                chosen = self._selected(tests, [change.index for change in applied], is_robust=is_robust)
                if before and not is_less(tests.price(chosen), tests.price(before)):
                    chosen = before  # of equals, that which the place is adjusted without
                if chosen == before or not chosen:
                    return Explanation(tests.price(chosen), tests, chosen, place), bent
                before, changes = chosen, [Change(i, *s) for i, s in tests.sizes(chosen).items()]
                place, converged = self._adjusted(place, changes)
                applied = tuple(change for change in changes if self._hypotheses.is_bent[change.index])
                price = tests.price(chosen) if converged else np.inf
                best = Explanation(price, tests, chosen, place)
                if self._is_spent:
                    break
        except ObseqError:
            pass
        return (best if best is not None and np.isfinite(best.price) else None), bent

    def _adjusted(self, place: Place, changes: Sequence[Change]) -> tuple[Place, bool]:
        place, converged, steps = self._model.adjusted(place, changes)
        self._spend(steps)
        return place, converged

    def _selected(self, tests: LinearTests, first: list[int], *, is_robust: bool) -> tuple[int, ...]:
        """What explains a model at a place: from nothing, from what is far off there, from rows alone."""
        off = suspects(tests) if is_robust and not first else []
        is_many = self._is_large and len(off) > self._policy.most  # nothing but them tells so many
        if off and (self._is_spent or is_many):
            return tuple(sorted(select(tests, off)))
        found = [select(tests, first)]
        if off:
            found.append(select(tests, off))
            if (blocks := merged(tests, off)) != off:  # more rows than are told one by one
                found.append(select(tests, blocks))
            if blocks := suspected_blocks(tests):
                found.append(select(tests, blocks))
        best = _cheapest(tests, found)
        blocks = [i for i in best if self._hypotheses.is_block[i]]
        if len(best) > 1 or blocks:  # two rows may look like one group and another row
            rows = select(tests, rows_only=True)
            left = tests.cost - tests.took(rows)
            spare = tests.linear.redundancy - len(rows)
            are_few = any(len(inside(tests, rows, block)) < needed(tests, block) for block in blocks)
            if are_few and left <= accepted(spare, self._policy):
                found = [one for one in found if not self._hypotheses.is_block[one].any()]
            found.append(rows)
        return tuple(sorted(_cheapest(tests, found)))

    def _to_try(self, tests: LinearTests) -> tuple[Change, ...]:
        """Changes that are not linear and explain much, the most first."""
        found = tests.tests(tests.given(()), blocks=False)
        least = np.maximum(self._policy.share * tests.cost, found.limit)
        which = np.flatnonzero(self._hypotheses.is_bent & (found.statistic > least))
        which = which[np.argsort(-found.statistic[which], kind="stable")][: self._policy.trials]
        return tuple(change_of(tests, int(i)) for i in which)


def _explain(tests: LinearTests, chosen: Sequence[int]) -> bool:
    """Whether the overall test accepts what hypotheses leave at a linearisation."""
    spare = tests.linear.redundancy - sum(map(tests.rank, chosen))
    return tests.cost - tests.took(chosen) <= accepted(spare, tests.policy)


def _cheapest(tests: LinearTests, found: list[list[int]]) -> list[int]:
    return min(found, key=lambda chosen: tests.price(chosen))


def _stands_out(found: Explanation[Place]) -> bool:
    """Whether something contradicts the rest still, if the noise is as large as what is left."""
    tests, chosen = found.tests, found.chosen
    noise = max(found.left / max(found.redundancy, 1), 1.0)
    tested = tests.tests(tests.given(chosen), chosen, blocks=False)
    return bool((tested.statistic > noise * tested.limit).any())
