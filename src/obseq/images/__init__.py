"""Images: cameras, poses, measures, control points, first values of a block, bundle adjustment.

Every public name is here; each is loaded when it is first used. Pixels for image coordinates; any one length
unit for the world; radians.
"""

from typing import TYPE_CHECKING

from obseq.lazy import lazy_names

if TYPE_CHECKING:
    from obseq.geometry import RigidMotion
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
    ".geometry": ("RigidMotion",),
    "adjustment.quality": ("BlunderSearch",),
    "adjustment.solution": ("BundleSolution",),
    "block": ("Block",),
    "bundle": ("BundleAdjustment",),
    "camera": ("Camera", "median_camera"),
    "clinometers": ("Clinometer",),
    "control": ("ControlPoints",),
    "initial.distribution": ("Distribution", "check_distribution"),
    "initial.eleven": ("UncalibratedResection", "resect_uncalibrated"),
    "initial.growth": ("Growth", "place_images", "similarity"),
    "initial.intersection": ("Intersection", "intersect"),
    "initial.planes": ("PlaneResection", "resect_on_plane"),
    "initial.relative": ("RelativeOrientation", "relative_orientation"),
    "initial.resection": ("Resection", "ResectionOptions", "refine_poses", "resect"),
    "initial.three_points": ("poses_of_triplets",),
    "measures": ("ImagePoints",),
    "model": ("CameraModel",),
    "poses": ("Poses",),
    "rigid": ("Exposures", "PairStatistics", "RigidBlock", "initial_block", "pair_statistics"),
    "weighting": ("Weighting",),
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
    "Poses",
    "RelativeOrientation",
    "Resection",
    "ResectionOptions",
    "RigidBlock",
    "RigidMotion",
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

__getattr__, __dir__ = lazy_names(__name__, _HOMES, __all__, {"Pose": "RigidMotion"})
