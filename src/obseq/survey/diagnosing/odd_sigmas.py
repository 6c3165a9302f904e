"""Single sigmas that are out of line with those of their kind, where that hides an error or makes one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.diagnosis.policy import POLICY
from obseq.survey.kinds.registry import BY_CODE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import FloatArray
    from obseq.report.tables.units import Units
    from obseq.survey.adjustment.adjusted import Adjustment

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]


def odd_sigmas(adjustment: Adjustment, units: Units) -> tuple[str, ...]:
    """What sigmas that are out of line hide, or make of misfits that are small, in words; mostly nothing."""
    # np.unique and np.median would load masked arrays, in 13 ms
    types, active = adjustment.book.observations.types, adjustment.book.observations.active
    told: list[str] = []
    for code in np.flatnonzero(np.bincount(types[active])).tolist():
        rows = np.flatnonzero((types == code) & active & np.isfinite(adjustment.residuals))
        if len(rows) > POLICY.few:
            told += _told(adjustment, units, rows)
    return tuple(told)


def _told(adjustment: Adjustment, units: Units, rows: Rows) -> Iterator[str]:
    """Of one kind, the observations whose sigma is out of line and decides what is said of them."""
    usual = float(np.sort(adjustment.sigmas[rows])[len(rows) // 2])
    factors = adjustment.sigmas[rows] / usual
    odd = np.maximum(factors, 1.0 / factors) >= POLICY.out_of_line
    if odd.mean() > POLICY.half:
        return
    for row, factor in zip(rows[odd].tolist(), factors[odd].tolist(), strict=True):
        is_large, is_judged = (
            abs(_misfit(adjustment, row)) > POLICY.suspect * usual,
            _is_judged(adjustment, row),
        )
        if factor > 1.0 and is_large and not is_judged:
            yield _sentence(adjustment, units, row, usual, f"{factor:.0f} times larger", "hides")
        elif factor < 1.0 and is_judged and not is_large:
            times = f"{1.0 / factor:.0f} times smaller"
            yield _sentence(adjustment, units, row, usual, times, "lets the tests reject")


def _sentence(adjustment: Adjustment, units: Units, row: int, usual: float, times: str, does: str) -> str:
    kind, misfit = BY_CODE[int(adjustment.book.observations.types[row])], _misfit(adjustment, row)
    return (
        f"the sigma of {adjustment.book.label(row)} is {times} than the usual one of {kind.name} "
        f"observations ({units.small(kind.unit, usual)}); that {does} a misfit of "
        f"{units.small(kind.unit, misfit)}, {abs(misfit) / usual:.3g} times the usual one: check it"
    )


def _misfit(adjustment: Adjustment, row: int) -> float:
    """By how much the others contradict an observation (m, rad); its residual where that is not known."""
    numbers = adjustment.quality.observations
    biases: FloatArray = adjustment.residuals if numbers is None else numbers.blunder
    return float(biases[row] if np.isfinite(biases[row]) else adjustment.residuals[row])


def _is_judged(adjustment: Adjustment, row: int) -> bool:
    numbers = adjustment.quality.observations
    return numbers is not None and abs(float(numbers.standardised[row])) > POLICY.near
