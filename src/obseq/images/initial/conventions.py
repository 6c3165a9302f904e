"""Image coordinates of other conventions than ours: what they would be here, and whether they fit then."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.images.camera import Camera
from obseq.images.measure_checks import MARGIN
from obseq.images.measures import ImagePoints
from obseq.images.names import are_among

MOST_MEASURES = 100_000
"""No larger block is tried again for the sake of a word."""
MOST_PLACED = 20_000
"""Nor are the images of a larger one placed again."""
ALIKE = 1.1
"""Times the least misfit, or sigma0, up to which explanations are as good."""


@dataclass(frozen=True)
class Convention:
    """Another way to give image coordinates.

    Attributes:
        trial: what is tried, in a few words.
        said: what is wrong with a block that is given so; of one image or camera, the end of a sentence.
        change: of pixels (n, 2) and the sizes (n, 2) of their images, the pixels that are meant.
        scale: by which their sigmas are larger too.
    """

    trial: str
    said: str
    change: Callable[[FloatArray, FloatArray], FloatArray]
    scale: float = 1.0

    def of(
        self, measures: ImagePoints, cameras: Mapping[str, Camera], images: Collection[str] | None = None
    ) -> ImagePoints | None:
        """What measures would be here; None where these are in no image.

        Args:
            measures: as they were given.
            cameras: by image.
            images: only measures in these are of the convention; None for all.
        """
        sizes = np.array([(cameras[name].width, cameras[name].height) for name in measures.image_names])
        size = sizes.reshape(-1, 2)[measures.image].astype(np.float64)
        xy = self.change(measures.xy, size)
        if images is not None:
            xy = np.where(are_among(measures.image_names, images)[measures.image, None], xy, measures.xy)
        outside = (size > 0.0) & ((xy < -MARGIN) | (xy > size + MARGIN))
        return None if outside.any() else _scaled(measures, xy, self.scale)


def _scaled(measures: ImagePoints, xy: FloatArray, scale: float) -> ImagePoints:
    return replace(
        measures, xy=xy, sigmas=scale * measures.sigmas, covariances=scale**2 * measures.covariances
    )


def _upside_down(xy: FloatArray, size: FloatArray) -> FloatArray:
    return np.column_stack([xy[:, 0], size[:, 1] - xy[:, 1]])


def _exchanged(xy: FloatArray, _: FloatArray) -> FloatArray:
    return xy[:, ::-1].copy()


CONVENTIONS = (
    Convention(
        "lines counted upwards",
        "the lines of all images were counted upwards (y goes down here)",
        _upside_down,
    ),
    Convention(
        "x and y exchanged",
        "x and y of all image points are exchanged (x goes to the right, y down here)",
        _exchanged,
    ),
)


def _of_another_size(factor: float) -> Convention:
    return Convention(
        f"its pixels times {factor:g}",
        f"pixels are those of an image of another size (x, y -> {factor:g} x, {factor:g} y)",
        lambda xy, _: factor * xy,
    )


def _all_of_another_size(factor: float) -> Convention:
    return Convention(
        f"all pixels times {factor:g}",
        "all image points were measured in images of another size than that of the camera "
        f"(x, y -> {factor:g} x, {factor:g} y)",
        lambda xy, _: factor * xy,
        factor,
    )


SIZES = tuple(_all_of_another_size(factor) for factor in (2.0, 4.0, 8.0))
"""Images that were reduced before they were measured; those that were enlarged have points outside."""


OF_ONE_IMAGE = (
    Convention(
        "its lines counted upwards",
        "lines count upwards (y -> height - y)",
        _upside_down,
    ),
    Convention(
        "its columns counted from the right",
        "columns count from the right (x -> width - x)",
        lambda xy, size: np.column_stack([size[:, 0] - xy[:, 0], xy[:, 1]]),
    ),
    Convention("its x and y exchanged", "x and y are exchanged", _exchanged),
    *(_of_another_size(factor) for factor in (2.0, 4.0, 8.0, 0.5)),
)
"""What the measures of one image, or of one camera, may be given in, where those of the others are not."""
