"""All zenith angles to one target, or from one point, that are off by one angle and decide on heights.

A robust estimate then moves points, and single sights seem to be wrong, distances too. So points are placed
without these zenith angles; the offset of those to a target is the one with which they give one height of it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.screening.offset_effects import Sights, What, zenith_angles
from obseq.survey.screening.offsets import LARGEST, Offset, corrected_by, described
from obseq.survey.screening.robust import GROSS, QUICK
from obseq.survey.screening.substitutes import sigma_of
from obseq.survey.screening.trials import estimated, unweighted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import BoolArray, FloatArray
    from obseq.survey.screening.findings import GrossError
    from obseq.survey.screening.robust import Estimate
    from obseq.survey.screening.trials import Trials

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_MOST = 4
"""Targets and points that are tried, those with the most suspects."""
_LEAST_SUSPECTS, _LEAST_SPARE = 2, 3
"""Suspects at a target; zenith angles from which heights that they give say something of their offset."""
_STEPS = 4000
"""Offsets (0.05 gon apart) at which heights are compared, and the same again between two of them."""
_ROUNDS, _SMALL = 20, 1e-6
"""Rounds of weights, and an angle (rad) that is none."""
_LEVEL = 0.02
"""Angle (rad) from the vertical below which a sight says nothing of a height."""


def aim_cause(trials: Trials) -> tuple[GrossError, Estimate] | None:
    """The target, or point, whose zenith angles share an offset, with the network without it; else None."""
    best: tuple[float, Offset, Estimate] | None = None
    for rows in _aims(trials.found):
        without = _without(trials, rows)
        if without is None:
            continue
        for one in _offsets(trials.found, without, rows):
            corrected = _corrected(trials, without, one)
            if corrected is None or (corrected.ratios[rows] > corrected.limit).any():
                continue
            left = corrected.disagreement(GROSS)
            if best is None or left < best[0]:
                best = left, one, corrected
        if best is not None:
            return described(trials.found, best[1]), best[2]
    return None


def _without(trials: Trials, rows: Rows) -> Estimate | None:
    """The network in which some zenith angles have no weight, None if others contradict."""
    found, book = trials.found, unweighted(trials.found.book, rows)
    start = replace(found.end, book=unweighted(found.end.book, rows))
    return _if_explaining(trials, estimated(trials.model, found.points, book, QUICK, start))


def _corrected(trials: Trials, without: Estimate, one: Offset) -> Estimate | None:
    """The network without an offset, from where it was found without these zenith angles; else anew."""
    found, book = trials.found, corrected_by(trials.found.book, one)
    for start in (replace(without.end, book=corrected_by(found.end.book, one)), None):
        corrected = _if_explaining(trials, estimated(trials.model, found.points, book, QUICK, start))
        if corrected is not None:
            return corrected
    return None


def _if_explaining(trials: Trials, estimate: Estimate | None) -> Estimate | None:
    return estimate if estimate and trials.explains(estimate) else None


def _aims(found: Estimate) -> list[Rows]:
    """The zenith angles to each target, and from each point, those with the most suspects first."""
    observations, n = found.book.observations, len(found.book.point_names)
    chosen = observations.active & np.isin(observations.types, zenith_angles())
    groups: list[tuple[int, Rows]] = []
    for ends in (observations.to_points, observations.from_points):
        count = np.bincount(ends[found.suspects], minlength=n)
        for point in np.argsort(-count, kind="stable")[:_MOST].tolist():
            rows = np.flatnonzero(chosen & (ends == point)).astype(np.intp)
            if min(int(count[point]), len(rows)) >= _LEAST_SUSPECTS:
                groups.append((int(count[point]), rows))
    return [rows for _, rows in sorted(groups, key=lambda pair: -pair[0])[:_MOST]]


def _offsets(found: Estimate, without: Estimate, rows: Rows) -> Iterator[Offset]:
    """What added to zenith angles makes them agree, with the height of their target or with each other."""
    sights = Sights.of(without)
    vectors, up, read = sights.vectors[rows], sights.up[rows], found.book.observations.values[rows]
    rises = np.sum(vectors * up, axis=1)
    flats = np.sqrt(np.maximum(np.sum(vectors**2, axis=1) - rises**2, 0.0))
    if not (np.isfinite(flats) & (flats > 0.0)).all():
        return
    sigmas = np.array([sigma_of(found, row) for row in rows.tolist()])
    gaps, is_seen = np.asarray(np.arctan2(flats, rises) - read), _are_seen_by_others(found, rows)
    sizes = [float(np.median(gaps[is_seen] if is_seen.any() else gaps))]
    if len(rows) >= _LEAST_SPARE and _have_one_target(found, rows):
        sizes += _agreeing(flats, rises, read)
    elif np.count_nonzero(is_seen) >= _LEAST_SPARE:
        sizes += [_beside_a_height(gaps[is_seen], (flats / (flats**2 + rises**2))[is_seen])]
    suspects = rows[found.ratios[rows] > found.limit]
    for size in sizes:
        if 2.0 * found.limit * float(sigmas.min()) < abs(size) <= LARGEST[What.INDEX]:
            yield Offset(What.INDEX, rows, size, float(sigmas.min()), suspects)


def _beside_a_height(gaps: FloatArray, shares: FloatArray) -> float:
    """The offset that most of some angles (k,) want, whatever the height of their instrument.

    Args:
        gaps: (k,) what would have to be added to each, rad.
        shares: (k,) what it changes by a metre of that height.
    """
    design = np.column_stack([np.ones(len(gaps)), shares])
    weights: FloatArray = np.ones(len(gaps))
    offset: FloatArray = np.zeros(2)
    for _ in range(_ROUNDS):  # least absolute residuals, by weights
        offset = np.asarray(np.linalg.lstsq(design * weights[:, None], gaps * weights, rcond=None)[0])
        weights = np.asarray((np.abs(gaps - design @ offset) + _SMALL) ** -0.5)
    return float(offset[0])


def _have_one_target(found: Estimate, rows: Rows) -> bool:
    return len(np.unique(found.book.observations.to_points[rows])) == 1


def _are_seen_by_others(found: Estimate, rows: Rows) -> BoolArray:
    """Which targets of zenith angles other zenith angles go to as well."""
    observations = found.book.observations
    chosen = observations.active & np.isin(observations.types, zenith_angles())
    chosen[rows] = False
    return np.asarray(np.isin(observations.to_points[rows], observations.to_points[chosen]))


def _agreeing(flats: FloatArray, rises: FloatArray, read: FloatArray) -> list[float]:
    """The offset with which zenith angles (k,) give one height, at their distances."""
    most = LARGEST[What.INDEX]
    sizes, step = np.linspace(-most, most, _STEPS + 1), 2.0 * most / _STEPS
    for _ in range(2):
        best = float(sizes[np.nanargmin(_spread(sizes, flats, rises, read))])
        sizes = np.linspace(best - step, best + step, _STEPS + 1)
    return [best]


def _spread(sizes: FloatArray, flats: FloatArray, rises: FloatArray, read: FloatArray) -> FloatArray:
    """(n,) how far heights are apart that zenith angles (k,) give with offsets (n,), as angles, squared."""
    zeniths = read + sizes[:, None]
    is_seen = np.asarray(((zeniths > _LEVEL) & (zeniths < math.pi - _LEVEL)).all(axis=1))
    sines = np.where(is_seen[:, None], np.sin(zeniths), 1.0)
    heights = flats * np.cos(zeniths) / sines - rises
    weights = (sines**2 / flats) ** 2
    middle = np.sum(weights * heights, axis=1) / np.sum(weights, axis=1)
    spread = np.sum(weights * (heights - middle[:, None]) ** 2, axis=1)
    return np.where(is_seen, spread, np.inf)
