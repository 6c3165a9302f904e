"""A few single observations without which a block fits: no cause that all share need be looked for then.

The worst image point is left out, or the control point is freed that most of its rays miss, once and again
while that takes away much of what is left. The block must fit without them, and not with them from there.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.images.adjustment.axes import common, turns
from obseq.images.adjustment.exchanges import rows_of
from obseq.images.adjustment.given_poses import exchanged_images
from obseq.images.adjustment.odd_control import LEAST, contradicted, off_by
from obseq.images.adjustment.trials import BAD, LOUD, squares, variance

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from obseq.arrays import FloatArray
    from obseq.images.adjustment.adjustable import AdjustableBlock
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.adjustment.trials import Trials
    from obseq.images.measures import ImagePoints
    from obseq.images.parts import PoseObservations
    from obseq.images.poses import Poses

MOST = 3
"""Observations that are left out together."""
GAIN = 0.2
"""Share of the sum of squares that each of them takes away, at least."""
MOST_SCALARS = 6
"""Of one of them: an observed pose."""
CLEAN = 2.0
"""Sigmas: where control points are off by less, and image points by less than twice, no more is wrong."""
RAYS, OF_KNOWN = 4, 3
"""Rays of a free point, and of a control point, that tell which one of them is wrong."""
OF_IMAGES = 3
"""One of so many images at most has a wrong observed pose."""
SHARED = 0.2
"""Share of its worst residual that most rays of a control point have when its coordinates are wrong."""


@dataclass(frozen=True)
class _Left:
    """What is left out of a block.

    Attributes:
        measures: image and point of each.
        control: the control point that is taken for unknown, if there is one.
        poses: images whose observed poses are.
    """

    measures: tuple[tuple[str, str], ...] = ()
    control: tuple[str, ...] = ()
    poses: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.measures) + len(self.control) + len(self.poses)

    def of(self, trials: Trials) -> AdjustableBlock | None:
        """The block without it."""
        made = trials.measured(self._kept)
        if made is not None:
            made.control = made.control.without(self.control)
            made.pose_observations = [part.without(self.poses) for part in made.pose_observations]
        return made

    def _kept(self, measures: ImagePoints) -> ImagePoints:
        gone = [row for pair in self.measures for row in rows_of(measures, *pair)]
        return measures.rows(np.delete(np.arange(len(measures)), gone))


def gross_errors(trials: Trials, least: int = 1, most_control: int = MOST) -> str:
    """Single observations that contradict all the others, in words; empty where something else is wrong.

    Args:
        trials: of the block.
        least: how many there are, or nothing is said.
        most_control: how many control points may be among them.
    """
    left, found = _Left(), trials.before
    fits = False
    while len(left) < MOST and not (fits and _is_clean(found)):
        more, without = _best(trials, left, found, most_control, _needed(found, fits))
        gain = 0.0 if without is None else squares(found) - squares(without)
        if without is None or gain < (LOUD**2 * variance(without) if fits else GAIN * squares(found)):
            break
        left, found = more, without
        fits = trials.fits(found) and (found.sigma0 or 0.0) < BAD
    is_so = fits and len(left) >= least and _are_wrong(trials, found)
    return _words(trials, left, found) if is_so else ""


def _needed(found: BundleSolution, fits: bool) -> float:
    """The sigma0 above which leaving one more out of a solution has taken too little away."""
    left = squares(found) * (1.0 if fits else 1.0 - GAIN)
    return float(np.sqrt(left / max(found.result.redundancy - MOST_SCALARS, 1)))


def _best(
    trials: Trials, left: _Left, solution: BundleSolution, most_control: int, limit: float
) -> tuple[_Left, BundleSolution | None]:
    """What is left out beside it that leaves least, and the solution; None where none serves.

    Args:
        trials: of the block.
        left: what is left out already.
        solution: without that.
        most_control: how many control points may be among what is left out.
        limit: sigma0 above which nothing serves.
    """
    tried = [
        (more, trials.once((more, solution, limit), partial(_without, trials, more, solution, limit)))
        for more in _with_the_worst(trials, left, solution)
        if len(more.control) <= most_control
    ]
    good = [(squares(found), more, found) for more, found in tried if found is not None]
    return min(good, key=lambda item: item[0])[1:] if good else (left, None)


def _is_clean(solution: BundleSolution) -> bool:
    """Whether no residual is so large that another observation may be wrong."""
    found = solution.residuals
    is_small = (np.abs(found.residuals) < 2.0 * CLEAN * found.sigmas).all()
    return bool(is_small) and not worst_control(solution, CLEAN)


def _without(trials: Trials, left: _Left, from_there: BundleSolution, limit: float) -> BundleSolution | None:
    """The block without it; from other poses where more wrong observations spoil those from the measures."""
    made, said = left.of(trials), f"the block without its {len(left)} worst observations"
    if len(trials.given):
        return trials.solved(made, said, limit=limit)
    found = trials.solved(made, said)
    if found is None and made is not None:
        made.poses = from_there.poses
        found = trials.solved(made, said, limit=limit)
    return found


def _with_the_worst(trials: Trials, left: _Left, solution: BundleSolution) -> Iterator[_Left]:
    """What is left out, and the worst observed pose, control point, or image point, beside it."""
    found = solution.residuals
    norms = np.linalg.norm(found.residuals / found.sigmas, axis=1) * np.sqrt(found.weights)
    worst = int(np.argmax(norms))
    image, point = solution.poses.images[found.image[worst]], solution.points[found.point[worst]]
    pose = worst_pose(solution)
    if pose and OF_IMAGES * (1 + len(left.poses)) <= len(solution.poses):
        yield replace(left, poses=(*left.poses, pose))
    control = worst_control(solution, norms[worst]) or point
    rays = norms[found.point == solution.points.index(control)]
    known = trials.block.control.names
    if (
        control in known
        and control not in left.control
        and len(known) - len(left.control) > LEAST
        and len(rays) >= OF_KNOWN
        and np.median(rays) > SHARED * rays.max()
    ):
        yield replace(left, control=(*left.control, control))
    yield replace(left, measures=(*left.measures, (image, point)))


def worst_pose(solution: BundleSolution) -> str:
    """The image that is off its observed pose by most of its sigmas, if these are many; else empty."""
    worst = LOUD, ""
    for part in solution.block.pose_observations:
        new, old = common(solution.poses, part.poses)
        if len(new):
            times = np.abs((new.centres - old.centres) / part.centre_sigmas).max(axis=1)
            if part.rotation_sigma is not None:
                times = np.maximum(times, turns(old, new) / part.rotation_sigma)
            worst = max(worst, (float(times.max()), new.images[int(np.argmax(times))]))
    return worst[1]


def worst_control(solution: BundleSolution, least: float) -> str:
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
    if len(left) == len(left.control):
        return contradicted(trials, left.control, found)
    said = [f"control point {place}" for place in off_by(trials, left.control, found)]
    said += [_measure(trials, image, point, found) for image, point in left.measures]
    poses = [_pose(image, part.poses, found) for image, part in _observed(trials, left.poses)]
    exchanged = [
        exchanged_images(*common(found.poses, part.poses)) for _, part in _observed(trials, left.poses)
    ]
    said += list(dict.fromkeys(filter(None, exchanged))) or poses
    what, without = ("a gross error", "it") if len(said) == 1 else (f"{len(said)} gross errors", "them")
    return f"{what}: {'; '.join(said)}. Without {without}, {trials.falls(found)}"


def _observed(trials: Trials, images: Sequence[str]) -> list[tuple[str, PoseObservations]]:
    parts = trials.block.pose_observations
    return [(image, part) for image in images for part in parts if image in part.poses]


def _pose(image: str, observed: Poses, found: BundleSolution) -> str:
    new, old = found.poses.select([image]), observed.select([image])
    x, y, z = (old.centres - new.centres)[0]
    degrees = float(np.degrees(turns(old, new)[0]))
    return (
        f"the observed pose of image {image}, off by ({x:+.3g}, {y:+.3g}, {z:+.3g}) and {degrees:.0f} degrees"
    )


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
