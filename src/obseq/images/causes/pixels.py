"""Slips behind an image point: another point, two exchanged, a digit."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from obseq.arrays import FloatArray
from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.protocol import Change, Slip
from obseq.images.causes.evidence import Evidence
from obseq.survey.causes.values import COORDINATE, explain


def slips_of_a_pixel(evidence: Evidence, label: tuple[int, ...], change: Change) -> Iterator[Slip]:
    """What may be behind one wrong image point."""
    measure = np.array([label[0]])
    ((xy,), (sigma,)) = evidence.written(measure)
    spread = np.hypot(change.sigma, sigma)
    yield from _of_another_point(evidence, label[0], xy, spread)
    right, off = xy - change.size, np.abs(change.size) > POLICY.near * spread
    for axis in np.flatnonzero(off).tolist() if off.sum() == 1 else ():
        told = explain(COORDINATE, float(xy[axis]), float(right[axis]), POLICY.near * float(spread[axis]))
        if told is not None:
            yield Slip(told.code, f"{told.text} in {'xy'[axis]}", told.chance, told.chance < POLICY.likely)


def _of_another_point(evidence: Evidence, measure: int, xy: FloatArray, spread: FloatArray) -> Iterator[Slip]:
    """Another point that is where this one was measured; the two exchanged, where both are."""
    numbering = evidence.numbering
    image, own = int(numbering.image[measure]), int(numbering.point[measure])
    places = evidence.pixels(image)
    spread = 2.0 * spread  # the place of the other is not known better
    off = np.linalg.norm((places - xy) / spread, axis=1)
    off[own] = np.inf
    best = int(np.argmin(np.nan_to_num(off, nan=np.inf)))
    if not off[best] < POLICY.near:
        return
    extent = np.ptp(places[np.isfinite(places[:, 0])], axis=0)
    chance = float(len(places) * math.pi * POLICY.near**2 * np.prod(spread) / max(np.prod(extent), 1e-300))
    name = numbering.equations.start.points[best]
    others = evidence.of_image(image)
    ((other, _),) = [evidence.written(others[numbering.point[others] == best])]
    if len(other) and np.linalg.norm((other[0] - places[own]) / spread) < POLICY.near:
        yield Slip("W113", f"exchanged with point {name}", chance, is_strong=True)
    elif chance < POLICY.likely:
        yield Slip("W112", f"it is where point {name} is", chance, is_strong=False)
