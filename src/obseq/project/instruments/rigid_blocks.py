"""Rigid blocks of a project (`CalibBlocCam`): relative poses of cameras, and what image names tell."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.geometry import RigidMotion
from obseq.project.metadata import whole_match
from obseq.project.tree import Reader, Tree, merged, pairs, read_tree, tree_text

BLOCK = "CalibBlocCam"
ORTHONORMAL = 1e-6
"""How far the axes of a pose may be from orthonormal: files of fewer digits than usual still are."""
_INVERSE = ("PatternInv", "ReplaceInv", "SeparatorInv")


@dataclass(frozen=True)
class BlockFile:
    """A rigid block of cameras as a project describes it.

    Attributes:
        name: of the block.
        master: identifier of the camera whose frame is that of the block.
        pattern: of the names of its images.
        camera_group: number of the group of the pattern that is the identifier of the camera, from 1.
        exposure_group: number of the group that is the identifier of the exposure, from 1.
        poses: by camera, the pose camera to block.
        content: what stands in the file that it was read from; what it says besides is kept.
    """

    name: str
    master: str
    pattern: str
    camera_group: int
    exposure_group: int
    poses: dict[str, RigidMotion]
    content: Tree = field(default_factory=dict)

    def camera_and_exposure(self, image: str) -> tuple[str, str]:
        """Identifiers of the camera and of the exposure of an image.

        Raises:
            InputError: if its name does not match.
        """
        match = whole_match(self.pattern, image, f"block {self.name}")
        if match is None:
            raise InputError(f"block {self.name}: the image {image} does not match {self.pattern!r}")
        if max(self.camera_group, self.exposure_group) > match.re.groups:
            raise InputError(f"block {self.name}: {self.pattern!r} has only {match.re.groups} groups")
        return match[self.camera_group], match[self.exposure_group]

    def exposures(self, images: Iterable[str]) -> dict[str, dict[str, str]]:
        """Images by exposure and camera.

        Raises:
            InputError: if two images are of one camera and exposure.
        """
        found: dict[str, dict[str, str]] = {}
        for image in images:
            camera, exposure = self.camera_and_exposure(image)
            there = found.setdefault(exposure, {})
            if camera in there:
                raise InputError(
                    f"block {self.name}: {there[camera]} and {image} are both of camera {camera}, "
                    f"exposure {exposure}"
                )
            there[camera] = image
        return found


def read_block(path: str | Path) -> BlockFile:
    """The block of a file ``RigBlock/<Folder>/RigidBloc_<name>.xml``; those of 2024 lack the inverse names.

    Raises:
        InputError: with file and field.
    """
    fields = Reader(read_tree(path), str(path)).fields(BLOCK)
    for name in _INVERSE:
        fields.text(name, "")
    poses = {}
    for key, value in pairs(fields.list("PoseRel"), f"{path}: PoseRel"):
        one = Reader(value, f"{path}: PoseRel: {key}")
        poses[str(key)] = read_pose_fields(one)
    return BlockFile(
        fields.text("Name"),
        fields.text("Master"),
        fields.text("Pattern"),
        fields.integer("KBloc"),
        fields.integer("KSync"),
        poses,
        fields.tree,
    )


def read_pose_fields(fields: Reader) -> RigidMotion:
    """A pose as blocks have it: `Center` and `RotMatrix`."""
    axes = fields.fields("RotMatrix")
    rotation = np.array([axes.numbers(f"Axe{letter}", 3) for letter in "IJK"], dtype=np.float64).T
    if not is_rotation(rotation):
        raise InputError(f"{axes.where} is no rotation: its axes are not orthonormal and right-handed")
    return RigidMotion(np.array(fields.numbers("Center", 3), dtype=np.float64), rotation)


def is_rotation(matrix: FloatArray) -> bool:
    """Whether axes as files have them are orthonormal, to what their digits allow, and right-handed."""
    with np.errstate(all="ignore"):  # numbers of any size may stand in a file
        off = np.abs(matrix.T @ matrix - np.eye(3)).max()
    return bool(off <= ORTHONORMAL and np.linalg.det(matrix) > 0.0)


def block_text(block: BlockFile, *, as_json: bool = False) -> str:
    """The file of a block."""
    old = _places(block.content)
    relative: list[Tree] = [
        {"K": camera, "V": merged(old.get(camera, {}), pose_tree(pose))}
        for camera, pose in block.poses.items()
    ]
    content: dict[str, Tree] = {
        "Name": block.name,
        "Master": block.master,
        "Pattern": block.pattern,
        "KBloc": (block.camera_group,),
        "KSync": (block.exposure_group,),
        "PoseRel": relative,
    }
    return tree_text(BLOCK, merged(block.content, content), as_json=as_json)


def _places(content: Tree) -> dict[str, Tree]:
    """What a file says of each camera; nothing where there is no file."""
    listed = content.get("PoseRel") if isinstance(content, dict) else None
    return {str(key): value for key, value in pairs(listed if isinstance(listed, list) else [], BLOCK)}


def pose_tree(pose: RigidMotion) -> Tree:
    """The fields of a pose as blocks have it."""
    axes: Tree = {
        f"Axe{letter}": tuple(float(value) for value in pose.rotation[:, k]) for k, letter in enumerate("IJK")
    }
    return {"Center": tuple(float(value) for value in pose.centre), "RotMatrix": axes}
