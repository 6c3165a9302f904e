"""The test that fails most: of a vector or position as a whole, of an observation, of a known coordinate."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

from obseq.dataclass import dataclass
from obseq.printable import listed
from obseq.records.adjustment import AdjustmentRecord, ConstraintRecord, JointTestRecord, ObservationRecord
from obseq.records.quality import KNOWN

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from obseq.arrays import BoolArray, FloatArray
    from obseq.records.rows import AnyRows

_Item: TypeAlias = JointTestRecord | ObservationRecord | ConstraintRecord

_MOST_NAMED = 5
_SAME = 1e-6
"""Share to which two tests agree that cannot be told apart."""


@dataclass(frozen=True)
class Worst:
    """The test that is farthest beyond its limit.

    Attributes:
        name: What is tested, and where it was read; several where they cannot be told apart.
        found: The statistic in words.
        limit: Its limit in words.
        square: Leaving it out lowers the weighted sum of squares by so much.
        critical: Limit of that.
        degrees: Degrees of freedom.
        type: Whose residuals it speaks for; empty for all.
    """

    name: str
    found: str
    limit: str
    square: float
    critical: float
    degrees: int
    type: str = ""

    @property
    def is_beyond(self) -> bool:
        """Whether the test fails."""
        return self.square > self.critical

    @property
    def sentence(self) -> str:
        """What to look at first, of which chance may be the reason too."""
        return (
            f"Without {self.name} the test would pass (its {self.found}, the limit {self.limit}): check it "
            "first."
        )


def worst_test(record: AdjustmentRecord) -> Worst | None:
    """The test farthest beyond its limit, or nearest to it; None where nothing is tested."""
    shares = [*_of_joint(record), *_of_single(record)]
    if not shares:
        return None
    largest = max(share for share, _ in shares)
    same = [item for share, item in shares if share >= largest * (1.0 - _SAME)]
    tests = [_worst(item, record) for item in same]
    return replace(tests[0], name=one_of(tuple(test.name for test in tests)))


def one_of(names: tuple[str, ...]) -> str:
    """The names, if they are many the first."""
    return names[0] if len(names) == 1 else f"one of {listed(names, _MOST_NAMED)}"


def _of_joint(record: AdjustmentRecord) -> Iterator[tuple[float, _Item]]:
    """Tests of vectors and positions as a whole, each with its share of its limit."""
    return ((item.statistic / item.critical, item) for item in record.joint if item.degrees)


def _of_single(record: AdjustmentRecord) -> Iterator[tuple[float, _Item]]:
    """The same of single values that are no part of these."""
    if record.reliability is None:
        return
    limit, rows = record.reliability.critical, record.observations
    tests, active = rows.numbers("standardised_residual"), rows.truths("active")
    active[[row for item in record.joint for row in item.rows]] = False
    yield from _largest(rows, tests, active, limit)
    positions = {item.what for item in record.joint}
    alone = [f"{KNOWN}position of {name}" not in positions for name in record.constraints.values("point")]
    tests = record.constraints.numbers("standardised_residual")
    yield from _largest(record.constraints, tests, alone, limit)


def _largest(
    rows: AnyRows, tests: FloatArray, chosen: Sequence[bool] | BoolArray, limit: float
) -> Iterator[tuple[float, _Item]]:
    """The largest of some tests, with all that cannot be told apart from it."""
    import numpy as np

    shares = np.where(chosen, np.square(tests / limit), np.nan)
    largest = np.nanmax(shares, initial=-1.0)
    for row in np.flatnonzero(shares >= largest * (1.0 - _SAME)).tolist():
        yield float(shares[row]), rows[row]


def _worst(item: _Item, record: AdjustmentRecord) -> Worst:
    if isinstance(item, JointTestRecord):
        found = f"T is {item.statistic:.1f}"
        return Worst(item.name, found, f"{item.critical:.1f}", item.statistic, item.critical, item.degrees)
    assert record.reliability is not None
    w, limit = item.standardised_residual or 0.0, record.reliability.critical
    if isinstance(item, ConstraintRecord):
        name, kind = f"{KNOWN}{item.coordinate} of {item.point}", KNOWN
    else:
        name, kind = f"{item.type} {item.origin} -> {item.target}", item.type
    place = f" ({item.file}:{item.line})" if item.file else ""
    found = f"standardised residual is {w:.2f}"
    return Worst(f"{name}{place}", found, f"{limit:.2f}", w**2, limit**2, 1, kind)
