"""T of every hypothesis at one linearisation, given those that are accepted already.

With R = I - A Q A', u = C' R v0 and M = C' R C of the columns C of a hypothesis:

    T = u' M^- u,   estimate of its sizes M^- u, their covariance M^-

Accepted hypotheses S are unknowns of the model. With B = L^-1 C_S' R, L L' = C_S' R C_S, all others keep
u - (B C)' B v0 and M - (B C)' (B C). Nothing of the size of (equations x equations) is made: the diagonal
of M comes from the selected inverse and from solves by columns, rows of C' R C only for what was accepted.
Sources: W. Baarda 1968; P. Teunissen, Testing theory, Delft 2000, and J. Geod. 92 (2018).
"""

from __future__ import annotations

from collections import Counter
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from obseq.cached import cached_property
from obseq.diagnosis.columns import joint
from obseq.diagnosis.given import Given, Tested
from obseq.leastsquares.statistics.joint_levels import joint_critical, shared_level

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.diagnosis.columns import Columns
    from obseq.diagnosis.hypotheses import Hypotheses
    from obseq.diagnosis.linear import Linear
    from obseq.diagnosis.policy import Policy

_KEPT, _KEPT_OF_LARGE = 8, 3
"""Sets of accepted hypotheses that are kept: each is asked for again. Three follow from one another."""
_TINY, _NOTHING = 1e-300, 1e-10
"""Smallest length of a column; share of its weight in place of none, where others do the same."""


class LinearTests:
    """The tests of all hypotheses at one linearisation.

    Attributes:
        cost: Weighted sum of squares of the residuals of the linear model.
        scale: Variance factor of the noise that tests reckon with.
    """

    def __init__(self, linear: Linear, columns: Columns, hypotheses: Hypotheses, policy: Policy) -> None:
        """Weighs all columns.

        Args:
            linear: The model at a place.
            columns: Of all hypotheses there; they are scaled, and belong to the tests from now on.
            hypotheses: What may be wrong.
            policy: How it is judged.
        """
        self.linear, self.hypotheses, self.policy = linear, hypotheses, policy
        lengths, unit = np.maximum(columns.norms(), _TINY), policy.variance**0.5
        self.norm = lengths / unit
        columns.scale(lengths)
        self._columns = columns
        left = linear.left(linear.residuals) / unit
        self.cost = float(left @ left)
        self.off = self._columns.shown(linear.residuals) / unit
        self.shown = self._columns.shown(left)
        self._across: dict[int, FloatArray] = {}
        self._grams: dict[int, FloatArray] = {}
        self._given: dict[tuple[int, ...], Given] = {}
        self._weight = self._columns.first_weights(linear)
        self._weight[self._in_sets & np.isnan(self._weight)] = 0.0
        self._is_screened, self._still = linear.n > policy.large, 2 * [policy.held_down]
        counts = Counter(hypotheses.q[~hypotheses.is_block].tolist())
        tests = tuple((int(q), int(float(f"{n:.1e}"))) for q, n in sorted(counts.items()))
        self.level = _level(policy.false_alarm, policy.power, tests)
        self._ranks: dict[int, int] = {}
        self.scale = 1.0

    def limit(self, degrees: int) -> float:
        """K of a test of so many degrees of freedom, for the variance factor of the noise."""
        if not degrees:
            return np.inf
        return self.scale * joint_critical(self.level, self.policy.power, int(degrees))

    @property
    def rarity(self) -> FloatArray:
        """(h,) what hypotheses must explain beyond their limits, for the variance factor of the noise."""
        return np.asarray(self.scale * self.hypotheses.rarity)

    @cached_property
    def _single(self) -> IntArray:
        """Hypotheses of one column."""
        return np.flatnonzero(self.hypotheses.q == 1)

    @cached_property
    def _at_single(self) -> IntArray:
        return np.asarray(self.hypotheses.columns[self.hypotheses.starts[:-1][self._single]])

    @cached_property
    def _sets(self) -> list[tuple[IntArray, IntArray, FloatArray]]:
        """Hypotheses of several columns and no blocks, by their number: which, columns (g, q), M (g, q, q).

        M is NaN where it takes solves: it is worked out where something asks for it.
        """
        wanted, found = self.hypotheses.q * ~self.hypotheses.is_block, []
        for size in sorted(set(wanted[wanted > 1].tolist())):  # np.unique would load masked arrays
            which = np.flatnonzero(wanted == size)
            columns = self.hypotheses.columns[self.hypotheses.starts[which][:, None] + np.arange(size)]
            grams, near = (
                np.full((len(which), size, size), np.nan),
                self._columns.are_near(self.linear, columns),
            )
            grams[near] = self._columns.grams(self.linear, columns[near])
            found.append((which, columns, grams))
        return found

    def _weigh_sets(self, shown: FloatArray) -> None:
        """Works out M of the sets of columns that are wanted and not known yet."""
        for _, columns, grams in self._sets:
            wanted = np.flatnonzero(np.isnan(grams[:, 0, 0]))
            wanted = self._worst(wanted, columns[wanted], shown)
            for part in _parts(wanted, self._columns.at_a_time):
                grams[part] = self._columns.grams(self.linear, columns[part])

    @cached_property
    def _blocks(self) -> IntArray:
        """Hypotheses that take several observations out."""
        return np.flatnonzero(self.hypotheses.is_block & (self.hypotheses.q > 1) & self.is_solved)

    @property
    def is_solved(self) -> BoolArray:
        """(h,) whether hypotheses are not too large to be solved for."""
        return np.asarray(self.hypotheses.q <= self.policy.columns)

    @property
    def _in_sets(self) -> BoolArray:
        """(k,) columns that no hypothesis has alone, nor a block."""
        result = np.ones(len(self.shown), np.bool_)
        wanted = (self.hypotheses.q == 1) | self.hypotheses.is_block
        result[self.hypotheses.columns[np.repeat(wanted, self.hypotheses.q)]] = False
        return result

    @cached_property
    def _apart(self) -> FloatArray:
        return self._columns.weights_apart(self.linear)

    def _weigh(self, shown: FloatArray) -> None:
        """Works out M of the columns that are wanted and not known yet."""
        wanted = np.flatnonzero(np.isnan(self._weight))
        chosen = self._worst(wanted, wanted[:, None], shown)
        if len(chosen):
            self._weight[chosen] = 1.0 - self._columns.lost(self.linear, chosen)

    def _worst(self, which: IntArray, columns: IntArray, shown: FloatArray) -> IntArray:
        """Those of some columns, or sets of them (m, q), that are solved for at this place.

        Of a large model only where a test, its equations taken apart, asks for it; the worst where many do.
        """
        if not self._is_screened:
            return which
        is_set = int(columns.shape[1] > 1)
        apart = np.max(shown[columns] ** 2 / self._apart[columns].clip(_TINY), axis=1)
        order = np.argsort(-apart, kind="stable")[: self._still[is_set]]
        chosen: IntArray = which[order[apart[order] > self.policy.screen**2]]
        self._still[is_set] -= len(chosen)
        return chosen

    def _solve_for(self, columns: IntArray) -> None:
        """Works out C' R C of some columns with all."""
        missing = np.array([k for k in dict.fromkeys(columns.tolist()) if k not in self._across], np.intp)
        for part in _parts(missing, self._columns.at_a_time):
            made = self._columns.shown(self.linear.left(self._columns.some(part))).T
            self._across.update(zip(part.tolist(), made, strict=True))

    def _gram(self, own: IntArray) -> FloatArray:
        """(m, m) C' R C of some columns."""
        self._solve_for(own)
        return np.array([self._across[k][own] for k in own.tolist()]).reshape(len(own), len(own))

    def took(self, chosen: Sequence[int]) -> float:
        """What hypotheses take of the sum of squares together."""
        if not len(chosen):
            return 0.0
        own = self._own_columns(chosen)
        shares, axes = np.linalg.eigh(self._gram(own))
        seen = shares > self.policy.unseen
        return float(np.sum(np.square(self.shown[own] @ axes[:, seen]) / shares[seen]))

    def _own_columns(self, chosen: Sequence[int]) -> IntArray:
        return np.array(sorted({k for i in chosen for k in self.hypotheses.of(i).tolist()}), np.intp)

    def given(self, chosen: Sequence[int]) -> Given:
        """What is left to the columns when hypotheses are unknowns of the model."""
        key = tuple(sorted(map(int, chosen)))
        found = self._given.pop(key, None) or self._made(key)
        self._given[key] = found  # the last that was asked for is the last to go
        if len(self._given) > (_KEPT_OF_LARGE if self._is_screened else _KEPT):
            self._given.pop(next(iter(self._given)))
        return found

    def _made(self, chosen: tuple[int, ...]) -> Given:
        """The same from the beginning, or from what is known without one of them, or with one more."""
        own = set(chosen)
        known = {key: set(key) for key in self._given if abs(len(key) - len(own)) == 1}
        more = next((key for key, held in known.items() if held > own), None)
        if more is not None:
            return self.given(more).with_less(self._own_columns(chosen))
        rest = next((key for key, held in known.items() if held < own), ())
        before = self._given[rest] if rest else Given.nothing(self.shown)
        if not chosen:
            return before
        columns = self._own_columns([i for i in chosen if i not in rest])
        self._solve_for(columns)
        across = np.array([self._across[k] for k in columns.tolist()]).reshape(len(columns), len(self.shown))
        return before.with_more(across, columns, self.policy.unseen)

    def tests(self, given: Given, skip: Sequence[int] = (), *, blocks: bool = True) -> Tested:
        """T of every hypothesis and what it must exceed; of blocks where enough of their rows stand out."""
        self._weigh_sets(given.shown)
        alone = self._alone(given)
        statistic, degrees = np.zeros(len(self.hypotheses)), np.ones(len(self.hypotheses), np.int32)
        statistic[self._single] = alone[self._at_single]
        for which, columns, grams in self._sets:
            across = given.basis(columns).transpose(1, 0, 2)
            left = np.nan_to_num(grams) - across.transpose(0, 2, 1) @ across
            found, rank, sizes = joint(left, given.shown[columns], self.policy.unseen)
            size = np.linalg.norm(sizes / self.norm[columns], axis=1)
            statistic[which] = np.where(size <= self.hypotheses.most[which], found, 0.0)
            degrees[which] = rank
        for i in self._off(self._blocks, alone) if blocks else ():
            own = self.hypotheses.of(i)
            if i not in self._grams:
                self._grams[i] = self._columns.gram(self.linear, own)
            basis = given.basis(own)
            left = self._grams[i] - basis.T @ basis
            found, rank, _ = joint(left[None], given.shown[own][None], self.policy.unseen)
            statistic[i], degrees[i] = found[0], rank[0]
        statistic[list(skip)] = 0.0
        limits = np.full(int(degrees.max(initial=1)) + 1, np.inf)
        for some in set(degrees.tolist()):
            limits[some] = self.limit(some)
        return Tested(statistic, limits[degrees], np.asarray(self.scale * degrees, np.float64))

    def _alone(self, given: Given) -> FloatArray:
        """(k,) T of each column alone."""
        weight = self._left_of_weights(given)
        seen = weight > self.policy.unseen
        return np.where(seen, given.shown**2 / np.where(seen, weight, 1.0), 0.0)

    def _left_of_weights(self, given: Given) -> FloatArray:
        """(k,) M of each column alone, the accepted hypotheses being unknowns."""
        self._weigh(given.shown)
        return np.asarray(np.nan_to_num(self._weight) - given.squares)

    def within(self, chosen: Sequence[int], index: int) -> IntArray:
        """Hypotheses of one column that are no more than special cases of one of several columns."""
        rest = [i for i in chosen if i != index]
        seen = [self._left_of_weights(self.given(who)) > self.policy.unseen for who in (rest, chosen)]
        return self._single[(seen[0] & ~seen[1])[self._at_single]]

    def standing_out(self, among: BoolArray) -> list[int]:
        """Blocks among some hypotheses (h,) most of whose rows are off where nothing is accepted."""
        return self._off(self._blocks[among[self._blocks]], self._alone(self.given(())))

    def _off(self, blocks: IntArray, alone: FloatArray) -> list[int]:
        """Blocks most of whose rows are off; of a large model the worst, as far as a selection begins."""
        if not blocks.size:
            return []
        least = max(np.sqrt(self.limit(1)) - 1.0, 0.0) ** 2
        count = self.hypotheses.counts(alone[self.hypotheses.columns] > least)
        need = np.maximum(2, self.policy.whole * self.hypotheses.q)
        found = blocks[count[blocks] >= need[blocks]]
        if self._is_screened:
            found = found[np.argsort(-count[found], kind="stable")]
            before = np.cumsum(self.hypotheses.q[found]) - self.hypotheses.q[found]
            found = found[before < self.policy.begun]
        return list(map(int, found))

    def one_for_several(self, chosen: Sequence[int]) -> list[int]:
        """Some hypotheses, with one row in place of several of them that hide it: the one that explains most.

        A row that nothing checks once they are accepted may be wrong in their place.
        """
        given, own = self.given(chosen), self._own_columns(chosen)
        weight, unseen = np.nan_to_num(self._weight), self.policy.unseen
        is_hidden = (weight > unseen) & (weight - given.squares <= unseen)
        rows = [i for i in self._single[is_hidden[self._at_single]].tolist() if i not in set(chosen)]
        rows = [i for i in rows if self.hypotheses.is_start[i]]
        columns = self.hypotheses.columns[self.hypotheses.starts[rows]]
        across = np.array([self._across[k][columns] for k in own.tolist()]).reshape(len(own), len(rows))
        parts = np.abs(np.linalg.pinv(self._gram(own), unseen, hermitian=True) @ across)
        is_part = parts > self.policy.share * parts.max(axis=0, initial=0.0)
        now, others = list(chosen), list[int]()
        for k in np.argsort(-(self.shown[columns] ** 2) / weight[columns], kind="stable").tolist():
            held = set(own[is_part[:, k]].tolist())
            instead = [i for i in now if not held.isdisjoint(self.hypotheses.of(i).tolist())]
            if len(instead) > 1:
                now, others = [i for i in now if i not in instead], [*others, rows[k]]
        return [*now, *others]

    def rank(self, index: int) -> int:
        """Degrees of freedom of a hypothesis alone."""
        if self.hypotheses.q[index] == 1:
            return 1
        if index not in self._ranks:
            own = self.hypotheses.of(index)
            shares = np.linalg.eigvalsh(self._gram(own))
            self._ranks[index] = max(int(np.count_nonzero(shares > self.policy.unseen)), 1)
        return self._ranks[index]

    def inverse(self, chosen: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Estimates and covariance of sizes together, in lengths of columns."""
        own = np.concatenate([self.hypotheses.of(i) for i in chosen])
        shares, axes = np.linalg.eigh(self._gram(own))
        seen = shares > self.policy.unseen
        covariance = (axes[:, seen] / shares[seen]) @ axes[:, seen].T
        return covariance @ self.shown[own], covariance

    def each(self, chosen: Sequence[int]) -> list[float]:
        """T of each of some hypotheses, the others being given; 0 of what these do as well."""
        own = np.concatenate([self.hypotheses.of(i) for i in chosen])
        shares, axes = np.linalg.eigh(self._gram(own))
        covariance = (axes / np.maximum(shares, _NOTHING)) @ axes.T
        estimates, spread = covariance @ self.shown[own], np.diag(covariance)
        alone = np.where(spread * self.policy.unseen < 1.0, estimates**2 / spread, 0.0)
        found, start = [], 0
        for i in chosen:
            part = slice(start, start := start + int(self.hypotheses.q[i]))
            if part.stop - part.start == 1:
                found.append(float(alone[part.start]))
                continue
            spreads, along = np.linalg.eigh(covariance[part, part])
            seen = spreads * self.policy.unseen < 1.0
            found.append(float(np.sum(np.square(estimates[part] @ along[:, seen]) / spreads[seen])))
        return found

    def sizes(self, chosen: Sequence[int]) -> dict[int, tuple[FloatArray, FloatArray]]:
        """Estimates and standard deviations (q,) of chosen hypotheses together, in their units."""
        if not len(chosen):
            return {}
        estimates, covariance = self.inverse(chosen)
        spread, found, start = np.sqrt(np.maximum(np.diag(covariance), 0.0)), {}, 0
        for i in chosen:
            own = self.hypotheses.of(i)
            part = slice(start, start + len(own))
            found[int(i)] = estimates[part] / self.norm[own], spread[part] / self.norm[own]
            start += len(own)
        return found

    def is_small(self, index: int, chosen: Sequence[int]) -> bool:
        """Whether an effect that equations share is not proved to change any of them by a sigma.

        What is left of it without the limit of its test is compared. Of a single error, this limit is what
        tells it from noise, which is as large as a sigma by itself.

        Args:
            index: One of the hypotheses.
            chosen: All that are accepted together.
        """
        if self.hypotheses.is_start[index] or self.hypotheses.is_block[index]:
            return False
        rest, own = [i for i in chosen if i != index], self.hypotheses.of(index)
        test = self.took(chosen) - self.took(rest)
        estimates, _ = self.inverse([*rest, index])
        effect = np.abs(self._columns.effect(own, estimates[-len(own) :])).max()
        proved = 1.0 - min(self.limit(self.rank(index)) / max(test, _TINY), 1.0) ** 0.5
        return bool(effect * proved < self.policy.least)

    def due(self, chosen: Sequence[int]) -> float:
        """What hypotheses must take away to be believed: the limit of the test of each, and its rarity.

        And what they take of the noise: one square for each degree of freedom. Else a whole image would be
        cheaper than one of its points.
        """
        ranks = {i: self.rank(i) for i in chosen}
        return float(sum(self.limit(q) + self.scale * q + self.rarity[i] for i, q in ranks.items()))

    def price(self, chosen: Sequence[int]) -> float:
        """What remains with hypotheses accepted, and what is due for them."""
        return self.cost - self.took(chosen) + self.due(chosen)


@lru_cache
def _level(false_alarm: float, power: float, tests: tuple[tuple[int, int], ...]) -> float:
    """Level of the test of one equation, all tests together having one: degrees of freedom, and how many.

    Rounded, as the numbers of tests are, so that limits are computed once for models of like size.
    """
    return float(f"{shared_level(false_alarm, dict(tests or ((1, 1),)), power):.1e}")


def _parts(which: IntArray, most: int) -> list[IntArray]:
    """Numbers of columns, some at a time."""
    return [which[first : first + most] for first in range(0, len(which), most)]
