"""The images of one camera, all of which are wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.images.causes.cause import Cause, Members
from obseq.images.causes.conventions import slips_of_a_camera
from obseq.images.causes.image import columns_by

if TYPE_CHECKING:
    from obseq.images.causes.numbering import Numbering


def _where(numbering: Numbering) -> Members:
    """Cameras with two images or more, where there are others."""
    camera = numbering.camera
    found = columns_by(numbering, camera[numbering.image])
    several = np.bincount(camera, minlength=1)[found.labels[:, 0]] > 1
    if len(set(camera.tolist())) < 2 or several.all():
        return found if several.all() and len(several) > 1 else _nothing()
    counts = np.diff(found.starts)
    starts = np.append(0, np.cumsum(counts[several])).astype(np.int64)
    return Members(starts, found.columns[np.repeat(several, counts)], found.labels[several])


def _nothing() -> Members:
    return Members(np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros((0, 1), np.int64))


def _words(numbering: Numbering, label: tuple[int, ...]) -> str:
    return f"the images of camera {numbering.cameras[label[0]]}"


CAMERA_IMAGES = Cause(
    "I121",
    "images of a camera",
    "All that was measured in the images of one camera contradicts the others.",
    "The camera is given for images of another size, or its images are measured from another corner.",
    "Correct the camera, or what is said of its images.",
    "px",
    7.0,
    _where,
    _words,
    slips_of_a_camera,
    is_block=True,
)
