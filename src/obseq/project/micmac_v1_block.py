"""Blocks of MicMac v1: a folder of orientations, measures of points in images, and their coordinates."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.formats.blocks.reading import hold_all_but, new_block
from obseq.images import ControlPoints, ImagePoints, Poses
from obseq.project.micmac_v1 import read_v1_image
from obseq.reading.origin import Origin
from obseq.reading.xml import Element, read_xml

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.images import BundleAdjustment, Camera

PREFIX = "Orientation-"
MEASURES, POINTS = "SetOfMesureAppuisFlottants", "DicoAppuisFlottant"


def read_v1_block(
    orientation: str | Path,
    measures: str | Path | None = None,
    points: str | Path | None = None,
    image_sigma: float = 1.0,
) -> BundleAdjustment:
    """A block of MicMac v1.

    Args:
        orientation: a folder ``Ori-X`` with files ``Orientation-<image>.xml``.
        measures: file of points measured in images (`SetOfMesureAppuisFlottants`).
        points: file of coordinates (`DicoAppuisFlottant`); a negative uncertainty leaves a point free.
        image_sigma: of the measures, pixels: their file has none.

    Raises:
        InputError: a file is missing, or holds what is not read; measures of an image without orientation.
    """
    with new_block(orientation) as block:
        poses = _add_poses(block, Path(orientation))
        if points is not None:
            block.add_control_points(read_v1_points(points), Origin(str(points)))
        if measures is not None:
            found = read_v1_measures(measures, image_sigma)
            lost = [name for name in found.image_names if name not in poses]
            if lost:
                raise InputError(f"{measures}: the image {lost[0]} has no orientation in {orientation}")
            block.add_measures(found, name=Path(measures).name, origin=Origin(str(measures)))
    return block


def _add_poses(block: BundleAdjustment, folder: Path) -> Poses:
    files = sorted(folder.glob(f"{PREFIX}*.xml"))
    if not files:
        raise InputError(f"{folder}: holds no orientation ({PREFIX}<image>.xml)")
    cameras: dict[str, Camera] = {}
    terms: dict[str, tuple[str, ...]] = {}
    centres, rotations, owners = [], [], []
    for path in files:
        pose, camera, own = read_v1_image(path)
        cameras.setdefault(camera.name, camera)
        terms.setdefault(camera.name, own)
        centres.append(pose.centre)
        rotations.append(pose.rotation)
        owners.append(camera.name)
    block.add_cameras(*cameras.values())
    hold_all_but(block, terms)
    names = [path.name[len(PREFIX) : -len(path.suffix)] for path in files]
    poses = Poses.of(names, centres, rotations, cameras=owners)
    block.add_poses(poses)
    return poses


def read_v1_points(path: str | Path) -> ControlPoints:
    """The points of a `DicoAppuisFlottant`; negative uncertainties leave them free, zeros hold them."""
    names, places, sigmas = [], [], []
    for one in _all(_root(path, POINTS), "OneAppuisDAF"):
        names.append(one.content("NamePt"))
        places.append(_numbers(one, "Pt", 3))
        given = np.array(_numbers(one, "Incertitude", 3))
        sigmas.append(np.where(given < 0.0, np.inf, given))
    try:
        return ControlPoints.of(names, np.array(places).reshape(-1, 3), np.array(sigmas).reshape(-1, 3))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def read_v1_measures(path: str | Path, sigma: float = 1.0) -> ImagePoints:
    """The measures of a `SetOfMesureAppuisFlottants`."""
    images, points, xy = [], [], []
    for image in _all(_root(path, MEASURES), "MesureAppuiFlottant1Im"):
        for one in image.named("OneMesureAF1I"):
            images.append(image.content("NameIm"))
            points.append(one.content("NamePt"))
            xy.append(_numbers(one, "PtIm", 2))
    try:
        return ImagePoints.of(images, points, np.array(xy).reshape(-1, 2), sigma)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _root(path: str | Path, tag: str) -> Element:
    """The element of a name: v1 wraps some files in `Global`."""
    root = read_xml(Path(path))
    found = root if root.name == tag else root.first(tag)
    if found is None:
        raise root.problem(f"{tag} is expected")
    return found


def _all(root: Element, tag: str) -> Iterator[Element]:
    found = list(root.named(tag))
    if not found:
        raise root.problem(f"it holds no {tag}")
    yield from found


def _numbers(element: Element, tag: str, count: int) -> list[float]:
    try:
        values = [float(word) for word in element.content(tag).split()]
    except ValueError:
        values = []
    if len(values) != count or not np.isfinite(values).all():
        raise element.problem(f"{tag} should be {count} finite numbers")
    return values
