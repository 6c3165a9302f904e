"""What the test of sigma0 says, in words; and which observations fit worst."""

from dataclasses import dataclass

from obseq.record import AdjustmentRecord, ConstraintRecord, GlobalTestRecord, ObservationRecord


@dataclass(frozen=True)
class Verdict:
    """The chi-square test of sigma0 in words."""

    record: AdjustmentRecord

    @property
    def test(self) -> GlobalTestRecord | None:
        """The test; None when nothing is redundant, or in records of obseq 0.1.0, which did not hold it."""
        return self.record.global_test

    @property
    def is_accepted(self) -> bool:
        """Whether sigma0 is what the sigmas announce; False also when it cannot be tested."""
        return self.test is not None and self.test.passed

    @property
    def headline(self) -> str:
        """The result of the test in a few words."""
        if self.test is None:
            return "not tested"
        if self.test.passed:
            return "accepted"
        return "rejected: too large" if self.test.sigma0 > self.test.upper else "rejected: too small"

    @property
    def explanation(self) -> str:
        """What the result means and what to do about it."""
        if self.test is None:
            if self.record.redundancy > 0:
                return "This result does not hold the test of sigma0: adjust again to have it."
            return "Nothing is redundant: each observation fits exactly, and nothing checks it."
        if self.test.passed:
            return "The residuals are what the sigmas of the observations announce."
        if self.test.sigma0 > self.test.upper:
            return (
                "The residuals are larger than the sigmas announce: look for a blunder among the worst "
                "residuals, for a wrong known point, or for sigmas that are too small."
            )
        return (
            "The residuals are smaller than the sigmas announce: the sigmas are too large, or observations "
            "that depend on each other were given as independent."
        )


def worst_first(record: AdjustmentRecord) -> list[ObservationRecord]:
    """The active observations that have a residual, the worst first.

    By the standardised residual where reliability is known, else by the normalised one.
    """
    tested = [row for row in record.observations if row.active and row.normalised_residual is not None]
    return sorted(tested, key=_standardised if record.reliability else _normalised)


def worst_title(record: AdjustmentRecord) -> str:
    """By what the worst come first."""
    if record.reliability:
        return "standardised residual (residual / its own a priori sigma)"
    return "normalised residual (residual / sigma)"


def _standardised(row: ObservationRecord) -> tuple[float, float]:
    return -abs(row.standardised_residual or 0.0), _normalised(row)


def _normalised(row: ObservationRecord) -> float:
    return -abs(row.normalised_residual or 0.0)


def worst_constraints_first(record: AdjustmentRecord) -> list[ConstraintRecord]:
    """The known coordinates, the largest normalised residual in absolute value first."""
    return sorted(record.constraints, key=lambda row: -abs(row.normalised_residual))
