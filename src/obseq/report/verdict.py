"""What the test of sigma0 says, in words; and which observations fit worst."""

from collections.abc import Iterator
from dataclasses import replace

from msgspec import structs

from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.records.adjustment import (
    AdjustmentRecord,
    GlobalTestRecord,
    StatisticsRecord,
)
from obseq.report.worst_test import Worst, one_of, worst_test

TOO_LARGE = "Look for a blunder among the worst residuals, for a wrong known point, or for sigmas too small."
TOO_SMALL = "The sigmas are too large, or observations that depend on each other were given as independent."
PRECISIONS = {
    "a posteriori": "Precisions are scaled by it: beware of them where redundancy is low (--a-priori: not).",
    "a priori": "Precisions are those of the given sigmas.",
}
"""What a sigma0 that is too small does to precisions."""
_LEAST_REDUNDANCY = 3.0
"""Redundancy of a type below which small residuals say nothing of its sigmas."""
LEAST = 0.001
"""Factor of sigmas below which residuals show the rounding of the values."""


@dataclass(frozen=True)
class Verdict:
    """The chi-square test of sigma0 in words."""

    record: AdjustmentRecord

    @property
    def test(self) -> GlobalTestRecord | None:
        """The test; None when nothing is redundant, or in records of obseq 0.1.0, which did not hold it."""
        return self.record.global_test

    @property
    def spoilt(self) -> int:
        """How many of the gross errors take part in the adjustment: snooping left out the others."""
        gone = {item.observation for item in self.record.rejections}
        return sum(item.what not in gone for item in self.record.gross_errors)

    @property
    def types_beyond(self) -> list[StatisticsRecord]:
        """The types of observations whose sigmas the residuals contradict, the worst first.

        Wrong weights of one type spoil the residuals of others too: types that are out by less than the
        root of the worst factor wait until that is mended. None while gross errors are suspected, which
        decide then what the residuals of each type are; what the worst test that fails explains is taken off.
        """
        if self.spoilt:
            return []
        rows = [row for row in self.record.types or () if _is_beyond(row)]
        if rows:
            rows = list(filter(_is_beyond, self._less_explained(rows)))
        found = sorted(rows, key=lambda row: -_times(row))
        return [row for row in found if _times(row) >= _times(found[0]) ** 0.5]

    def _less_explained(self, rows: list[StatisticsRecord]) -> Iterator[StatisticsRecord]:
        """Types less the part of their residuals that the worst test explains."""
        if (worst := self.worst) is not None:
            yield from (_without(row, worst.square) if worst.type in ("", row.name) else row for row in rows)
        else:
            yield from rows

    @cached_property
    def worst(self) -> Worst | None:
        """The vector, position or single value without which sigma0 is accepted; None where none explains it.

        It speaks for the residuals of all types where sigma0 was rejected before, or where it is a vector,
        else for those of its own type.
        """
        worst = worst_test(self.record)
        rest = self.record.redundancy - (worst.degrees if worst else 0)
        if worst is None or self.test is None or not worst.is_beyond or rest <= 0:
            return None
        squares = self.test.sigma0**2 * self.record.redundancy - worst.square
        if (max(squares, 0.0) / rest) ** 0.5 > self.test.upper:
            return None
        return replace(worst, type="") if self.test.sigma0 > self.test.upper else worst

    @property
    def explanation(self) -> str:
        """What to look at where sigma0 is not as expected; empty elsewhere."""
        if self.test is None or self.test.passed or self.spoilt:
            return ""
        if self.test.sigma0 < self.test.upper:
            return f"{TOO_SMALL} {PRECISIONS.get(self.record.precision or '', '')}".rstrip()
        if self.record.redundancy == 1:
            return _of_one_condition(self.record, self.test.sigma0) or TOO_LARGE
        return TOO_LARGE if self.worst is None else f"{TOO_LARGE} {self.worst.sentence}"


def _of_one_condition(record: AdjustmentRecord, misclosure: float) -> str:
    """What fails where a single condition, of a loop say, checks all; empty where its parts are not known."""
    tests = record.observations.numbers("standardised_residual")
    within = record.observations.take((abs(tests) > 0.5 * misclosure).nonzero()[0])
    names = tuple(f"{row.type} {row.origin} -> {row.target} ({row.file}:{row.line})" for row in within)
    if not names:
        return ""
    known = " or a known coordinate" if record.constraints else ""
    return (
        f"One condition checks all of them, and its misclosure is {misclosure:.3g} times what the sigmas "
        f"announce. An error in {one_of(names)}{known} explains it, and nothing tells these apart; or the "
        "sigmas are too small."
    )


def _without(row: StatisticsRecord, explained: float) -> StatisticsRecord:
    """A type whose residuals are too large, less the part of their squares that one gross error explains."""
    if row.sigma_factor is None or row.upper is None or not row.redundancy or row.sigma_factor <= row.upper:
        return row
    rest = max(row.sigma_factor**2 - explained / row.redundancy, 0.0) ** 0.5
    return (
        structs.replace(row, sigma_factor=rest)
        if rest > row.upper
        else structs.replace(row, sigma_factor=None)
    )


def _is_beyond(row: StatisticsRecord) -> bool:
    """Whether the residuals contradict the sigmas; small ones do with enough redundancy only."""
    if row.sigma_factor is None or row.lower is None or row.upper is None:
        return False
    is_small = row.sigma_factor < row.lower and (row.redundancy or 0.0) >= _LEAST_REDUNDANCY
    return is_small or row.sigma_factor > row.upper


def _times(row: StatisticsRecord) -> float:
    """How many times too large or too small the sigmas of a type look."""
    factor = max(row.sigma_factor or 0.0, LEAST)
    return max(factor, 1.0 / factor)
