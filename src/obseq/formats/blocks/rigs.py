"""Rigs of other programs: cameras that their program takes as fixed to one another, exactly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from obseq.dataclass import dataclass
from obseq.formats.blocks.reading import note_count
from obseq.geometry import RigidMotion
from obseq.images.block import Block
from obseq.images.names import numbered
from obseq.images.poses import Poses
from obseq.images.rigid import Exposures, RigidBlock

RIGID = 1e-6
"""Radians, and the same share of the distance of the points, by which an exact rig may give way: far below
what image points tell, and far above rounding."""


@dataclass(frozen=True, eq=False)
class Rig:
    """A rig as a program describes it.

    Attributes:
        name: of the rig.
        master: its camera whose frame is that of the rig.
        places: of its cameras: from the camera to the rig.
        exposures: (camera, exposure, image), each.
        is_fixed: whether the places keep their values.
    """

    name: str
    master: str
    places: Mapping[str, RigidMotion]
    exposures: Sequence[tuple[str, str, str]]
    is_fixed: bool = False


def add_rig(block: Block, rig: Rig) -> None:
    """Adds a rig of two cameras or more to a block whose images have poses; a single camera is none."""
    used = [one for one in rig.exposures if one[2] in block.camera_of]
    cameras, camera = numbered([one[0] for one in used])
    if len(cameras) < 2:
        return
    names, exposure = numbered([one[1] for one in used])
    pairs = np.column_stack([camera, exposure])
    if len(np.unique(pairs, axis=0)) < len(pairs):
        note_count(block, [rig.name], "rigs are not read: a camera has two images of one exposure")
        return
    seen = np.bincount(exposure, minlength=len(names))
    if not (seen > 1).any():
        note_count(block, [rig.name], "rigs are not read: no two of their cameras were exposed together")
        return
    exposures = Exposures(cameras, names, tuple(one[2] for one in used), camera, exposure)
    master = rig.master if rig.master in rig.places else cameras[0]
    known = list(dict.fromkeys([master, *cameras]))
    places = Poses.of(
        known, [rig.places[name].centre for name in known], [rig.places[name].rotation for name in known]
    )
    size = RIGID * _distance(block)
    found = RigidBlock(rig.name, master, exposures, places, size, RIGID, rig.is_fixed, is_exact=True)
    block.add_rigid_block(found)


def _distance(block: Block) -> float:
    """How far points are from images, about; 1 where nothing says it."""
    places = np.array(list(block.approximations.values())).reshape(-1, 3)
    if not len(places) or not len(block.poses):
        return 1.0
    found = float(np.median(np.linalg.norm(places - block.poses.centres.mean(axis=0), axis=1)))
    return found if found > 0.0 else 1.0
