"""Readings that fit another point than the one that is noted."""

from __future__ import annotations

import math

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.survey.causes.effects import Effects
from obseq.survey.kinds.registry import IS_ANGLE

_PRISM = 0.02
"""How well a sight to another point is known (m): its prism may have another height."""
_FITS = 4.0
"""Standard deviations within which all readings must fit another point: the largest of some dozen."""


def _sights(effects: Effects, row: int) -> tuple[FloatArray, FloatArray]:
    """(p, 3) vectors from the instrument of an observation to all points, target raised as noted; and up."""
    rows = effects.notes.book.observations
    up = effects.up[row]
    raised = (rows.to_heights[row] - rows.from_heights[row]) * up
    return effects.coordinates - effects.coordinates[rows.from_points[row]] + raised, up


def _polar(vectors: FloatArray, up: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Azimuths (from any zero), zenith angles and lengths of vectors (..., 3)."""
    rise = vectors @ up
    first = np.cross(up, (1.0, 0.0, 0.0) if abs(up[0]) < 0.9 else (0.0, 1.0, 0.0))
    first = first / np.linalg.norm(first)
    second = np.cross(up, first)
    azimuths = -np.arctan2(vectors @ second, vectors @ first)  # clockwise
    lengths = np.linalg.norm(vectors, axis=-1)
    return azimuths, np.arctan2(np.sqrt(np.maximum(lengths**2 - rise**2, 0.0)), rise), lengths


def readings_to(effects: Effects, computed: FloatArray, row: int) -> FloatArray:
    """(p,) what an observation would have been to each point; NaN where it cannot be to it."""
    notes = effects.notes
    rows, n = notes.book.observations, len(effects.coordinates)
    target, origin = int(rows.to_points[row]), int(rows.from_points[row])
    if max(target, origin) >= n:
        return np.full(n, np.nan)
    kinds = (notes.is_direction[row] or notes.is_between[row], notes.is_zenith[row], notes.is_slope[row])
    if not any(kinds):
        return np.full(n, np.nan)
    with np.errstate(invalid="ignore"):
        of_all = _polar(*_sights(effects, row))[kinds.index(True)]
    found = computed[row] + of_all - of_all[target]
    found[[target, origin]] = np.nan
    return np.asarray(found)


def other_backsights(effects: Effects, computed: FloatArray, row: int) -> FloatArray:
    """(p,) what an angle would have been from each point as its first one; NaN for what is no angle."""
    rows, n = effects.notes.book.observations, len(effects.coordinates)
    backsight, origin = int(rows.backsights[row]), int(rows.from_points[row])
    if not effects.notes.is_between[row] or max(backsight, origin) >= n:
        return np.full(n, np.nan)
    with np.errstate(invalid="ignore"):
        of_all = _polar(*_sights(effects, row))[0]
    found = computed[row] - of_all + of_all[backsight]
    found[[backsight, origin]] = np.nan
    return np.asarray(found)


def other_target(effects: Effects, computed: FloatArray, rows: IntArray, sigmas: FloatArray) -> int | None:
    """The point to which all of some readings fit; None where that is none, or a coincidence.

    Args:
        effects: The sights of the network.
        computed: (n,) what observations should have been.
        rows: Those of one sight.
        sigmas: (m,) how well it is known what they should have been.
    """
    observations, notes = effects.notes.book.observations, effects.notes
    if not (notes.is_zenith[rows] | notes.is_slope[rows]).any() or len(rows) < 2:
        return None  # one direction fits many points
    worst = np.zeros(len(effects.coordinates))
    for row, sigma in zip(rows.tolist(), sigmas.tolist(), strict=True):
        read = readings_to(effects, computed, row)
        off, spread = observations.values[row] - read, _PRISM
        if IS_ANGLE[observations.types[row]]:
            off = np.remainder(off + math.pi, 2.0 * math.pi) - math.pi
            lengths = np.linalg.norm(_sights(effects, row)[0], axis=1)
            spread = _PRISM / np.maximum(lengths, _PRISM)
        with np.errstate(invalid="ignore", divide="ignore"):
            worst = np.maximum(worst, np.nan_to_num(np.abs(off) / np.hypot(sigma, spread), nan=np.inf))
    best = int(np.argmin(worst))
    return best if worst[best] < _FITS else None


def other_standpoint(effects: Effects, rows: IntArray, sigmas: FloatArray) -> int | None:
    """The point from which all readings of a set-up fit; None for none."""
    notes = effects.notes
    observations, places = notes.book.observations, effects.coordinates
    origin = int(observations.from_points[rows[0]])
    targets = observations.to_points[rows]
    if (targets >= len(places)).any():
        return None
    up = effects.up[rows[0]]
    raised = (observations.to_heights[rows] - observations.from_heights[rows])[:, None] * up
    azimuths, zeniths, lengths = _polar(places[targets] + raised - places[:, None], up)
    off = np.zeros_like(lengths)
    for mask, read in (
        (notes.is_direction, azimuths),
        (notes.is_zenith, zeniths),
        (notes.is_slope, lengths),
    ):
        own = mask[rows]
        off[:, own] = observations.values[rows[own]] - read[:, own]
    own = notes.is_direction[rows]
    if own.any():
        turn = np.angle(np.exp(1j * (off[:, own] - off[:, own][:, :1])))
        off[:, own] = turn - np.median(turn, axis=1, keepdims=True)
    off[:, notes.is_zenith[rows]] = np.angle(np.exp(1j * off[:, notes.is_zenith[rows]]))
    spread = np.where(IS_ANGLE[observations.types[rows]], _PRISM / np.maximum(lengths, 1e-3), _PRISM)
    worst = np.nan_to_num(np.max(np.abs(off) / np.hypot(sigmas, spread), axis=1), nan=np.inf)
    worst[[origin, *targets]] = np.inf
    best = int(np.argmin(worst))
    return best if worst[best] < _FITS else None
