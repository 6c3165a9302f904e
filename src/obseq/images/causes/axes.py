"""Axes of all image points, or of control points, that are not those of here; images of another size."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from obseq.arrays import FloatArray
from obseq.images.adjustment.adjustable import AdjustableBlock
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.camera import Camera
from obseq.images.causes.comparison import principal_shift
from obseq.images.causes.shared import SharedCause, Subject, Told, Trial
from obseq.images.control import ControlPoints
from obseq.images.initial.conventions import CONVENTIONS, SIZES, Convention
from obseq.images.measures import ImagePoints

OFF_MIDDLE = 0.1
"""Share of the size of an image by which no principal point is off its middle, as a rule."""
TIMES = 3.0
"""Times smaller than that share the shift of a principal point must become where images were reduced."""
EASTINGS = (1e5, 1e6)
"""Metres: between these are eastings of most grids, and northings above the second."""
LIKELIER = 6.0
"""Squares by which coordinates that look like northings first speak for their exchange."""
MIRRORED = ", or their heights count downwards, or are at the place of another coordinate"
"""What nothing tells from x and y exchanged where no pose is known: both are one mirror image."""
ORDERS = (
    ((1, 0, 2), "x and y", "easting comes first here"),
    ((0, 2, 1), "y and z", "z is the height here"),
    ((2, 1, 0), "x and z", "z is the height here"),
)


def _cameras(block: AdjustableBlock) -> dict[str, Camera]:
    return {image: block.cameras[name] for image, name in block.camera_of.items()}


def _measured(
    subject: Subject, change: Callable[[ImagePoints], ImagePoints | None]
) -> AdjustableBlock | None:
    """The block with other measures; None where these lie outside their images."""
    made, sets = _as_given(subject), []
    for part in made.sets:
        measures = change(part.measures)
        if measures is None:
            return None
        sets.append(replace(part, measures=measures))
    made.sets = sets
    return made


def _as_given(subject: Subject) -> AdjustableBlock:
    made = subject.block.copied()
    made.poses = subject.given
    return made


def _of_images(subject: Subject, conventions: tuple[Convention, ...]) -> Iterator[Trial]:
    cameras = _cameras(subject.block)
    for each in conventions:
        made = _measured(subject, partial(each.of, cameras=cameras))
        if made is not None:
            yield Trial.saying(each.trial, Told(each.said), made)


def _image_axes(subject: Subject) -> Iterator[Trial]:
    sized = all(camera.width and camera.height for camera in _cameras(subject.block).values())
    yield from _of_images(subject, (*CONVENTIONS, *(SIZES if sized else ())))
    yield from _turned_back(subject)


def with_exchanged_axes(control: ControlPoints, order: tuple[int, int, int] = (1, 0, 2)) -> ControlPoints:
    """Control points with their coordinates in another order: the first two exchanged if nothing is said."""
    rows = list(order)
    covariances = control.covariances[:, rows][:, :, rows].copy()
    return replace(control, coordinates=control.coordinates[:, rows].copy(), covariances=covariances)


def _control_axes(subject: Subject) -> Iterator[Trial]:
    """Orders of the coordinates; heights at another place, and downwards, only poses tell from others."""
    control = subject.block.control
    if not len(control):
        return
    block = subject.block
    is_placed = bool(len(subject.given) or block.pose_observations or block.antennas)
    for order, axes, here in ORDERS if is_placed else ORDERS[:1]:
        made = _as_given(subject)
        made.control = with_exchanged_axes(control, order)
        said = f"{axes} of the control points are exchanged ({here})"
        said += "" if is_placed else MIRRORED
        told = Told(said, likelier=LIKELIER if _are_northings_first(control) else 0.0)
        yield Trial.saying(f"{axes} of control points exchanged", told, made)
    if is_placed:
        made = _as_given(subject)
        made.control = replace(control, coordinates=control.coordinates * [1.0, 1.0, -1.0])
        said = "the heights of the control points count downwards (z goes up here)"
        yield Trial.saying("heights of control points counted downwards", Told(said), made)


def _are_northings_first(control: ControlPoints) -> bool:
    """Whether coordinates look like northings and eastings of a grid, in this order."""
    x, y, _ = np.median(control.coordinates, axis=0)
    return bool(x > EASTINGS[1] and EASTINGS[0] <= y < EASTINGS[1])


def _turned_back(subject: Subject) -> Iterator[Trial]:
    """Cameras whose principal points were given for images that were turned by 90 degrees afterwards."""
    given = {name: subject.block.cameras[name] for name in set(subject.block.camera_of.values())}
    for quarter, turn in (("90", _clockwise), ("-90", _anticlockwise)):
        cameras = {name: replace(c, principal_point=turn(c)) for name, c in given.items()}
        if all(_off_middle(c) < OFF_MIDDLE < _off_middle(given[name]) for name, c in cameras.items()):
            made = _as_given(subject)
            made.cameras = {**made.cameras, **cameras}
            said = "principal points were given for images that have been turned by 90 degrees since"
            yield Trial.saying(f"principal points turned by {quarter} degrees", Told(said), made)


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


def _is_far(subject: Subject) -> bool:
    """Whether a free principal point has moved so far that the images may be of another size."""
    if subject.solution is None:
        return False
    least = min(min(c.width, c.height) for c in _cameras(subject.block).values())
    return principal_shift(subject.solution) > OFF_MIDDLE * least > 0


def _reduced(subject: Subject) -> Iterator[Trial]:
    """A free principal point makes a block of reduced images fit all the same, far off the middle."""
    if not _is_far(subject) or subject.solution is None:
        return
    before = principal_shift(subject.solution)

    def told(found: BundleSolution, trial: Trial) -> Told:
        is_it = TIMES * principal_shift(found) < OFF_MIDDLE * before
        return trial.told(found) if is_it else Told("")

    for trial in _of_images(subject, SIZES):
        yield replace(trial, told=partial(told, trial=trial))


IMAGE_AXES = SharedCause(
    "I151",
    "axes of image points",
    "All image points are counted along other axes, or in pixels of another size.",
    "Lines counted upwards, line and column exchanged, points measured in reduced copies.",
    "Convert the measures: x to the right, y down, in pixels of the camera.",
    6.0,
    _image_axes,
)
REDUCED_IMAGES = SharedCause(
    "I153",
    "reduced images",
    "All image points were measured in images of another size than the camera is given for.",
    "Points measured in copies of half the size.",
    "Convert the measures, or give the camera for the size that was measured in.",
    6.0,
    _reduced,
    _is_far,
)
CONTROL_AXES = SharedCause(
    "I152",
    "axes of control",
    "The coordinates of the control points are in another order, or count the other way.",
    "Northing before easting, heights as depths.",
    "Give easting, northing and height, in this order.",
    6.0,
    _control_axes,
)
