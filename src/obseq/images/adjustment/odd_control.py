"""Control points that contradict the others: found where the images place the block without any of them.

The block of the images alone has the shape of the control points, but for those that are wrong: a similarity
is looked for that takes it to most of them. Those that it leaves far off are left out, or exchanged, and the
block is adjusted again: it must fit.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import ObseqError
from obseq.images.adjustment.calibrations import OFF, as_whole, focal_change, focal_in_words
from obseq.images.control import ControlPoints
from obseq.images.initial.growth import place_images, place_the_last, similarity
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import BoolArray, FloatArray
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.adjustment.trials import Attempts

FAR = 0.03
"""Share of their extent by which a similarity may miss control points: a block without them is bent."""
LEAST = 4
"""Control points that agree, at least."""
WRONG = 3
"""One of so many control points may be wrong, at most."""
TRIPLES = 150
NEAR = 0.3
"""Share of the distance of two control points, within which the images see one at the other."""


def odd_control(attempts: Attempts) -> str:
    """Control points that do not agree with the others and the images, in words; empty where all do."""
    control = attempts.block.control
    points = _points(attempts) if len(control) > LEAST else None
    if points is None or len(points) <= LEAST:
        return ""
    given = control.select(points.names).coordinates
    moved, agree = _best(points.coordinates, given)
    wrong = [points.names[row] for row in np.flatnonzero(~agree)]
    if not wrong or WRONG * len(wrong) > len(points) or agree.sum() < LEAST:
        return ""
    pair = _pair(attempts, points.names, wrong, moved[~agree])
    return (_exchanged(attempts, *pair) if pair else "") or _left_out(attempts, wrong)


def _points(attempts: Attempts) -> ControlPoints | None:
    """The control points as the images alone place them, in a frame of their own."""
    measures = functools.reduce(ImagePoints.joined, (part.measures for part in attempts.block.sets))
    nothing = ControlPoints.of([], np.zeros((0, 3)))
    try:
        growth = place_images(measures, nothing, attempts.cameras, Poses.of([], [], []))
        place_the_last(growth, nothing)
    except ObseqError:
        return None
    met = growth.points(np.inf)
    known = set(attempts.block.control.names)
    return met.select([name for name in met.names if name in known])


def _best(points: FloatArray, given: FloatArray) -> tuple[FloatArray, BoolArray]:
    """(n, 3) points moved to the control points by the similarity that most agree with, and (n,) which do."""
    far = 2.0 * FAR * float(np.median(np.linalg.norm(given - np.median(given, axis=0), axis=1)))
    best, agree = points, np.zeros(len(points), dtype=bool)
    for rows in (*_triples(len(points)), None):
        moved = _moved(points, given, agree if rows is None else rows)
        near = agree if moved is None else np.linalg.norm(moved - given, axis=1) < far
        if moved is not None and (near.sum() > agree.sum() or rows is None):
            best, agree = moved, near
    return best, agree


def _triples(n: int) -> list[list[int]]:
    """Three of n points, in all ways or some of them."""
    chosen = [list(rows) for rows in itertools.combinations(range(n), 3)]
    return chosen[:: max(1, len(chosen) // TRIPLES)]


def _moved(points: FloatArray, given: FloatArray, rows: list[int] | BoolArray) -> FloatArray | None:
    """(n, 3) points moved by the similarity of some of them; None where these are on a line."""
    try:
        scale, motion = similarity(points[rows], given[rows])
    except ObseqError:
        return None
    return np.asarray(motion.centre + scale * points @ motion.rotation.T)


def _pair(
    attempts: Attempts, met: Sequence[str], wrong: Sequence[str], moved: FloatArray
) -> tuple[str, str] | None:
    """Two control points that the images see at each other's place, or one where they do not see the other.

    Args:
        attempts: of the block.
        met: control points that the images place.
        wrong: those that are elsewhere.
        moved: (n, 3) where these are.
    """
    control = attempts.block.control
    others = list(wrong) if len(wrong) == 2 else [name for name in control.names if name not in met]
    if len(wrong) not in (1, 2) or not others:
        return None
    given = control.select(others).coordinates
    other = others[int(np.argmin(np.linalg.norm(given - moved[0], axis=1)))]
    pair = wrong[0], other
    ends = control.select(pair).coordinates
    is_so = pair[0] != other and _are_close(moved, ends[::-1][: len(moved)], ends)
    return pair if is_so else None


def _exchanged(attempts: Attempts, first: str, second: str) -> str:
    """That two control points have each other's coordinates, where the block fits then."""
    other = {first: second, second: first}
    made, control = attempts.copy(), attempts.block.control
    made.control = replace(control, names=tuple(other.get(name, name) for name in control.names))
    one, two = attempts.block.control_places([first, second])
    found = attempts.fitting(made, f"control points {one} and {two} exchanged")
    if found is None:
        return ""
    said = f"control points {one} and {two} are exchanged: each has the coordinates of the other"
    return f"{said}; {attempts.becomes(found)}"


def _are_close(points: FloatArray, others: FloatArray, ends: FloatArray) -> bool:
    """Whether points are nearer to others than two ends are to each other, by far."""
    apart = float(np.linalg.norm(ends[0] - ends[1]))
    return bool((np.linalg.norm(points - others, axis=1) < NEAR * apart).all())


def _left_out(attempts: Attempts, wrong: list[str]) -> str:
    """That control points are wrong, and by how much, where the block fits without them.

    Where all of it fits from there, a focal length with which images cannot be placed may be.
    """
    made = attempts.copy()
    made.control = made.control.without(wrong)
    found = attempts.fitting(made, f"the block without control points {', '.join(wrong)}")
    if found is None:
        return ""
    whole = as_whole(attempts, found)
    if whole is None:
        return contradicted(attempts, wrong, found)
    return focal_in_words(attempts, whole) if focal_change(attempts, whole) > OFF else ""


def contradicted(attempts: Attempts, wrong: Sequence[str], found: BundleSolution) -> str:
    """Control points that are wrong, in words, where the block fits without them."""
    listed = "; ".join(off_by(attempts, wrong, found))
    told = f"control points that the others and the images contradict: {listed}"
    return f"{told}. Without, {attempts.falls(found)}"


def off_by(attempts: Attempts, wrong: Sequence[str], found: BundleSolution) -> list[str]:
    """Control points, with by how much they are off in a solution without them."""
    seen, control = dict(zip(found.points, found.coordinates, strict=True)), attempts.block.control
    there = np.array([seen.get(name, [np.nan] * 3) for name in wrong]).reshape(-1, 3)
    off = control.select(wrong).coordinates - there
    places = attempts.block.control_places(wrong)
    return [
        f"{place} (by {x:+.4g}, {y:+.4g}, {z:+.4g})" for place, (x, y, z) in zip(places, off, strict=True)
    ]
