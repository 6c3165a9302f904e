"""Adjusted blocks in a project tree of MMVII: orientations, measures, coordinates of points."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.errors import InputError
from obseq.images import ControlPoints, ImagePoints
from obseq.project.cameras import orientation_files
from obseq.project.points import (
    MEASURES_PREFIX,
    POINTS_PREFIX,
    SYSTEM_FILE,
    measures_text,
    points_text,
    system_text,
)

if TYPE_CHECKING:
    from obseq.images import Block, BundleSolution

TREE, NAME = "MMVII-PhgrProj", "Obseq"


def check_block(block: Block) -> None:
    """Refuses, before its adjustment, a block that such files cannot hold.

    Raises:
        InputError: a camera has a distortion that MMVII has not; an image would be no file.
    """
    other = [name for name in block.cameras if not block.cameras[name].is_mmvii]
    if other:
        raise InputError(f"camera {other[0]}: MMVII has no place for {block.cameras[other[0]].formula}")
    wrong = [name for name in (*block.camera_of, *block.cameras) if "/" in name or "\\" in name]
    if wrong:
        raise InputError(f"{wrong[0]!r}: MMVII names files by images and cameras: no folder can be in them")


def mmvii_files(solution: BundleSolution, folder: str | Path) -> dict[Path, str]:
    """The files of a project: folders `Obseq` of `Ori`, `ObjMesInstr` and `ObjCoordWorld`."""
    tree = Path(folder) / TREE
    orientation, instrument, world = (tree / kind / NAME for kind in ("Ori", "ObjMesInstr", "ObjCoordWorld"))
    found = dict(orientation_files(orientation, solution.poses, solution.cameras))
    parts = [part.given.measures.rows(part.rows) for part in solution.start.sets]
    measures = functools.reduce(ImagePoints.joined, parts)
    for image in measures.image_names:
        found[instrument / f"{MEASURES_PREFIX}{image}.xml"] = measures_text(image, measures)
    sigmas = dict(zip(solution.block.control.names, solution.block.control.sigmas, strict=True))
    free = [float("inf")] * 3
    points = ControlPoints.of(
        solution.points, solution.coordinates, [sigmas.get(name, free) for name in solution.points]
    )
    found[world / f"{POINTS_PREFIX}-{NAME}.xml"] = points_text(points, NAME)
    if solution.block.frame:
        for place in (orientation, world):
            found[place / f"{SYSTEM_FILE}.xml"] = system_text(solution.block.frame)
    return found
