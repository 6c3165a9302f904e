"""Images: cameras, poses, measures, control points, and first values of a block.

Every public name is here; each is loaded when it is first used. Pixels for image coordinates; any one length
unit for the world; radians.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from obseq.geometry import Pose
    from obseq.images.camera import Camera, median_camera
    from obseq.images.control import ControlPoints
    from obseq.images.initial.distribution import Distribution, check_distribution
    from obseq.images.initial.resection import Resection, ResectionOptions, refine_poses, resect
    from obseq.images.initial.three_points import poses_of_triplets
    from obseq.images.measures import ImagePoints
    from obseq.images.poses import Poses

_HOMES = {
    "Camera": "images.camera",
    "ControlPoints": "images.control",
    "Distribution": "images.initial.distribution",
    "ImagePoints": "images.measures",
    "Pose": "geometry",
    "Poses": "images.poses",
    "Resection": "images.initial.resection",
    "ResectionOptions": "images.initial.resection",
    "check_distribution": "images.initial.distribution",
    "median_camera": "images.camera",
    "poses_of_triplets": "images.initial.three_points",
    "refine_poses": "images.initial.resection",
    "resect": "images.initial.resection",
}

__all__ = [
    "Camera",
    "ControlPoints",
    "Distribution",
    "ImagePoints",
    "Pose",
    "Poses",
    "Resection",
    "ResectionOptions",
    "check_distribution",
    "median_camera",
    "poses_of_triplets",
    "refine_poses",
    "resect",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'obseq.images' has no attribute {name!r}")
    return getattr(importlib.import_module(f"obseq.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
