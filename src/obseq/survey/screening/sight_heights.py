"""The height of a target in one sight: what its zenith angle and its slope distance say of it together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.screening.offset_effects import Sights, What
from obseq.survey.screening.offsets import Offset, described, is_possible
from obseq.survey.screening.substitutes import sigma_of, tolerance_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from obseq.arrays import FloatArray
    from obseq.survey.screening.findings import GrossError
    from obseq.survey.screening.offset_effects import Change
    from obseq.survey.screening.robust import Estimate

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_ROUNDS, _STEP = 4, 1e-3
"""How often a height is improved, and by what its effect is found (m)."""
_LEVEL = 1e-6
"""Change of a zenith angle by a height (rad for each m) below which it says nothing of it."""


def height_error(found: Estimate, row: int, suspects: Iterable[int]) -> GrossError | None:
    """The height of the target with which all of a sight fits; None where no height does.

    Args:
        found: the network.
        row: an observation of the sight.
        suspects: what is suspected, some of it of that sight.
    """
    sights = Sights.of(found)
    sight = sights.seeing(What.TARGET, _of_sight(found, row))
    zeniths = sight[sights.is_zenith[sight]]
    suspected = np.array([one for one in suspects if one in sight], np.intp)
    if row not in sight or not np.isin(zeniths, suspected).any():
        return None
    fitted = _fitted(found.misfits[zeniths], sights.change(What.TARGET, zeniths))
    if fitted is None:
        return None
    size, least = fitted
    tolerances = np.array([tolerance_of(found, one) for one in sight.tolist()])
    if not (np.abs(found.misfits[sight] + sights.change(What.TARGET, sight)(size)) <= tolerances).all():
        return None
    sigma = found.scale * max(sigma_of(found, one) for one in zeniths.tolist()) / least
    one = Offset(What.TARGET, sight, size, sigma, suspected)
    return described(found, one) if is_possible(found, one) else None


def _fitted(misfits: FloatArray, changed: Change) -> tuple[float, float] | None:
    """The offset (m) that zenith angles want, and how much it changes the one that it changes least."""
    size = 0.0
    for _ in range(_ROUNDS):
        shares = np.abs(slopes := (changed(size + _STEP) - changed(size)) / _STEP)
        if not shares.min() > _LEVEL:
            return None
        size -= float(np.median((misfits + changed(size)) / slopes))
    return size, float(shares.min())


def _of_sight(found: Estimate, row: int) -> Rows:
    """All observations of a sight, in all rounds: between its two points, at its heights."""
    observations = found.book.observations
    same = observations.active & np.isfinite(found.misfits)
    for column in (
        observations.from_points,
        observations.to_points,
        observations.from_heights,
        observations.to_heights,
    ):
        same &= column == column[row]
    return np.flatnonzero(same).astype(np.intp)
