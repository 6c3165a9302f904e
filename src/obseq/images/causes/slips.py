"""Slips behind image points and control points: a digit, another point, two exchanged, axes exchanged."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.protocol import Slip
from obseq.survey.causes.values import COORDINATE, explain

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import FloatArray
    from obseq.diagnosis.protocol import Change
    from obseq.images.causes.evidence import Evidence


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


def slips_of_a_coordinate(evidence: Evidence, label: tuple[int, ...], change: Change) -> Iterator[Slip]:
    """What may be behind one wrong coordinate."""
    point, axis = label
    start = evidence.numbering.equations.start
    given = float(start.coordinates[point, axis])
    tolerance = POLICY.near * float(np.hypot(change.sigma[0], np.sqrt(start.covariances[point, axis, axis])))
    told = explain(COORDINATE, given, given - float(change.size[0]), tolerance)
    if told is not None:
        yield Slip(told.code, told.text, told.chance, told.chance < POLICY.likely)
    elif abs(2.0 * given - float(change.size[0])) < tolerance:
        yield Slip("W105", "its sign is wrong", 0.0, is_strong=True)


def slips_of_a_point(evidence: Evidence, label: tuple[int, ...], change: Change) -> Iterator[Slip]:
    """What may be behind a control point that is elsewhere."""
    start, columns = evidence.numbering.equations.start, evidence.numbering.coordinates
    axes = columns[columns[:, 0] == label[0], 1]
    given = start.coordinates[label[0]]
    right = given.copy()
    right[axes] -= change.size
    spread = np.sqrt(np.diagonal(start.covariances[label[0]]))
    spread = np.where(np.isfinite(spread), spread, 0.0)
    spread[axes] = np.hypot(spread[axes], change.sigma)
    if _is_near(given[[1, 0, 2]], right, spread):
        yield Slip("W123", "x and y are exchanged", 0.0, is_strong=True)
    for other in np.flatnonzero(start.is_control).tolist():
        if other != label[0] and _is_near(start.coordinates[other], right, spread):
            name = start.points[other]
            there = evidence.coordinates[other]
            is_pair = _is_near(given, there, 2.0 * spread)
            said = f"exchanged with {name}" if is_pair else f"it is where {name} should be"
            yield Slip("W133", said, 0.0, is_strong=True)


def _is_near(place: FloatArray, right: FloatArray, spread: FloatArray) -> bool:
    return bool((np.abs(place - right) <= POLICY.near * np.maximum(spread, 1e-300)).all())
