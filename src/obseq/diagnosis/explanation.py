"""An explanation of what is wrong with a model, and how two of them compare."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic

from obseq.dataclass import dataclass
from obseq.diagnosis.protocol import Change, Place
from obseq.leastsquares.statistics.distributions import chi_square_limit

if TYPE_CHECKING:
    from obseq.diagnosis.linear_tests import LinearTests
    from obseq.diagnosis.policy import Policy


@dataclass(frozen=True, eq=False)
class Explanation(Generic[Place]):
    """Hypotheses that explain a model, at the place where it is adjusted with them.

    Attributes:
        price: What remains, and what is due for them.
        tests: At that place.
        chosen: The hypotheses.
        place: Where the unknowns are.
        same: Other changes that explain as much, adjusted as what they are: with how much each takes.
        is_told: Whether it was asked if slips explain blocks in place of their rows.
    """

    price: float
    tests: LinearTests
    chosen: tuple[int, ...]
    place: Place
    same: tuple[tuple[Change, float], ...] = ()
    is_told: bool = False

    @property
    def left(self) -> float:
        """Weighted sum of squares that they leave."""
        return self.tests.cost - self.tests.took(self.chosen)

    @property
    def redundancy(self) -> int:
        """Degrees of freedom of that."""
        return self.tests.linear.redundancy - sum(map(self.tests.rank, self.chosen))

    @property
    def is_accepted(self) -> bool:
        """Whether the overall test accepts what remains."""
        return self.left <= accepted(self.redundancy, self.tests.policy)


def accepted(redundancy: int, policy: Policy) -> float:
    """Sum of squares up to which the overall test accepts."""
    return chi_square_limit(max(redundancy, 1), above=policy.false_alarm)


def change_of(tests: LinearTests, index: int) -> Change:
    """A hypothesis alone, with its size."""
    return Change(index, *tests.sizes([index])[index])


def better(best: Explanation[Place] | None, found: Explanation[Place] | None) -> Explanation[Place] | None:
    """The cheaper of two; the first of equals."""
    if best is None or found is None:
        return found if best is None else best
    return found if found.price < best.price - 1e-6 * (1.0 + abs(best.price)) else best


def with_equals(found: list[Explanation[Place]], policy: Policy) -> Explanation[Place]:
    """The first of explanations, with those that are as good, computed as what they are."""
    best, same = found[0], []
    for other in found[1:]:
        if len(other.chosen) == 1 == len(best.chosen) and other.price < best.price + policy.margin:
            change = change_of(other.tests, other.chosen[0])
            if change.index != best.chosen[0]:
                same.append((change, best.tests.cost - other.left))
    return Explanation(best.price, best.tests, best.chosen, best.place, tuple(same))
