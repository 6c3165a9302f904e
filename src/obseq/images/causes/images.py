"""Images whose measures are all wrong: one of them, or all of a camera."""

from __future__ import annotations

import numpy as np

from obseq.arrays import IntArray
from obseq.images.causes.cause import Cause, Members
from obseq.images.causes.conventions import slips_of_a_camera, slips_of_images
from obseq.images.causes.numbering import Numbering

LEAST = 4
"""Image points of an image: three determine its pose, whatever they are."""


def columns_by(numbering: Numbering, owner: IntArray) -> Members:
    """All image points of each owner (m,)."""
    rows = np.flatnonzero(numbering.kept)
    columns = (2 * rows[:, None] + np.arange(2)).ravel()
    return Members.grouped(columns, np.repeat(owner[rows], 2), 2 * LEAST)


def _words_of_image(numbering: Numbering, label: tuple[int, ...]) -> str:
    return f"image {numbering.equations.start.poses.images[label[0]]}"


IMAGE = Cause(
    "I120",
    "image",
    "All that was measured in an image contradicts the others.",
    "Its lines were counted upwards, it was measured in a reduced copy, or it is of another camera.",
    "Correct what is said of the image, or measure it again.",
    "px",
    5.0,
    lambda numbering: columns_by(numbering, numbering.image),
    _words_of_image,
    slips_of_images,
    is_block=True,
)


def _where_of_camera(numbering: Numbering) -> Members:
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


def _words_of_camera(numbering: Numbering, label: tuple[int, ...]) -> str:
    return f"the images of camera {numbering.cameras[label[0]]}"


CAMERA_IMAGES = Cause(
    "I121",
    "images of a camera",
    "All that was measured in the images of one camera contradicts the others.",
    "The camera is given for images of another size, or its images are measured from another corner.",
    "Correct the camera, or what is said of its images.",
    "px",
    7.0,
    _where_of_camera,
    _words_of_camera,
    slips_of_a_camera,
    is_block=True,
)
