"""Two points that were taken for each other: measured so in an image, or given so as control points."""

from __future__ import annotations

import functools
import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.images.adjustment.trials import BAD, HOPELESS, LOUD
from obseq.images.initial.intersection import intersect
from obseq.images.measures import ImagePoints

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import FloatArray, IntArray
    from obseq.images.adjustment.adjustable import AdjustableBlock
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.adjustment.trials import Trials
    from obseq.images.control import ControlPoints
    from obseq.images.poses import Poses

WORST, TRIED = 40, 3
"""Image points among which a pair is looked for, and pairs that are tried."""
IN_IMAGE, STANDS_OUT = 8, 3.0
"""The same of one image at the start, and times the usual miss that theirs is."""
TOWARDS, ASIDE = 0.15, 0.3
"""Shares of the way to the other point that a residual goes along it at least, and off it at most."""
NEAR, FAR = 0.3, 0.5
"""Shares of the distance of two control points: rays meet nearer to the other, farther from their own."""


def exchanged_measures(trials: Trials) -> str:
    """Two points of an image, in words, whose exchange explains their residuals; empty where none are."""
    is_astray = not trials.before.converged or (trials.before.sigma0 or 0.0) > BAD
    sources = [_pairs_at_start(trials)] if is_astray else []
    tried = [itertools.islice(pairs, TRIED) for pairs in (*sources, _pairs_in_images(trials.before))]
    pairs = dict.fromkeys((image, *sorted(points)) for image, *points in itertools.chain(*tried))
    return next(filter(None, (exchange_in(trials, *pair) for pair in pairs)), "")


def exchange_in(trials: Trials, image: str, first: str, second: str) -> str:
    """Whether two points of an image were exchanged, in words; empty where they were not."""
    pair = image, first, second
    what = f"points {first} and {second} in image {image}"
    said = f"{what} are exchanged: each measured as the other"
    changed = trials.measured(lambda measures: _exchanged(measures, *pair))
    left_out = trials.measured(
        lambda measures: measures.rows(np.delete(np.arange(len(measures)), rows_of(measures, *pair)))
    )
    return _explanation(trials, changed, left_out, what, said)


def _explanation(
    trials: Trials, changed: AdjustableBlock | None, left_out: AdjustableBlock | None, what: str, said: str
) -> str:
    """What is said of an exchange that explains as much as leaving out both does; else empty."""
    found = trials.solved(changed, f"{what} exchanged", limit=HOPELESS)
    if found is None or (found.sigma0 or 0.0) > HOPELESS or trials.gains(found) < LOUD**2:
        return ""
    without = trials.solved(left_out, f"the block without {what}")
    if without is None or not (trials.contradicts(without) and trials.explains(found, without)):
        return ""
    return f"{said}; so changed, {trials.falls(found)}"


def rows_of(measures: ImagePoints, image: str, *points: str) -> list[int]:
    """Rows of points of an image."""
    names = measures.image_names, measures.point_names
    pairs = [(names[0][i], names[1][k]) for i, k in zip(measures.image, measures.point, strict=True)]
    return [pairs.index((image, point)) for point in points if (image, point) in pairs]


def _exchanged(measures: ImagePoints, image: str, first: str, second: str) -> ImagePoints:
    """Measures with the pixels of two points exchanged in an image, where both are in it."""
    rows = rows_of(measures, image, first, second)
    xy = measures.xy.copy()
    if len(rows) == 2:
        xy[rows] = xy[rows[::-1]]
    return replace(measures, xy=xy)


def _pairs_in_images(solution: BundleSolution) -> Iterator[tuple[str, str, str]]:
    """Image and points of measures whose residuals point at each other, the most likely first."""
    found = solution.residuals
    worst = np.argsort(-np.linalg.norm(found.residuals / found.sigmas, axis=1), kind="stable")[:WORST]
    pairs = [(i, k) for i, k in itertools.combinations(worst.tolist(), 2) if found.image[i] == found.image[k]]
    scores = {pair: score for pair in pairs if (score := _towards(found.xy, found.residuals, *pair)) > 0.0}
    for i, k in sorted(scores, key=lambda pair: -scores[pair]):
        yield solution.poses.images[found.image[i]], *(solution.points[found.point[row]] for row in (i, k))


def _pairs_at_start(trials: Trials) -> Iterator[tuple[str, str, str]]:
    """Image and points whose measures are near each other's place as the other images see it at first.

    A solution that an exchange has led astray does not show it any more.
    """
    measures = functools.reduce(ImagePoints.joined, (part.measures for part in trials.block.sets))
    found: dict[tuple[str, str, str], float] = {}
    for number, image in enumerate(measures.image_names):
        own, others = (measures.rows(rows) for rows in (measures.image == number, measures.image != number))
        names, xy, off = _misses(trials, image, own, others.of_points(own.point_names))
        for i, k in itertools.combinations(_worst(off).tolist(), 2):
            if (score := _towards(xy, off, i, k)) > 0.0:
                found[image, names[i], names[k]] = score
    yield from sorted(found, key=lambda pair: -found[pair])


def _misses(
    trials: Trials, image: str, own: ImagePoints, others: ImagePoints
) -> tuple[list[str], FloatArray, FloatArray]:
    """Points, pixels (n, 2) and misses (n, 2) of measures in an image whose points lie in it without them."""
    start, control = trials.before.start, trials.block.control
    of_image = dict(zip(start.poses.images, start.cameras, strict=True))
    at = start.poses.select(others.image_names)
    met = intersect(others, at, [of_image[name] for name in at.images])
    known = dict(zip(met.names, met.coordinates, strict=True))
    known |= zip(control.names, control.coordinates, strict=True)
    names = [own.point_names[k] for k in own.point]
    local = start.poses[image].to_local([known.get(name, [np.nan] * 3) for name in names])
    rows = np.flatnonzero(of_image[image].sees(local))
    return [names[row] for row in rows], own.xy[rows], of_image[image].project(local[rows]) - own.xy[rows]


def _worst(off: FloatArray) -> IntArray:
    """Rows of the largest of (n, 2) misses that stand out."""
    norms = np.linalg.norm(off, axis=1)
    chosen = np.argsort(-norms, kind="stable")[:IN_IMAGE]
    return np.asarray(chosen[norms[chosen] > STANDS_OUT * np.median(norms)]) if len(norms) else chosen


def _towards(xy: FloatArray, residuals: FloatArray, i: int, k: int) -> float:
    """How far two points are drawn to each other's place, in shares of the way; 0 where they are not."""
    way = xy[k] - xy[i]
    squared = float(way @ way)
    if squared == 0.0:
        return 0.0
    own = residuals[i], -residuals[k]
    along = [float(residual @ way) / squared for residual in own]
    aside = [float(np.linalg.norm(r - t * way)) / squared**0.5 for r, t in zip(own, along, strict=True)]
    return sum(along) if min(along) > TOWARDS and max(aside) < ASIDE else 0.0


# Control points


def exchanged_control(trials: Trials) -> str:
    """Two control points, in words, whose exchange explains their residuals; empty where none are."""
    poses = trials.block.poses, trials.before.poses
    pairs = dict.fromkeys(pair for these in poses for pair in _pairs_of_control(trials, these))
    tried = list(pairs)[:TRIED]
    return next(filter(None, (_control_exchange(trials, *pair) for pair in tried)), "")


def _control_exchange(trials: Trials, first: str, second: str) -> str:
    changed, left_out = trials.copy(), trials.copy()
    changed.control = _exchanged_names(changed.control, first, second)
    left_out.control = left_out.control.without((first, second))
    one, other = trials.block.control_places([first, second])
    said = f"control points {one} and {other} are exchanged: each has the coordinates of the other"
    return _explanation(trials, changed, left_out, f"control points {first} and {second}", said)


def _exchanged_names(control: ControlPoints, first: str, second: str) -> ControlPoints:
    other = {first: second, second: first}
    return replace(control, names=tuple(other.get(name, name) for name in control.names))


def _pairs_of_control(trials: Trials, poses: Poses) -> list[tuple[str, str]]:
    """Control points whose rays meet near each other's coordinates, the most likely first."""
    control = trials.block.control
    measures = functools.reduce(ImagePoints.joined, (part.measures for part in trials.block.sets))
    rays = measures.of_points(control.names)
    if len(control) < 2 or not len(rays):
        return []
    at = poses.select(rays.image_names)
    met = intersect(rays, at, [trials.cameras[image] for image in at.images])
    given = control.select(met.names).coordinates
    to_given = np.linalg.norm(met.coordinates[:, None] - given[None], axis=2)
    apart = np.linalg.norm(given[:, None] - given[None], axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        near = np.maximum(to_given, to_given.T) / apart
        far = np.minimum.outer(np.diagonal(to_given), np.diagonal(to_given)) / apart
    found = np.argwhere(np.triu((near < NEAR) & (far > FAR), 1)).tolist()
    return [(met.names[i], met.names[k]) for i, k in sorted(found, key=lambda pair: near[pair[0], pair[1]])]
