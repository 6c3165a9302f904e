"""All causes that a whole block shares, those of which the evidence is strongest first."""

from __future__ import annotations

from obseq.images.causes.axes import CONTROL_AXES, IMAGE_AXES, REDUCED_IMAGES
from obseq.images.causes.control_sigmas import CONTROL_SIGMAS
from obseq.images.causes.focal_length import FOCAL_LENGTH
from obseq.images.causes.given_poses import GIVEN_POSES
from obseq.images.causes.undetermined_cameras import UNDETERMINED_CAMERAS
from obseq.images.causes.unit_of_control import UNIT_OF_CONTROL

SHARED = (
    UNDETERMINED_CAMERAS,
    UNIT_OF_CONTROL,
    CONTROL_SIGMAS,
    REDUCED_IMAGES,
    GIVEN_POSES,
    IMAGE_AXES,
    CONTROL_AXES,
    FOCAL_LENGTH,
)
