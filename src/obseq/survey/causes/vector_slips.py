"""Slips behind a wrong vector: its ends are exchanged, it is in another unit, or it goes to another point."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.diagnosis.protocol import Slip
from obseq.survey.causes.effects import Effects

UNITS = (
    ("W126", "millimetres read as metres", 1e-3),
    ("W127", "centimetres read as metres", 1e-2),
    ("W106", "feet read as metres", 0.3048),
    ("W107", "metres read as feet", 1.0 / 0.3048),
)
"""Slips of units: code, what it is, and the factor of what was written."""
_SHORT = 20.0
"""Tolerances that a vector must be long for its direction, or its unit, to say something."""


def slips_of_vector(effects: Effects, rows: IntArray, size: FloatArray, tolerance: float) -> Iterator[Slip]:
    """The slips behind a wrong vector.

    Args:
        effects: The sights of the network without the error.
        rows: (q,) its components.
        size: (q,) observed minus right.
        tolerance: How far what fits may be off.
    """
    notes, value = effects.notes, effects.notes.book.observations.values[rows]
    right = value - size
    length = float(np.abs(right).max())
    if length > _SHORT * tolerance:
        if np.abs(right + value).max() <= tolerance:
            yield Slip("W134", "its two ends are exchanged: turned round it fits", 0.0, is_strong=True)
        for code, text, factor in UNITS:
            if np.abs(right - factor * value).max() <= tolerance:
                yield Slip(code, text, 0.0, is_strong=True)
    origin, target = (int(end[rows[0]]) for end in _ends(effects))
    for end, sign, told in ((target, 1.0, "it goes to"), (origin, -1.0, "it comes from")):
        point = _other(effects, rows, sign * size, end, tolerance)
        if point is not None and point not in (origin, target):
            yield Slip("W118", f"{told} {notes.book.point_names[point]}", 0.0, is_strong=True)


def _ends(effects: Effects) -> tuple[IntArray, IntArray]:
    rows = effects.notes.book.observations
    return rows.from_points.astype(np.int64), rows.to_points.astype(np.int64)


def _other(effects: Effects, rows: IntArray, moved: FloatArray, end: int, tolerance: float) -> int | None:
    """The point at which the end of a vector fits that is moved (q,) in its axes; None for none."""
    places = effects.coordinates
    if end >= len(places) or not np.isfinite(effects.axes[rows]).all():
        return None
    local = (places - places[end]) @ effects.horizons[effects.origins[rows[0]]].T
    off = np.abs(local @ effects.axes[rows].T - moved).max(axis=1)
    off[end] = np.inf
    best = int(np.nanargmin(off))
    return best if off[best] <= tolerance else None
