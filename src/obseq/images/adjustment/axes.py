"""Axes that are not those of here, or another size of all images: of image points, or of control points.

Exchanged axes of the control points mirror them, and so do those of all images: without poses that are known,
or a principal point that is off the middle, either explains the other, and both are named.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.images.initial.conventions import ALIKE, CONVENTIONS, SIZES
from obseq.images.names import are_among

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from obseq.arrays import FloatArray
    from obseq.images.adjustment.adjustable import AdjustableBlock
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.adjustment.trials import Attempts, Trials
    from obseq.images.camera import Camera
    from obseq.images.control import ControlPoints
    from obseq.images.poses import Poses

TIMES, PIXELS, MOVED = 3.0, 5.0, 0.2
"""Explanations are alike that move principal points and poses by no more than so many times the least: and
these pixels, this share of the extent and radians."""
ELSEWHERE = 0.5
"""Radians and shares of the extent by which poses were not given for the axes with which a block fits."""
OFF_MIDDLE = 0.1
"""Share of the size of an image by which no principal point is off its middle, as a rule."""
EASTINGS = (1e5, 1e6)
"""Metres: between these are eastings of most grids, and northings above the second."""


@dataclass(frozen=True, eq=False)
class Axes:
    """Axes that explain a block.

    Attributes:
        said: what is exchanged, in words; or all that explains it as well.
        found: the solution of the block that is changed so.
    """

    said: str
    found: BundleSolution


@dataclass(frozen=True, eq=False)
class _Fit(Axes):
    """A change of axes that makes a block fit.

    Attributes:
        shift: pixels by which a principal point moved, at most: a wrong change needs it to.
        moved: by how much the poses moved from those that were given, in radians and shares of their extent.
    """

    shift: float
    moved: float

    @property
    def sigma0(self) -> float:
        """Of the changed block."""
        return float(self.found.sigma0 or 0.0)


def exchanged_axes(attempts: Attempts) -> Axes | None:
    """The axes that explain a block, or those that do alike; None where none do."""
    fits = list(_fits(attempts, _changed(attempts)))
    if not fits:
        return None
    if min(fit.moved for fit in fits) > ELSEWHERE:
        fits += _fits(attempts, _with_heights(attempts))
    good = _alike(fits)
    return Axes(", or ".join(dict.fromkeys(fit.said for fit in good)), good[0].found)


def _fits(attempts: Attempts, changed: Iterable[tuple[str, str, AdjustableBlock | None]]) -> Iterator[_Fit]:
    for trial, said, block in changed:
        found = attempts.fitting(block, trial)
        if found is not None:
            yield _Fit(said, found, _principal_shift(found), moved(found.poses, attempts.given))


def axes_in_words(attempts: Attempts, axes: Axes | None) -> str:
    """Axes that explain a block, with what becomes of it; empty for none."""
    return "" if axes is None else f"{axes.said}: {attempts.becomes(axes.found)}"


def _alike(fits: list[_Fit]) -> list[_Fit]:
    """Those that nothing tells apart: neither given poses, nor what is left, nor the cameras."""
    least = min(fit.moved for fit in fits)
    fits = [fit for fit in fits if fit.moved <= TIMES * least + MOVED]
    least = min(fit.sigma0 for fit in fits)
    fits = [fit for fit in fits if fit.sigma0 <= ALIKE * least]
    least = min(fit.shift for fit in fits)
    return [fit for fit in fits if fit.shift <= TIMES * least + PIXELS]


def _changed(attempts: Attempts) -> Iterator[tuple[str, str, AdjustableBlock | None]]:
    """What is tried, what is said of it, and the block: the likeliest first."""
    cameras = attempts.cameras
    sizes = SIZES if all(camera.width and camera.height for camera in cameras.values()) else ()
    tried = [(each, attempts.measured(partial(each.of, cameras=cameras))) for each in (*CONVENTIONS, *sizes)]
    images = [(each.trial, each.said, block) for each, block in tried]
    made, control = attempts.copy(), attempts.block.control
    made.control = with_exchanged_axes(control)
    like = "" if len(attempts.given) else "; heights that count downwards look the same"
    said = f"x and y of the control points are exchanged (easting comes first here{like})"
    known = [("x and y of control points exchanged", said, made)] if len(control) else []
    yield from [*known, *images] if _are_northings_first(control) else [*images, *known]
    if len(attempts.given) and len(control):
        yield _upside_down(attempts)
    yield from _turned_back(attempts)


def _with_heights(attempts: Attempts) -> Iterator[tuple[str, str, AdjustableBlock]]:
    """Heights at the place of a coordinate: a mirror image too, which given poses alone tell from others."""
    for letter, order in (("y", (0, 2, 1)), ("x", (2, 1, 0))):
        made = attempts.copy()
        made.control = with_exchanged_axes(made.control, order)
        said = f"{letter} and z of the control points are exchanged (z is the height here)"
        yield f"{letter} and z of control points exchanged", said, made


def _upside_down(attempts: Attempts) -> tuple[str, str, AdjustableBlock]:
    made, control = attempts.copy(), attempts.block.control
    made.control = replace(control, coordinates=control.coordinates * [1.0, 1.0, -1.0])
    said = "the heights of the control points count downwards (z goes up here)"
    return "heights of control points counted downwards", said, made


def _turned_back(attempts: Attempts) -> Iterator[tuple[str, str, AdjustableBlock]]:
    """Cameras whose principal points were given for images that were turned by 90 degrees afterwards."""
    for quarter, turn in (("90", _clockwise), ("-90", _anticlockwise)):
        cameras = {name: replace(c, principal_point=turn(c)) for name, c in attempts.block.cameras.items()}
        if all(
            _off_middle(c) < OFF_MIDDLE < _off_middle(attempts.block.cameras[c.name])
            for c in cameras.values()
        ):
            made = attempts.copy()
            made.cameras = cameras
            points = ", ".join(
                f"{name}: {c.principal_point[0]:g}, {c.principal_point[1]:g}" for name, c in cameras.items()
            )
            said = (
                "principal points were given for images that have been turned by 90 degrees "
                f"(of the images as measured they are {points})"
            )
            yield f"principal points turned by {quarter} degrees", said, made


def _clockwise(camera: Camera) -> FloatArray:
    x, y = camera.principal_point
    return np.array([camera.width - y, x])


def _anticlockwise(camera: Camera) -> FloatArray:
    x, y = camera.principal_point
    return np.array([y, camera.height - x])


def _off_middle(camera: Camera) -> float:
    """Share of the size of its images by which a principal point is off the middle; 0 without a size."""
    size = np.array([camera.width, camera.height], dtype=np.float64)
    return float(np.abs(camera.principal_point / size - 0.5).max()) if size.all() else 0.0


def with_exchanged_axes(control: ControlPoints, order: tuple[int, int, int] = (1, 0, 2)) -> ControlPoints:
    """Control points with their coordinates in another order: the first two exchanged if nothing is said."""
    rows = list(order)
    covariances = control.covariances[:, rows][:, :, rows].copy()
    return replace(control, coordinates=control.coordinates[:, rows].copy(), covariances=covariances)


def _are_northings_first(control: ControlPoints) -> bool:
    """Whether coordinates look like northings and eastings of a grid, in this order."""
    if not len(control):
        return False
    x, y, _ = np.median(control.coordinates, axis=0)
    return bool(x > EASTINGS[1] and EASTINGS[0] <= y < EASTINGS[1])


def reduced_images(trials: Trials) -> str:
    """That all points were measured in smaller images than those of the camera, in words; else empty.

    A free principal point makes a block fit all the same, far off the middle.
    """
    shift, cameras = _principal_shift(trials.before), trials.cameras
    least = min((min(camera.width, camera.height) for camera in cameras.values()), default=0)
    for each in SIZES if shift > OFF_MIDDLE * least > 0 else ():
        found = trials.solved(trials.measured(partial(each.of, cameras=cameras)), each.trial)
        if found is not None and TIMES * _principal_shift(found) < OFF_MIDDLE * shift:
            off = _principal_shift(found)
            return (
                f"{each.said}: so changed, the principal point moves by {off:.3g} px, not by {shift:.4g}, "
                f"and sigma0 is {found.sigma0:.3g}"
            )
    return ""


def _principal_shift(found: BundleSolution) -> float:
    given = found.block.cameras
    shifts = [c.principal_point - given[name].principal_point for name, c in found.cameras.items()]
    return float(np.abs(shifts).max(initial=0.0))


def moved(found: Poses, given: Poses) -> float:
    """By how much poses moved, in the median: radians, and shares of the extent of their centres."""
    new, old = common(found, given)
    if not len(new):
        return 0.0
    extent = max(float(np.linalg.norm(np.ptp(found.centres, axis=0))), 1e-12)
    shares = np.linalg.norm(new.centres - old.centres, axis=1) / extent
    return float(np.median(turns(old, new)) + np.median(shares))


def common(first: Poses, second: Poses) -> tuple[Poses, Poses]:
    """The poses of the images that both have."""
    known = list(itertools.compress(first.images, are_among(first.images, second.images)))
    return first.select(known), second.select(known)


def turns(first: Poses, second: Poses) -> FloatArray:
    """(n,) radians between the rotations of the same images."""
    return angles_of(np.swapaxes(first.rotations, 1, 2) @ second.rotations)


def angles_of(rotations: FloatArray) -> FloatArray:
    """(n,) radians by which rotations (n, 3, 3) turn."""
    traces = np.trace(rotations, axis1=1, axis2=2)
    return np.asarray(np.arccos(np.clip(0.5 * (traces - 1.0), -1.0, 1.0)))
