"""All causes of blocks: a new one is an object in a file, and a line here."""

from __future__ import annotations

from obseq.images.causes.axes import CONTROL_AXES, IMAGE_AXES, REDUCED_IMAGES
from obseq.images.causes.cameras import FOCAL_LENGTH, HELD_PARAMETER, UNDETERMINED_CAMERAS
from obseq.images.causes.control_sigmas import CONTROL_SIGMAS
from obseq.images.causes.given_poses import GIVEN_POSES
from obseq.images.causes.images import CAMERA_IMAGES, IMAGE
from obseq.images.causes.other_observation import OTHER
from obseq.images.causes.points import CONTROL_COORDINATE, CONTROL_POINT, IMAGE_POINT
from obseq.images.causes.survey_equations import SURVEY_VALUES
from obseq.images.causes.unit_of_control import UNIT_OF_CONTROL

CAUSES = (
    IMAGE_POINT,
    CONTROL_COORDINATE,
    CONTROL_POINT,
    OTHER,
    IMAGE,
    CAMERA_IMAGES,
    HELD_PARAMETER,
)

SHARED = (
    UNDETERMINED_CAMERAS,
    SURVEY_VALUES,
    UNIT_OF_CONTROL,
    CONTROL_SIGMAS,
    REDUCED_IMAGES,
    GIVEN_POSES,
    IMAGE_AXES,
    CONTROL_AXES,
    FOCAL_LENGTH,
)
"""Mistakes that a whole block shares, those of which the evidence is strongest first."""
