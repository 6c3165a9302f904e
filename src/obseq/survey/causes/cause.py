"""What a cause is: where it may be, which observations it changes, and by how much."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IndexArray, IntArray
from obseq.dataclass import dataclass
from obseq.survey.causes.effects import Effects
from obseq.survey.causes.notes import Notes
from obseq.survey.model import FieldBook, Points


@dataclass(frozen=True, eq=False)
class Scope:
    """What observations share that one mistake concerns: a set-up, a file, a point.

    Attributes:
        name: Stable name, such as "file".
        labels: Number of what each observation is of; negative for none.
        words: What one of them is called.
        about: What it is, for pages.
    """

    name: str
    labels: Callable[[Notes], IntArray]
    words: Callable[[Notes, int, IntArray], str]
    about: str


@dataclass(frozen=True, eq=False)
class Groups:
    """Groups of observations.

    Attributes:
        scope: What those of a group share.
        starts: (h + 1,) where the rows of each begin in `rows`.
        rows: Of the field book.
        labels: (h,) number of what they share.
    """

    scope: Scope
    starts: IntArray
    rows: IntArray | IndexArray
    labels: IntArray

    def __len__(self) -> int:
        return len(self.labels)

    def of(self, k: int) -> IntArray:
        """Rows of one of them."""
        return self.rows[self.starts[k] : self.starts[k + 1]].astype(np.int64)


@dataclass(frozen=True, eq=False)
class Cause:
    """A kind of mistake.

    Attributes:
        code: Stable code, such as "S120"; its meaning never changes.
        name: In one or two words.
        about: What it means, in a sentence.
        example: How it comes about.
        remedy: What to do.
        unit: Of its size: "m", "rad", or "" for a ratio.
        rarity: Twice the logarithm of how much rarer than one wrong reading it is.
        scopes: Where it may be.
        takes: Which observations it changes.
        effect: What one unit of it adds to computed minus observed, (n,), or (n, parts); None where each
            observation has an error of its own.
        least: Observations that it concerns at least.
        needs_slip: Whether it is told only with a slip that explains it.
        is_bent: Whether the effect of a large error is far from linear.
        is_one: Whether its observations are one observation of several components.
        groups: Its groups, where those of the scopes are not what is wanted.
        parts: What its sizes are called, where it has several.
        most: Length of these beyond which it is another mistake.
    """

    code: str
    name: str
    about: str
    example: str
    remedy: str
    unit: str
    rarity: float
    scopes: tuple[Scope, ...]
    takes: Callable[[Notes], BoolArray]
    effect: Callable[[Effects], FloatArray] | None = None
    least: int = 2
    needs_slip: bool = False
    is_bent: bool = False
    is_one: bool = False
    groups: Callable[[Cause, Notes, BoolArray], list[Groups]] | None = None
    parts: tuple[str, ...] = ()
    most: float = math.inf

    @property
    def width(self) -> int:
        """How many sizes it has."""
        return max(len(self.parts), 1)

    def where(self, notes: Notes, active: BoolArray) -> list[Groups]:
        """All groups in which it may be."""
        if self.groups is not None:
            return self.groups(self, notes, active)
        mask = active & self.takes(notes)
        return [grouped(scope, scope.labels(notes), mask, self.least) for scope in self.scopes]


@dataclass(frozen=True, eq=False)
class KnownCause:
    """A kind of mistake that all known coordinates share.

    Attributes:
        code, name, about, example, remedy, unit, rarity, parts: As of `Cause`.
        takes: Components (0 to 2) that it changes.
        effect: Coordinates (k, 3) about their centre (m), components (k,), and the curvature (1/m) of what
            the map is of -> (k, parts) by how much one unit makes each too large (m).
        least: Points that it concerns at least.
    """

    code: str
    name: str
    about: str
    example: str
    remedy: str
    unit: str
    rarity: float
    takes: tuple[int, ...]
    effect: Callable[[FloatArray, IntArray, float], FloatArray]
    parts: tuple[str, ...] = ()
    least: int = 3

    @property
    def width(self) -> int:
        """How many sizes it has."""
        return max(len(self.parts), 1)


@dataclass(frozen=True, eq=False)
class Rewritten:
    """A network as it would be without such a mistake.

    Attributes:
        code, slip, what, text: As in the result.
        rows: Observations that it concerns.
        known: Known points that it concerns.
        points, book: The network without it.
        told: Places of all points (n, 3) without it -> more words; None where they say that it is not that.
    """

    code: str
    slip: str
    what: str
    text: str
    rows: IntArray
    known: IntArray
    points: Points
    book: FieldBook
    told: Callable[[FloatArray], str | None] = lambda _: ""

    @property
    def count(self) -> int:
        """How many values it concerns: observations, and points."""
        return len(self.rows) + 3 * len(self.known)


def grouped(scope: Scope, labels: IntArray, mask: BoolArray, least: int) -> Groups:
    """The groups of observations (a mask) of one label, of some at least."""
    rows = np.flatnonzero(mask & (labels >= 0)).astype(np.int32)
    rows = rows[np.argsort(labels[rows], kind="stable")]
    own = labels[rows]
    firsts = np.flatnonzero(np.append(True, np.diff(own) != 0)) if len(own) else np.zeros(0, np.int64)
    counts = np.diff(np.append(firsts, len(own)))
    kept = counts >= least
    which = np.repeat(kept, counts)
    return Groups(scope, np.append(0, np.cumsum(counts[kept])), rows[which], own[firsts[kept]])
