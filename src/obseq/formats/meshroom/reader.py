"""Scenes of Meshroom (AliceVision, `.sfm` or `.json`): views, intrinsics, poses, structure.

Poses are a rotation from world to camera, column by column, and the centre; x right, y down, z forward.
"""

from __future__ import annotations

from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np

from obseq.formats.blocks.features import add_features
from obseq.formats.blocks.json_nodes import Node, read_json
from obseq.formats.blocks.reading import hold_all_but, new_block, note_count
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera
from obseq.images.poses import Poses

_ONE = ("F", "PPx", "PPy")
MODELS = {
    "pinhole": ((3, 1, 1), ()),
    "radial1": ((3, 1, 1), ("K1",)),
    "radial3": ((3, 1, 1), ("K1", "K2", "K3")),
    "brown": ((3, 1, 1), ("K1", "K2", "K3", "p2", "p1")),
    "fisheye4": ((5, 1, 1), ("K1", "K2", "K3", "K4")),
}
"""Our degree and our names of the coefficients of a model."""
NEWER = {"none": "pinhole", "radialk1": "radial1", "radialk3": "radial3"}
"""Names of the distortion since version 1.2.6 of such files, and those before."""


def read_meshroom(path: str | Path) -> BundleAdjustment:
    """The scene of a file; points have the numbers of their landmarks as names, images those of their files.

    Raises:
        InputError: something is missing or broken, or a camera has a model that is not one of ours.
    """
    root = read_json(Path(path))
    with new_block(path) as block:
        free = dict(_add_camera(block, item) for item in root["intrinsics"])
        hold_all_but(block, free)
        names = _add_images(block, root)
        _add_points(block, root.get("structure", []), names)
    return block


def _add_camera(block: BundleAdjustment, item: Node) -> tuple[str, tuple[str, ...]]:
    """Adds a camera; its name, and what is unknown of it: nothing where it is locked."""
    name = f"camera {item['intrinsicId'].text()}"
    kind = item["type"].text()
    if "distortionType" in item and kind != "equidistant":
        kind = NEWER.get(item["distortionType"].text(), item["distortionType"].text())
    if kind not in MODELS:
        raise item.problem(f"the camera {kind!r} is not read; {', '.join(MODELS)} are")
    degree, terms = MODELS[kind]
    size = np.array([item["width"].number(), item["height"].number()])
    values = [value.number() for value in item.get("distortionParams", [])] if terms else []
    given = dict(zip(terms, values[: len(terms)] or [0.0] * len(terms), strict=True))
    point = [float(v) for v in _pair(item["principalPoint"])]
    middle = min(
        np.array(point), np.array(point) + size / 2.0, key=lambda p: float(np.sum((p - size / 2.0) ** 2))
    )
    projection = "FE_EquiDist" if kind == "fisheye4" else "Stenope"
    block.add_cameras(
        Camera(name, int(size[0]), int(size[1]), _focal(item, size), middle, degree, given, projection)
    )
    is_locked = item.get("locked", "0").value in ("1", 1, True, "true")
    return name, () if is_locked else (*_ONE, *terms)


def _pair(item: Node) -> list[float]:
    """Two numbers: a list, or x and y."""
    if "x" in item:
        return [item["x"].number(), item["y"].number()]
    return [value.number() for value in item]


def _focal(item: Node, size: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    """The focal length in pixels; that of the columns and that of the lines must be one."""
    if "pxFocalLength" in item:
        given = item["pxFocalLength"]
        values = _pair(given) if isinstance(given.value, list | dict) else [given.number()]
        if len(set(values)) > 1:
            raise given.problem("two focal lengths are not read; undistort the images, or make them one")
        return values[0]
    return item["focalLength"].number() / item["sensorWidth"].number() * float(size.max())


def _add_images(block: BundleAdjustment, root: Node) -> dict[str, str]:
    """Names of the images that have a pose, by the number of their view."""
    poses = {item["poseId"].text(): item["pose"]["transform"] for item in root.get("poses", [])}
    names, centres, rotations, owners, waiting = {}, [], [], [], []
    for item in root["views"]:
        path = item["path"].text()
        image = (PureWindowsPath if "\\" in path else PurePosixPath)(path).name
        pose, camera = item.get("poseId", "").text(), f"camera {item['intrinsicId'].text()}"
        if pose not in poses:
            waiting.append(image)
            continue
        if camera not in block.cameras:
            raise item.problem(f"the intrinsics {item['intrinsicId'].text()} are not there")
        names[item["viewId"].text()] = image
        centres.append(poses[pose]["center"].numbers(3))
        rotations.append(poses[pose]["rotation"].numbers(9).reshape(3, 3))  # its columns are our rows
        owners.append(camera)
    note_count(block, waiting, "images have no pose and are left out")
    block.add_poses(
        Poses.of(list(names.values()), np.array(centres).reshape(-1, 3), rotations, cameras=owners)
    )
    return names


def _add_points(block: BundleAdjustment, structure: Node, names: dict[str, str]) -> None:
    places, rows, points = [], [], []
    number = {view: k for k, view in enumerate(names)}
    for item in structure:
        places.append(item["X"].numbers(3))
        points.append(item["landmarkId"].text())
        for seen in item.get("observations", []):
            view = seen["observationId"].text()
            if view in number and "x" in seen:
                rows.append((number[view], len(points) - 1, *seen["x"].numbers(2)))
    block.add_approximations(points, np.array(places).reshape(-1, 3))
    if rows:
        columns = np.array(rows)
        image, point = columns[:, :2].T.astype(np.int64)
        add_features(block, list(names.values()), points, image, point, columns[:, 2:])
