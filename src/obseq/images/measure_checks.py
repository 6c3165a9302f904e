"""What is checked when measures are added to a block: that they lie in their images, and come once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.errors import RowError
from obseq.images.camera import Camera
from obseq.images.measures import ImagePoints
from obseq.images.names import index_of

MARGIN = 10.0
"""Pixels by which a measure may lie outside its image (MMVII's)."""
FEW, FEW_ON_ONE_SIDE = 4, 12
"""Measures that say nothing of their unit are fewer; in millimetres from the corner there are more."""
SMALL = 0.05
"""Share of their images within which measures about the corner are in another unit."""
CONVENTION = (
    "; pixels are counted from the upper left corner here, x to the right, y down: for an origin in the "
    "middle of the image add half of its width and height, divide millimetres by the size of a pixel"
)
EXCHANGED = (
    "; with x and y exchanged all are inside: x goes to the right here, y down. If the images were turned by "
    "90 degrees before they were measured, exchange width and height of the camera, and turn its principal "
    "point"
)
CHANCE = 0.02
"""Probability that all measures of their images, wherever these are, lie inside with x and y exchanged."""
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
    _check_unit(measures, sizes)
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
            f"{camera.height} pixels ({wrong.size} {'measure is' if wrong.size == 1 else 'measures are'})"
            + _convention(measures, wrong.size, low, size),
            row,
        )


def _check_unit(measures: ImagePoints, sizes: FloatArray) -> None:
    """Refuses measures that all lie about the corner of their images: on both sides of it, or many."""
    if len(measures) < FEW or not np.isfinite(sizes).all():
        return
    low, high = measures.xy.min(axis=0), measures.xy.max(axis=0)
    is_told = (low < 0.0).all() or len(measures) >= FEW_ON_ONE_SIDE
    if is_told and (np.maximum(-low, high) < SMALL * sizes.min(axis=0)).all():
        (x, y), (wide, deep) = np.maximum(-low, high), sizes.min(axis=0)
        raise RowError(
            f"{measures.label(0)}: all measures lie within {x:.3g} by {y:.3g} of the corner of images of "
            f"{wide:g} by {deep:g} pixels" + CONVENTION,
            0,
        )


def _are_within(xy: FloatArray, lowest: FloatArray, sizes: FloatArray) -> bool:
    """Whether pixels lie in the smallest of several images, and so in all."""
    if not len(xy) or (np.isinf(sizes).all() and np.isinf(lowest).all()):
        return True
    low, high = xy.min(axis=0), xy.max(axis=0)
    return bool((low >= lowest.max()).all() and (high <= sizes.min(axis=0) + MARGIN).all())


def _convention(measures: ImagePoints, outside: int, low: FloatArray, size: FloatArray) -> str:
    """What many measures outside their images may mean."""
    exchanged = measures.xy[:, ::-1]
    are_inside = bool(((exchanged >= low) & (exchanged <= size + MARGIN)).all())
    chance = (size.min(axis=1) / size.max(axis=1)).prod()
    if are_inside and outside > 1 and (chance < CHANCE or outside >= MANY * len(measures)):
        return EXCHANGED
    if outside < MANY * len(measures):
        return "; correct it, or delete its line" if outside == 1 else "; correct them, or delete their lines"
    return CONVENTION


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
