"""The calibration panel of the shared data, as objects: a reader of its XML that is as plain as can be."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from obseq.images import Camera, ControlPoints, ImagePoints, Poses

FOLDER = "mmvii-bundle-panel/MMVII-PhgrProj"


def _text(node) -> str:
    return node.text.strip().strip('"')


def _numbers(node) -> np.ndarray:
    return np.array(node.text.split(), dtype=np.float64)


def _root(path: Path, tag: str):
    return ElementTree.parse(path).getroot().find(f".//{tag}")


def camera(path: Path) -> Camera:
    root = _root(path, "InternalCalibration")
    width, height = _numbers(root.find("PixelFrame/NbPix")).astype(int)
    degree = tuple(_numbers(root.find("Auxiliary/Degree")).astype(int))
    distortion = {item.tag: float(item.text) for group in root.find("Distorsion") for item in group}
    focal = float(root.find("PerfectProj/F").text)
    return Camera(
        _text(root.find("Name")),
        int(width),
        int(height),
        focal,
        _numbers(root.find("PerfectProj/PP")),
        degree,
        distortion,
    )


def cameras(shared_data: Path, folder: str, pattern: str = "*") -> dict[str, Camera]:
    paths = sorted((shared_data / FOLDER / "Ori" / folder).glob(f"Calib{pattern}.xml"))
    return {found.name: found for found in map(camera, paths)}


def poses(shared_data: Path, folder: str) -> Poses:
    roots = [
        _root(path, "CameraPose")
        for path in sorted((shared_data / FOLDER / "Ori" / folder).glob("Ori-PerspCentral-*.xml"))
    ]
    axes = [[_numbers(root.find(f"RotMatrix/Axe{axis}")) for axis in "IJK"] for root in roots]
    return Poses.of(
        [_text(root.find("NameImage")) for root in roots],
        [_numbers(root.find("Center")) for root in roots],
        np.swapaxes(axes, 1, 2),
        cameras=[_text(root.find("NameInternalCalib")) for root in roots],
    )


def angles(shared_data: Path, folder: str, tag: str) -> np.ndarray:
    """What the pose files say beside the matrix: EQ, WPK or YPR."""
    paths = sorted((shared_data / FOLDER / "Ori" / folder).glob("Ori-PerspCentral-*.xml"))
    return np.array([_numbers(_root(path, "CameraPose").find(tag)) for path in paths])


def measures(shared_data: Path) -> ImagePoints:
    rows = [
        (_text(root.find("NameIm")), _text(item.find("Name")), _numbers(item.find("Pt")))
        for path in sorted((shared_data / FOLDER / "PointsMeasure/Fil").glob("MesIm-*.xml"))
        for root in [_root(path, "SetMesIm")]
        for item in root.find("Measures")
    ]
    return ImagePoints.of(*map(list, zip(*rows, strict=True)))


def control_points(shared_data: Path, sigma: float = 1.0) -> ControlPoints:
    path = next((shared_data / FOLDER / "PointsMeasure/Fil").glob("MesGCP*.xml"))
    items = list(_root(path, "SetGCP").find("Measures"))
    names = [_text(item.find("Name")) for item in items]
    return ControlPoints.of(names, [_numbers(item.find("Pt")) for item in items], sigma)
