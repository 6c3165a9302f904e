"""Instrument blocks of a project (`FileRB_<name>`): cameras by their calibration, and sigmas of their pairs.

What a file holds besides its cameras and the sigmas of pairs (clinometers, constraints) stays in it.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.images import Exposures, Poses, RigidBlock
from obseq.images.names import numbered
from obseq.project.blocks import pose_tree, read_pose_fields
from obseq.project.metadata import whole_match
from obseq.project.tree import Reader, pairs, read_tree, tree_text

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from obseq.geometry import Pose
    from obseq.images import BundleSolution
    from obseq.images.rigid import Sigmas
    from obseq.project.tree import Tree

FILE = "FileRB_"
ENTRIES = 2.0**0.5
"""Sigma of the entries of a rotation matrix over that of an angle."""


@dataclass(frozen=True)
class InstrumentCamera:
    """A camera of an instrument block.

    Attributes:
        calibration: its name, which is that of the camera here.
        stamp: pattern of image names, whose first group is the exposure.
        selection: pattern of the images of the block.
        pose: camera to block; None where the file says that it is not known yet.
    """

    calibration: str
    stamp: str
    selection: str
    pose: Pose | None


@dataclass(frozen=True, eq=False)
class InstrumentBlock:
    """An instrument block as a file describes it.

    Attributes:
        path: of the file.
        tag: of its content.
        content: all of it.
        master: calibration of the camera whose frame is that of the block.
        cameras: of the block.
        sigmas: of translations and of matrix entries, by pair of calibrations.
    """

    path: Path
    tag: str
    content: Tree
    master: str
    cameras: tuple[InstrumentCamera, ...]
    sigmas: dict[tuple[str, str], Sigmas]

    @property
    def name(self) -> str:
        """The name of the block, from its file."""
        return self.path.stem.removeprefix(FILE)

    @property
    def unused(self) -> tuple[str, ...]:
        """What the file has and no adjustment of images alone uses: relative rotations, clinometers."""
        fields = Reader(self.content, str(self.path))
        clinometers = fields.has("Clinos") and fields.mapping("Clinos").get("Set_Clinos")
        rotations = fields.has("CstrRelRot") and fields.list("CstrRelRot")
        names = {"CstrRelRot": rotations, "Clinos": clinometers}
        return tuple(name for name, value in names.items() if value)


def read_instrument_block(path: Path) -> InstrumentBlock:
    """The block of a file ``InstrBlock/<Folder>/FileRB_<name>.xml``.

    Raises:
        InputError: with file and field.
    """
    data = read_tree(path)
    if len(data) != 1:
        raise InputError(f"{path}: should hold one block, not {', '.join(data) or 'nothing'}")
    ((tag, content),) = data.items()
    whole = Reader(content, str(path))
    cams = whole.fields("Cams")
    rows = [Reader(one, f"{path}: Set_Cams") for one in cams.list("Set_Cams")]
    cameras = tuple(_camera(row) for row in rows)
    numbers = [row.integer("Num", place) for place, row in enumerate(rows)]
    number = cams.integer("NumMaster", 0)
    if number not in numbers:
        raise InputError(f"{path}: NumMaster is {number}; the cameras have {numbers}")
    sigmas = dict(_sigmas(whole, str(path)))
    known = {camera.calibration for camera in cameras}
    lost = {name for pair in sigmas for name in pair} - known
    if lost:
        raise InputError(f"{path}: SigmasPairs names {min(lost)}, which is no camera of the block")
    return InstrumentBlock(path, tag, content, cameras[numbers.index(number)].calibration, cameras, sigmas)


def _camera(row: Reader) -> InstrumentCamera:
    name = row.text("NameCalib")
    if row.has("SelIsPat") and not row.integer("SelIsPat"):
        raise InputError(f"{row.where}: {name}: images by a list (SelIsPat 0) are not read; give a pattern")
    known = row.integer("IsInit", 1)
    pose = read_pose_fields(row.fields("Pose")) if known else None
    return InstrumentCamera(name, row.text("PatTimeStamp"), row.text("ImSelect", ""), pose)


def _sigmas(whole: Reader, where: str) -> list[tuple[tuple[str, str], Sigmas]]:
    found = []
    for key, value in pairs(whole.list("SigmasPairs"), f"{where}: SigmasPairs"):
        names = list(key.values()) if isinstance(key, dict) else key
        if not (isinstance(names, list) and len(names) == 2):
            raise InputError(f"{where}: SigmasPairs: a pair should be of two names")
        first, second = (str(name) for name in names)
        one = Reader(value, f"{where}: SigmasPairs: {first}, {second}")
        found.append(((first, second), (float(one.number("Tr")), float(one.number("Rot")))))
    return found


def rigid_block_of(
    found: InstrumentBlock, camera_of: Mapping[str, str], factors: Sigmas, relative: bool
) -> RigidBlock:
    """The block in an adjustment.

    Args:
        found: the file.
        camera_of: calibration of each image.
        factors: of the sigmas of the file (`BOI`), or, when not relative, the sigmas themselves.
        relative: whether the sigmas of the file count.

    Raises:
        InputError: a camera has no pose yet or twice one exposure, or there are no pairs.
    """
    places = {camera.calibration: _place(found, camera) for camera in found.cameras}
    if not found.sigmas:
        raise InputError(f"{found.path}: SigmasPairs is empty: no pair of cameras is observed")
    every = {
        pair: (factors[0] * (tr if relative else 1.0), factors[1] * (rot if relative else 1.0) / ENTRIES)
        for pair, (tr, rot) in found.sigmas.items()
    }
    poses = list(places.values())
    return RigidBlock(
        found.name,
        found.master,
        _exposures(found, camera_of),
        Poses.of(list(places), [pose.centre for pose in poses], [pose.rotation for pose in poses]),
        *next(iter(every.values())),
        pair_sigmas=every,
    )


def _place(found: InstrumentBlock, camera: InstrumentCamera) -> Pose:
    if camera.pose is None:
        raise InputError(f"{found.path}: camera {camera.calibration} has no pose yet (IsInit 0)")
    return camera.pose


def _exposures(found: InstrumentBlock, camera_of: Mapping[str, str]) -> Exposures:
    by_name = {camera.calibration: camera for camera in found.cameras}
    taken: dict[tuple[str, str], str] = {}
    for image, calibration in camera_of.items():
        stamp = _stamp(found, by_name[calibration], image) if calibration in by_name else None
        if stamp is None:
            continue
        other = taken.setdefault((calibration, stamp), image)
        if other != image:
            raise InputError(f"{found.path}: {other} and {image} are both of {calibration}, exposure {stamp}")
    cameras, camera = numbered([pair[0] for pair in taken])
    names, exposure = numbered([pair[1] for pair in taken])
    images = tuple(taken.values())
    others = tuple(image for image in camera_of if image not in set(images))
    return Exposures(cameras, names, images, camera, exposure, others)


def _stamp(found: InstrumentBlock, camera: InstrumentCamera, image: str) -> str | None:
    """The exposure of an image of a camera; None for images that are not of the block."""
    if camera.selection and not whole_match(camera.selection, image, str(found.path)):
        return None
    match = whole_match(camera.stamp, image, f"{found.path}: PatTimeStamp")
    if match is None:
        return None
    if not match.re.groups:
        raise InputError(f"{found.path}: PatTimeStamp {camera.stamp!r} has no group in parentheses")
    return match[1]


def adjusted_text(
    found: InstrumentBlock, solution: BundleSolution, observed: bool, *, as_json: bool = False
) -> str:
    """The file of a block with its adjusted poses, and the observed sigmas of its pairs if wanted."""
    content = copy.deepcopy(found.content)
    assert isinstance(content, dict)
    places, scatter = solution.rigid_places(found.name), _norms(solution, found.name)
    for row in Reader(content, str(found.path)).fields("Cams").list("Set_Cams"):
        fields = Reader(row, str(found.path))
        assert isinstance(row, dict)
        row["Pose"] = pose_tree(places[fields.text("NameCalib")])
    listed = Reader(content, str(found.path)).list("SigmasPairs")
    for pair, (_, value) in zip(found.sigmas, pairs(listed, str(found.path)), strict=True):
        if observed and pair in scatter and isinstance(value, dict):
            value["Tr"], value["Rot"] = (scatter[pair][0],), (scatter[pair][1],)
    return tree_text(found.tag, content, as_json=as_json)


def _norms(solution: BundleSolution, name: str) -> dict[tuple[str, str], Sigmas]:
    """By pair, the mean lengths of what translations and matrices are off."""
    found = solution.rigid_residuals(name)
    shifts = np.linalg.norm(found.translations, axis=1)
    turns = 2.0 * ENTRIES * np.sin(np.linalg.norm(found.rotations, axis=1) / 2.0)
    rows = {pair: [k for k, other in enumerate(found.cameras) if other == pair] for pair in found.cameras}
    return {pair: (float(shifts[own].mean()), float(turns[own].mean())) for pair, own in rows.items()}
