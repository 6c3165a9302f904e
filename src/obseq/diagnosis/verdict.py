"""What a diagnosis says."""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING

from obseq.dataclass import dataclass

if TYPE_CHECKING:
    from obseq.diagnosis.protocol import Change, Slip

ASTRAY = "no adjustment without what may be wrong converges"
UNDETERMINED = "the observations leave some unknowns undetermined, so that nothing can be tested"


class Status(enum.StrEnum):
    """How a diagnosis ends."""

    ACCEPTED = "accepted"
    EXPLAINED = "explained"
    UNEXPLAINED = "unexplained"
    UNDECIDED = "undecided"


@dataclass(frozen=True, eq=False)
class Alternative:
    """Another explanation of one error, which nothing tells from the best.

    Attributes:
        change: The hypothesis and how large the error is.
        test: T of it.
    """

    change: Change
    test: float


@dataclass(frozen=True, eq=False)
class Accusation:
    """One error.

    Attributes:
        change: The hypothesis that explains it best, and how large the error is.
        test: T, given the other accusations.
        limit: K.
        others: What nothing tells from it.
        slips: What may be behind it.
    """

    change: Change
    test: float
    limit: float
    others: tuple[Alternative, ...] = ()
    slips: tuple[Slip, ...] = ()


@dataclass(frozen=True, eq=False)
class Verdict:
    """What is wrong with a model.

    Attributes:
        status: Whether nothing, something, or something unknown is wrong.
        accused: The errors, the clearest first.
        left: Weighted sum of squares that the accusations leave.
        redundancy: Its degrees of freedom.
        remarks: Effects that many observations show together, none of which they change by a sigma.
        reason: Why nothing was decided, or what was not tried; "" for nothing to say.
        many: How many errors were found where they are too many to be told one by one; 0 elsewhere.
    """

    status: Status
    accused: tuple[Accusation, ...] = ()
    left: float = 0.0
    redundancy: int = 0
    reason: str = ""
    remarks: tuple[Accusation, ...] = ()
    many: int = 0
