"""Project trees of MMVII (`MMVII-PhgrProj`) and MicMac's files, as objects of `obseq.images` and back."""

from typing import TYPE_CHECKING

from obseq.lazy import lazy_names

if TYPE_CHECKING:
    from obseq.project.assembly import assembled
    from obseq.project.bundle_options import BundleOptions, parse_options
    from obseq.project.cameras import (
        calibration_text,
        pose_text,
        read_calibration,
        read_orientation,
        read_pose,
        write_orientation,
    )
    from obseq.project.layout import ProjectTree
    from obseq.project.metadata import Rules, chosen, names_text, read_names, read_rules, rules_text
    from obseq.project.micmac_v1 import read_v1_orientation
    from obseq.project.micmac_v1_block import read_v1_block
    from obseq.project.points import (
        measures_text,
        points_text,
        read_control_points,
        read_image_measures,
        read_system,
        system_text,
    )
    from obseq.project.rigid_blocks import BlockFile, block_text, read_block
    from obseq.project.tie_points import find_pairs, pairs_text, read_pairs, read_tracks
    from obseq.project.topo import read_topo, topo_text
    from obseq.project.tree import read_tree, tree_text

_HOMES = {
    "assembly": ("assembled",),
    "bundle_options": ("BundleOptions", "parse_options"),
    "rigid_blocks": ("BlockFile", "block_text", "read_block"),
    "cameras": (
        "calibration_text",
        "pose_text",
        "read_calibration",
        "read_orientation",
        "read_pose",
        "write_orientation",
    ),
    "layout": ("ProjectTree",),
    "metadata": ("Rules", "chosen", "names_text", "read_names", "read_rules", "rules_text"),
    "micmac_v1": ("read_v1_orientation",),
    "micmac_v1_block": ("read_v1_block",),
    "points": (
        "measures_text",
        "points_text",
        "read_control_points",
        "read_image_measures",
        "read_system",
        "system_text",
    ),
    "tie_points": ("find_pairs", "pairs_text", "read_pairs", "read_tracks"),
    "topo": ("read_topo", "topo_text"),
    "tree": ("read_tree", "tree_text"),
}

__all__ = [
    "BlockFile",
    "BundleOptions",
    "ProjectTree",
    "Rules",
    "assembled",
    "block_text",
    "calibration_text",
    "chosen",
    "find_pairs",
    "measures_text",
    "names_text",
    "pairs_text",
    "parse_options",
    "points_text",
    "pose_text",
    "read_block",
    "read_calibration",
    "read_control_points",
    "read_image_measures",
    "read_names",
    "read_orientation",
    "read_pairs",
    "read_pose",
    "read_rules",
    "read_system",
    "read_topo",
    "read_tracks",
    "read_tree",
    "read_v1_block",
    "read_v1_orientation",
    "rules_text",
    "system_text",
    "topo_text",
    "tree_text",
    "write_orientation",
]

__getattr__, __dir__ = lazy_names(__name__, _HOMES, __all__)
