"""Mistakes that a whole block shares: the block is changed in one thing, and must fit then.

No column says what they do: an axis, a unit, a focal length far off change where iterations lead. They are
tried where single errors explain nothing and enough is left for them to explain.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from obseq.dataclass import dataclass
from obseq.images.adjustment.adjustable import AdjustableBlock
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.poses import Poses


@dataclass(frozen=True, eq=False)
class Subject:
    """A block in which something is wrong.

    Attributes:
        block: as it is adjusted; it does not change.
        given: its poses before others were found.
        solution: of it; None where it has none.
    """

    block: AdjustableBlock
    given: Poses
    solution: BundleSolution | None


@dataclass(frozen=True)
class Told:
    """What is wrong with a block, as a solution of the changed one tells it.

    Attributes:
        said: in words; empty where it is not this.
        images: that it concerns, by name.
        code: of what it turned out to be; empty for that of the cause.
        likelier: squares by which something else than residuals speaks for it.
    """

    said: str
    images: tuple[str, ...] = ()
    code: str = ""
    likelier: float = 0.0


@dataclass(frozen=True, eq=False)
class Trial:
    """A changed block.

    Attributes:
        what: what is changed, for progress.
        block: the changed one.
        told: what a solution of it tells.
        then: the changes that a solution of it suggests, where it leaves observations out: a mistake is
            judged with all of them.
    """

    what: str
    block: AdjustableBlock
    told: Callable[[BundleSolution], Told]
    then: Callable[[BundleSolution], Iterable[Trial]] | None = None

    @classmethod
    def saying(cls, what: str, told: Told, block: AdjustableBlock) -> Trial:
        """A changed block that tells the same whatever its solution is."""
        return cls(what, block, lambda found: told)


@dataclass(frozen=True, eq=False)
class SharedCause:
    """A kind of mistake of a whole block.

    Attributes:
        code: stable code, such as "I150"; its meaning never changes.
        name: in one or two words.
        about: what it means, in a sentence.
        example: how it comes about.
        remedy: what to do.
        rarity: twice the logarithm of how much rarer than one wrong image point it is.
        trials: the changed blocks.
        is_of_good: whether a block that fits may have it.
        is_sure: whether more than residuals speaks for it: where it explains all, nothing else is tried.
    """

    code: str
    name: str
    about: str
    example: str
    remedy: str
    rarity: float
    trials: Callable[[Subject], Iterator[Trial]]
    is_of_good: Callable[[Subject], bool] = lambda subject: False
    is_sure: bool = False
