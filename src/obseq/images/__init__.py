"""Images: cameras, poses, measures, control points, first values of a block, bundle adjustment.

Every public name is here; each is loaded when it is first used. Pixels for image coordinates; any one length
unit for the world; radians.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from obseq.geometry import Pose
    from obseq.images.adjustment.quality import BlunderSearch
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.block import Block
    from obseq.images.bundle import BundleAdjustment
    from obseq.images.camera import Camera, median_camera
    from obseq.images.clinometers import Clinometer
    from obseq.images.control import ControlPoints
    from obseq.images.initial.distribution import Distribution, check_distribution
    from obseq.images.initial.eleven import UncalibratedResection, resect_uncalibrated
    from obseq.images.initial.growth import Growth, place_images, similarity
    from obseq.images.initial.intersection import Intersection, intersect
    from obseq.images.initial.planes import PlaneResection, resect_on_plane
    from obseq.images.initial.relative import RelativeOrientation, relative_orientation
    from obseq.images.initial.resection import Resection, ResectionOptions, refine_poses, resect
    from obseq.images.initial.three_points import poses_of_triplets
    from obseq.images.measures import ImagePoints
    from obseq.images.model import CameraModel
    from obseq.images.poses import Poses
    from obseq.images.rigid import Exposures, PairStatistics, RigidBlock, initial_block, pair_statistics
    from obseq.images.weighting import Weighting

_HOMES = {
    "BlunderSearch": "images.adjustment.quality",
    "Block": "images.block",
    "BundleAdjustment": "images.bundle",
    "BundleSolution": "images.adjustment.solution",
    "Camera": "images.camera",
    "CameraModel": "images.model",
    "Clinometer": "images.clinometers",
    "ControlPoints": "images.control",
    "Distribution": "images.initial.distribution",
    "Exposures": "images.rigid",
    "Growth": "images.initial.growth",
    "ImagePoints": "images.measures",
    "Intersection": "images.initial.intersection",
    "PairStatistics": "images.rigid",
    "PlaneResection": "images.initial.planes",
    "Pose": "geometry",
    "Poses": "images.poses",
    "RelativeOrientation": "images.initial.relative",
    "Resection": "images.initial.resection",
    "ResectionOptions": "images.initial.resection",
    "RigidBlock": "images.rigid",
    "UncalibratedResection": "images.initial.eleven",
    "Weighting": "images.weighting",
    "check_distribution": "images.initial.distribution",
    "initial_block": "images.rigid",
    "intersect": "images.initial.intersection",
    "median_camera": "images.camera",
    "pair_statistics": "images.rigid",
    "place_images": "images.initial.growth",
    "poses_of_triplets": "images.initial.three_points",
    "refine_poses": "images.initial.resection",
    "relative_orientation": "images.initial.relative",
    "resect": "images.initial.resection",
    "resect_on_plane": "images.initial.planes",
    "resect_uncalibrated": "images.initial.eleven",
    "similarity": "images.initial.growth",
}

__all__ = [
    "Block",
    "BlunderSearch",
    "BundleAdjustment",
    "BundleSolution",
    "Camera",
    "CameraModel",
    "Clinometer",
    "ControlPoints",
    "Distribution",
    "Exposures",
    "Growth",
    "ImagePoints",
    "Intersection",
    "PairStatistics",
    "PlaneResection",
    "Pose",
    "Poses",
    "RelativeOrientation",
    "Resection",
    "ResectionOptions",
    "RigidBlock",
    "UncalibratedResection",
    "Weighting",
    "check_distribution",
    "initial_block",
    "intersect",
    "median_camera",
    "pair_statistics",
    "place_images",
    "poses_of_triplets",
    "refine_poses",
    "relative_orientation",
    "resect",
    "resect_on_plane",
    "resect_uncalibrated",
    "similarity",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'obseq.images' has no attribute {name!r}")
    return getattr(importlib.import_module(f"obseq.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
