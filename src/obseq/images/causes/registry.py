"""All causes of blocks: a new one is an object in a file of its own, and a line here."""

from __future__ import annotations

from obseq.images.causes.camera_images import CAMERA_IMAGES
from obseq.images.causes.control_coordinate import CONTROL_COORDINATE
from obseq.images.causes.control_point import CONTROL_POINT
from obseq.images.causes.held_parameter import HELD_PARAMETER
from obseq.images.causes.image import IMAGE
from obseq.images.causes.image_point import IMAGE_POINT
from obseq.images.causes.other_observation import OTHER

CAUSES = (
    IMAGE_POINT,
    CONTROL_COORDINATE,
    CONTROL_POINT,
    OTHER,
    IMAGE,
    CAMERA_IMAGES,
    HELD_PARAMETER,
)
