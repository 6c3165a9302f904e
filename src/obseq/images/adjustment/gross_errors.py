"""A few single observations without which a block fits: no cause that all share need be looked for then.

The worst image point is left out, or the control point is freed that most of its rays miss, once and again
while that takes away much of what is left. The block must fit without them, and not with them from there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.images.adjustment.exchanges import rows_of
from obseq.images.adjustment.odd_control import LEAST, contradicted, off_by
from obseq.images.adjustment.trials import BAD, squares

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import FloatArray
    from obseq.images.adjustment.adjustable import AdjustableBlock
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.adjustment.trials import Trials
    from obseq.images.measures import ImagePoints

MOST = 3
"""Observations that are left out together."""
GAIN = 0.2
"""Share of the sum of squares that each of them takes away, at least."""
RAYS, OF_KNOWN = 4, 3
"""Rays of a free point, and of a control point, that tell which one of them is wrong."""
SHARED = 0.2
"""Share of its worst residual that most rays of a control point have when its coordinates are wrong."""


@dataclass(frozen=True)
class _Left:
    """What is left out of a block.

    Attributes:
        measures: image and point of each.
        control: the control point that is taken for unknown, if there is one.
    """

    measures: tuple[tuple[str, str], ...] = ()
    control: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.measures) + len(self.control)

    def of(self, trials: Trials) -> AdjustableBlock | None:
        """The block without it."""
        made = trials.measured(self._kept)
        if made is not None:
            made.control = made.control.without(self.control)
        return made

    def _kept(self, measures: ImagePoints) -> ImagePoints:
        gone = [row for pair in self.measures for row in rows_of(measures, *pair)]
        return measures.rows(np.delete(np.arange(len(measures)), gone))


def gross_errors(trials: Trials) -> str:
    """Single observations that contradict all the others, in words; empty where something else is wrong."""
    left, solution = _Left(), trials.before
    while len(left) < MOST:
        tried = [(more, _without(trials, more)) for more in _with_the_worst(trials, left, solution)]
        good = [(squares(found), more, found) for more, found in tried if found is not None]
        if not good:
            return ""
        least, left, found = min(good, key=lambda item: item[0])
        if least > (1.0 - GAIN) * squares(solution):
            return ""
        if trials.fits(found) and (found.sigma0 or 0.0) < BAD:
            return _words(trials, left, found) if _are_wrong(trials, found) else ""
        solution = found
    return ""


def _without(trials: Trials, left: _Left) -> BundleSolution | None:
    return trials.solved(left.of(trials), f"the block without its {len(left)} worst observations")


def _with_the_worst(trials: Trials, left: _Left, solution: BundleSolution) -> Iterator[_Left]:
    """What is left out, and the worst control point, or image point, beside it."""
    found = solution.residuals
    norms = np.linalg.norm(found.residuals / found.sigmas, axis=1) * np.sqrt(found.weights)
    worst = int(np.argmax(norms))
    image, point = solution.poses.images[found.image[worst]], solution.points[found.point[worst]]
    control = _worst_control(solution, norms[worst]) or point
    rays = norms[found.point == solution.points.index(control)]
    known = trials.block.control.names
    if (
        control in known
        and not left.control
        and len(known) > LEAST
        and len(rays) >= OF_KNOWN
        and np.median(rays) > SHARED * rays.max()
    ):
        yield _Left(left.measures, (control,))
    yield _Left((*left.measures, (image, point)), left.control)


def _worst_control(solution: BundleSolution, least: float) -> str:
    """The control point that has moved by most of its sigmas, if these are more; else empty."""
    names, residuals = solution.control_residuals()
    sigmas = solution.block.control.select(names).sigmas
    sigmas[sigmas == 0.0] = np.inf
    times = np.abs(residuals / sigmas).max(axis=1, initial=0.0)
    return names[int(np.argmax(times))] if times.max(initial=0.0) > least else ""


def _are_wrong(trials: Trials, found: BundleSolution) -> bool:
    """Whether the whole block does not fit either from where it does without them."""
    made = trials.copy()
    made.poses = found.poses
    again = trials.last(made, "the whole block from there")
    return again is None or squares(again) > (1.0 - GAIN) * squares(trials.before)


def _words(trials: Trials, left: _Left, found: BundleSolution) -> str:
    if not left.measures:
        return contradicted(trials, left.control, found)
    said = [f"control point {place}" for place in off_by(trials, left.control, found)]
    said += [_measure(trials, image, point, found) for image, point in left.measures]
    what, without = ("a gross error", "it") if len(said) == 1 else (f"{len(said)} gross errors", "them")
    return f"{what}: {'; '.join(said)}. Without {without}, {trials.falls(found)}"


def _measure(trials: Trials, image: str, point: str, found: BundleSolution) -> str:
    """An image point with by how much it is off; or all that may be wrong where rays do not tell which."""
    before = trials.before.residuals
    rays = before.image[before.point == trials.before.points.index(point)]
    is_known = point in trials.block.control.names
    if len(rays) >= (OF_KNOWN if is_known else RAYS):
        x, y = _off(trials, image, point, found)
        return f"image {image}, point {point}, off by ({x:+.3g}, {y:+.3g}) px"
    images = ", ".join(trials.before.poses.images[ray] for ray in rays)
    (place,) = trials.block.control_places([point]) if is_known else (point,)
    known = f"the coordinates of control point {place}, or " if is_known else ""
    if len(rays) == 1:
        return f"{known}its measure in image {images}, the only one"
    return f"{known}one of the {len(rays)} measures of point {point} (images {images})"


def _off(trials: Trials, image: str, point: str, found: BundleSolution) -> FloatArray:
    """(2,) pixels by which a measure is off the solution without it."""
    (xy,) = (
        part.measures.xy[row] for part in trials.block.sets for row in rows_of(part.measures, image, point)
    )
    place = found.coordinates[[found.points.index(point)]]
    camera = found.cameras[trials.block.camera_of[image]]
    return np.asarray(xy - camera.project(found.poses[image].to_local(place))[0])
