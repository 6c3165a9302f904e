"""Which hypotheses together explain a model at one linearisation: selection by what they cost.

Their price is what they leave of the squares, the limit of the test of each, and how rare it is. Backward
elimination, forward selection, exchanges (errors that mask each other) and blocks in place of their rows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import IntArray
    from obseq.diagnosis.given import Tested
    from obseq.diagnosis.linear_tests import LinearTests

_TOLERANCE = 1e-6
"""Relative difference of prices that is rounding."""


def select(
    tests: LinearTests, first: Sequence[int] = (), *, rows_only: bool = False, most: int | None = None
) -> list[int]:
    """Hypotheses that explain a model, from some to begin with.

    Args:
        tests: At one linearisation.
        first: Where the selection begins.
        rows_only: Leave out what concerns several observations.
        most: How many; as the policy says, if it is not given.
    """
    chosen, most = list(first), most or tests.policy.most
    for _ in range(3 * most):
        chosen = kept(tests, chosen)
        found = tests.tests(tests.given(chosen), chosen, blocks=False)
        gain = gains(tests, found)
        if rows_only:
            gain[~tests.hypotheses.is_start] = -np.inf
        best = int(np.argmax(gain)) if len(gain) else -1
        if best < 0 or not np.isfinite(gain[best]) or len(chosen) >= most:
            break
        chosen.append(best)
    return simplified(tests, merged(tests, exchanged(tests, chosen)))


def gains(tests: LinearTests, found: Tested) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """(h,) by how much each hypothesis lowers the price; minus infinity where it does not."""
    gain = found.statistic - found.limit - found.noise - tests.rarity
    return np.where(gain > 0.0, gain, -np.inf)


def equals(tests: LinearTests, found: Tested, index: int) -> list[int]:
    """What nothing tells from a hypothesis, the best first; not what holds all of it and more.

    Args:
        tests: At one linearisation.
        found: T of all, the other accepted hypotheses being given.
        index: The hypothesis.
    """
    gain = gains(tests, found)
    own = found.statistic[index] - found.limit[index] - found.noise[index] - tests.rarity[index]
    near = np.flatnonzero(gain >= own - tests.policy.margin)
    mine = set(tests.hypotheses.of(index).tolist())
    ordered = near[np.argsort(-gain[near], kind="stable")].tolist()
    told = ~tests.hypotheses.needs_slip
    return [j for j in ordered if j != index and told[j] and not mine <= set(tests.hypotheses.of(j).tolist())]


def kept(tests: LinearTests, chosen: Sequence[int]) -> list[int]:
    """Those of some hypotheses that are worth what is due for them: backward elimination."""
    left = list(chosen)
    while left:
        shares = [statistic / tests.due([i]) for i, statistic in zip(left, tests.each(left), strict=True)]
        worst = int(np.argmin(shares))
        if shares[worst] > 1.0:
            break
        left.pop(worst)
    return left


def exchanged(tests: LinearTests, chosen: Sequence[int]) -> list[int]:
    """The same after exchanges of one for another that lower the price."""
    now = list(chosen)
    for _ in range(tests.policy.exchanges):
        price, better = tests.price(now), None
        for i in now if _are_few(tests, now) else ():
            rest = [j for j in now if j != i]
            given = tests.given(rest)
            found = tests.tests(given, rest, blocks=bool(tests.hypotheses.is_block[i]))
            prices = tests.cost - tests.took(rest) + tests.due(rest) - gains(tests, found)
            j = int(np.argmin(prices))
            if j != i and is_less(float(prices[j]), price):
                price, better = float(prices[j]), [*rest, j]
        if better is None:
            return now
        now = kept(tests, better)
    return now


def is_less(price: float, other: float) -> bool:
    """Whether a price is lower than another by more than rounding."""
    return price < other - _TOLERANCE * (1e3 + abs(other))


def _are_few(tests: LinearTests, chosen: Sequence[int]) -> bool:
    """Whether exchanges of hypotheses are worth their time: not of whole images."""
    return len(chosen) < tests.policy.most and tests.hypotheses.q[chosen].sum() <= tests.policy.begun


def merged(tests: LinearTests, chosen: Sequence[int]) -> list[int]:
    """The same where a block takes the place of most of its rows, and costs less."""
    now = list(chosen)
    for _ in range(tests.policy.most if len(now) > 1 else 0):
        price, better = tests.price(now), None
        for block in _mostly(tests, now):
            if tests.hypotheses.needs_slip[block] or block in now:
                continue
            other = [*(i for i in now if i not in inside(tests, now, block)), block]
            if (found := tests.price(other)) < price:
                price, better = found, other
        if better is None:
            return now
        now = better
    return now


def simplified(tests: LinearTests, chosen: Sequence[int]) -> list[int]:
    """The same with a special case of one column in place of several, where nothing contradicts that."""
    now = list(chosen)
    if not _are_few(tests, now):
        return now
    for i in [i for i in now if tests.hypotheses.q[i] > 1]:
        special = tests.within(now, i)
        if not special.size:
            continue
        rest = [j for j in now if j != i]
        taken = tests.tests(tests.given(rest), rest, blocks=False).statistic[special]
        other = [*rest, int(special[np.argmax(taken)])]
        if tests.price(other) < tests.price(now) + tests.policy.margin:
            now = other
    return now


def _mostly(tests: LinearTests, chosen: Sequence[int]) -> list[int]:
    """Blocks most of whose rows are among what is chosen: they have nothing else of their own to show."""
    hypotheses = tests.hypotheses
    blocks = np.flatnonzero(hypotheses.is_block & tests.is_solved)
    if not blocks.size:
        return []
    inner = _held(tests, chosen)
    some = blocks[inner[blocks] >= np.maximum(2, tests.policy.whole * hypotheses.q[blocks])]
    return [j for j in some.tolist() if hypotheses.q[inside(tests, chosen, j)].sum() >= needed(tests, j)]


def _held(tests: LinearTests, chosen: Sequence[int]) -> IntArray:
    """(h,) how many columns of each hypothesis some hypotheses have."""
    hypotheses, mask = tests.hypotheses, np.zeros(len(tests.shown), np.bool_)
    mask[np.concatenate([hypotheses.of(i) for i in chosen])] = True
    return hypotheses.counts(mask[hypotheses.columns])


def for_a_slip(tests: LinearTests, chosen: Sequence[int]) -> list[list[int]]:
    """Selections with a block in place of what it makes needless, that cost less, the cheapest first.

    A block such as a name is told only where a slip explains it. Its rows may be told as other errors: of two
    sights to a point either may be the wrong one.
    """
    hypotheses = tests.hypotheses
    if not len(chosen) or (len(chosen) == 1 and not hypotheses.is_block[chosen[0]]):
        return []
    touched = _held(tests, chosen) > 0
    touched[list(chosen)] = False
    price, others = tests.price(chosen), []
    for j in tests.standing_out(touched):
        own = set(hypotheses.of(j).tolist())
        rest = [i for i in chosen if own.isdisjoint(hypotheses.of(i).tolist())]
        other = kept(tests, [*rest, j])
        others += [other] if j in other and tests.price(other) < price else []
    return sorted(others, key=tests.price)


def needed(tests: LinearTests, block: int) -> float:
    """How many rows of a block must be off."""
    return max(2.0, tests.policy.whole * float(tests.hypotheses.q[block]))


def inside(tests: LinearTests, chosen: Sequence[int], block: int) -> list[int]:
    """Those of some hypotheses all of whose columns a block has."""
    own = set(tests.hypotheses.of(block).tolist())
    return [i for i in chosen if i != block and set(tests.hypotheses.of(i).tolist()) <= own]


def suspects(tests: LinearTests) -> list[int]:
    """Rows that a robust place contradicts, the worst first: where backward elimination begins."""
    which = np.flatnonzero(tests.hypotheses.is_start)
    off = np.abs(tests.off[tests.hypotheses.columns])
    worst = np.maximum.reduceat(off, tests.hypotheses.starts[:-1])[which] if len(off) else np.zeros(0)
    order = np.argsort(-worst, kind="stable")
    which = which[order][worst[order] > tests.policy.suspect]
    return list(map(int, which[: tests.policy.begun]))


def suspected_blocks(tests: LinearTests, *, for_a_slip: bool = False) -> list[int]:
    """Blocks most of whose rows a robust place contradicts, those with most first; or those for a slip."""
    hypotheses = tests.hypotheses
    count = hypotheses.counts(np.abs(tests.off[hypotheses.columns]) > tests.policy.suspect)
    is_told = hypotheses.is_block & (hypotheses.needs_slip == for_a_slip) & tests.is_solved
    which = np.flatnonzero(is_told & (count >= np.maximum(2.0, tests.policy.whole * hypotheses.q)))
    which = which[np.argsort(-count[which], kind="stable")]
    left = np.cumsum(hypotheses.q[which]) < tests.policy.half * tests.linear.redundancy
    return list(map(int, which[left]))
