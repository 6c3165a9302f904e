"""What is checked when measures are added to a block: that they lie in their images, and come once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import RowError
from obseq.images.names import index_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray, IntArray
    from obseq.images.camera import Camera
    from obseq.images.measures import ImagePoints

MARGIN = 10.0
"""Pixels by which a measure may lie outside its image (MMVII's)."""
MANY = 0.1
"""Share of the measures outside their images that no single mistakes explain."""


def check_known(known: Sequence[str], names: Sequence[str], used: IntArray, what: str) -> None:
    """Refuses measures (rows of `used`) whose name is not known; see `index_of`."""
    try:
        index_of(known, names, what)
    except RowError as error:
        raise RowError(str(error), int(np.argmax(used == error.row))) from None


def check_frames(cameras: Sequence[Camera], measures: ImagePoints) -> None:
    """Refuses measures outside their images; the camera of each image is given.

    Raises:
        RowError: one is.
    """
    sizes = np.array([(c.width or np.inf, c.height or np.inf) for c in cameras]).reshape(-1, 2)
    lowest = np.array([-MARGIN if c.width else -np.inf for c in cameras])
    if _are_within(measures.xy, lowest, sizes):
        return
    size, low = sizes.take(measures.image, axis=0), lowest.take(measures.image)[:, None]
    wrong = np.flatnonzero(((measures.xy < low) | (measures.xy > size + MARGIN)).any(axis=1))
    if wrong.size:
        row = int(wrong[0])
        x, y = measures.xy[row]
        camera = cameras[measures.image[row]]
        raise RowError(
            f"{measures.label(row)}: ({x:g}, {y:g}) is outside the image of {camera.width} by "
            f"{camera.height} pixels ({wrong.size} measures are)" + _origin(wrong.size, len(measures)),
            row,
        )


def _are_within(xy: FloatArray, lowest: FloatArray, sizes: FloatArray) -> bool:
    """Whether pixels lie in the smallest of several images, and so in all."""
    if not len(xy) or (np.isinf(sizes).all() and np.isinf(lowest).all()):
        return True
    low, high = xy.min(axis=0), xy.max(axis=0)
    return bool((low >= lowest.max()).all() and (high <= sizes.min(axis=0) + MARGIN).all())


def _origin(outside: int, measures: int) -> str:
    """What many measures outside their images may mean."""
    if outside < MANY * measures:
        return ""
    return (
        "; pixels are counted from the upper left corner here, x to the right, y down: for an origin in the "
        "middle of the image add half of its width and height, divide millimetres by the size of a pixel"
    )


def check_pair(known: ImagePoints, measures: ImagePoints) -> None:
    """Refuses a point that two sets measure in one image.

    Raises:
        RowError: the row of `measures` that comes again.
    """
    images = set(known.image_names) & set(measures.image_names)
    if not (images and set(known.point_names) & set(measures.point_names)):
        return
    try:
        known.joined(measures)
    except RowError as error:
        raise RowError(str(error), error.row - len(known)) from None
