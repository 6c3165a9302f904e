"""Features of images that another program has matched to points, as image points of a block."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.formats.blocks.reading import note_count
from obseq.images.block import Block
from obseq.images.measures import ImagePoints


def add_features(
    block: Block,
    images: Sequence[str],
    points: Sequence[str],
    image: IntArray,
    point: IntArray,
    xy: FloatArray,
) -> None:
    """Adds features, one pixel each; of two of an image and a point the first one counts.

    Args:
        block: whose images are known.
        images: (k,) names.
        points: (l,) names.
        image: (n,) image of each feature, a position in `images`.
        point: (n,) its point.
        xy: (n, 2) pixels.
    """
    keys = image * max(len(points), 1) + point
    kept = np.sort(np.unique(keys, return_index=True)[1])
    again = np.setdiff1d(np.arange(len(keys)), kept).tolist()
    labels = [f"image {images[image[row]]} point {points[point[row]]}" for row in again]
    note_count(block, labels, "features are left out: their points have another one in the image")
    block.add_measures(ImagePoints.packed(images, points, image[kept], point[kept], xy[kept]))
