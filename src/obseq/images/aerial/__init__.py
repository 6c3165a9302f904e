"""Aerial images on a map: from image to ground and back, intersection, resection, RPC, Borea's files.

Image axes: columns to the right, lines downwards, pixels. Map coordinates and z in metres.
"""

from typing import TYPE_CHECKING

from obseq.lazy import lazy_names

if TYPE_CHECKING:
    from obseq.images.aerial.angles import angles_from_matrices, matrices_from_angles
    from obseq.images.aerial.control import ResidualStatistics, residual_statistics
    from obseq.images.aerial.files import (
        BadLine,
        GroundPoints,
        ImagePoints,
        ground_text,
        image_text,
        read_camera,
        read_ground_points,
        read_image_points,
        read_shots,
        shots_text,
    )
    from obseq.images.aerial.frames import ApproximateFrames, LocalFrames
    from obseq.images.aerial.heights import (
        Geoid,
        HeightType,
        add_alteration,
        convert_heights,
        remove_alteration,
    )
    from obseq.images.aerial.intersection import (
        PairPoints,
        RayPoints,
        intersect_pairs,
        intersect_rays,
        most_distant_pairs,
    )
    from obseq.images.aerial.mapping import MapSystem
    from obseq.images.aerial.resection import Resection, resect, seed_points
    from obseq.images.aerial.rpc import Rpc, fit_rpc
    from obseq.images.aerial.shots import FrameCamera, Shots
    from obseq.images.aerial.surfaces import ConstantHeight, Surface, Terrain, read_terrain
    from obseq.images.aerial.worksite import Worksite

_HOMES = {
    "angles": ("angles_from_matrices", "matrices_from_angles"),
    "control": ("ResidualStatistics", "residual_statistics"),
    "files": (
        "BadLine",
        "GroundPoints",
        "ImagePoints",
        "ground_text",
        "image_text",
        "read_camera",
        "read_ground_points",
        "read_image_points",
        "read_shots",
        "shots_text",
    ),
    "frames": ("ApproximateFrames", "LocalFrames"),
    "heights": ("Geoid", "HeightType", "add_alteration", "convert_heights", "remove_alteration"),
    "intersection": ("PairPoints", "RayPoints", "intersect_pairs", "intersect_rays", "most_distant_pairs"),
    "mapping": ("MapSystem",),
    "resection": ("Resection", "resect", "seed_points"),
    "rpc": ("Rpc", "fit_rpc"),
    "shots": ("FrameCamera", "Shots"),
    "surfaces": ("ConstantHeight", "Surface", "Terrain", "read_terrain"),
    "worksite": ("Worksite",),
}

__all__ = [
    "ApproximateFrames",
    "BadLine",
    "ConstantHeight",
    "FrameCamera",
    "Geoid",
    "GroundPoints",
    "HeightType",
    "ImagePoints",
    "LocalFrames",
    "MapSystem",
    "PairPoints",
    "RayPoints",
    "Resection",
    "ResidualStatistics",
    "Rpc",
    "Shots",
    "Surface",
    "Terrain",
    "Worksite",
    "add_alteration",
    "angles_from_matrices",
    "convert_heights",
    "fit_rpc",
    "ground_text",
    "image_text",
    "intersect_pairs",
    "intersect_rays",
    "matrices_from_angles",
    "most_distant_pairs",
    "read_camera",
    "read_ground_points",
    "read_image_points",
    "read_shots",
    "read_terrain",
    "remove_alteration",
    "resect",
    "residual_statistics",
    "seed_points",
    "shots_text",
]

__getattr__, __dir__ = lazy_names(__name__, _HOMES, __all__)
