"""Image coordinates of other conventions than ours: what they would be here, and whether they fit then."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.images.initial.growth import place_images
from obseq.images.initial.intersection import intersect
from obseq.images.initial.rough import misfit
from obseq.images.measure_checks import MARGIN

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from obseq.arrays import FloatArray
    from obseq.images.camera import Camera
    from obseq.images.control import ControlPoints
    from obseq.images.measures import ImagePoints
    from obseq.images.poses import Poses

MOST_MEASURES = 100_000
"""No larger block is tried again for the sake of a word."""
MOST_PLACED = 20_000
"""Nor are the images of a larger one placed again."""
MEET = 3.0
"""Pixels: rays that miss each other by less, in the median, meet."""


@dataclass(frozen=True)
class Convention:
    """Another way to give image coordinates.

    Attributes:
        trial: what is tried, in a few words.
        said: what is wrong with a block that is given so.
        change: of pixels (n, 2) and the sizes (n, 2) of their images, the pixels that are meant.
    """

    trial: str
    said: str
    change: Callable[[FloatArray, FloatArray], FloatArray]

    def of(self, measures: ImagePoints, cameras: Mapping[str, Camera]) -> ImagePoints | None:
        """What measures would be here; None where these are in no image.

        Args:
            measures: as they were given.
            cameras: by image.
        """
        sizes = np.array([(cameras[name].width, cameras[name].height) for name in measures.image_names])
        size = sizes.reshape(-1, 2)[measures.image].astype(np.float64)
        xy = self.change(measures.xy, size)
        outside = (size > 0.0) & ((xy < -MARGIN) | (xy > size + MARGIN))
        return None if outside.any() else replace(measures, xy=xy)


CONVENTIONS = (
    Convention(
        "lines counted upwards",
        "the lines of all images were counted upwards (y goes down here)",
        lambda xy, size: np.column_stack([xy[:, 0], size[:, 1] - xy[:, 1]]),
    ),
    Convention(
        "x and y exchanged",
        "x and y of all image points are exchanged (x goes to the right, y down here)",
        lambda xy, _: xy[:, ::-1].copy(),
    ),
)


def convention_that_fits(
    measures: ImagePoints, control: ControlPoints, cameras: Mapping[str, Camera], given: Poses
) -> str:
    """Why images could not be placed, where they all can in another convention; else empty."""
    if len(measures) > MOST_PLACED:
        return ""
    fits = []
    for convention in CONVENTIONS:
        changed = convention.of(measures, cameras)
        if changed is not None:
            fits.append((_misfit(changed, control, cameras, given), convention.said))
    best, said = min(fits, default=(np.inf, ""))
    return f"; {said}: so changed, all images can be placed" if best <= MEET else ""


def _misfit(
    measures: ImagePoints, control: ControlPoints, cameras: Mapping[str, Camera], given: Poses
) -> float:
    """Pixels by which rays miss each other, in the median; infinite where an image has no place."""
    try:
        growth = place_images(measures, control, cameras, given)
    except InputError:
        return np.inf
    if growth.waiting():
        return np.inf
    poses = growth.as_poses()
    return misfit(intersect(measures, poses, [cameras[image] for image in poses.images]))
