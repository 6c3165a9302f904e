"""Scenes of OpenMVG (`sfm_data.json`): views, intrinsics, extrinsics, structure, control points.

Poses are a rotation from world to camera and the centre, x right, y down, z forward.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from obseq.formats.blocks.features import add_features
from obseq.formats.blocks.json_nodes import Node, read_json
from obseq.formats.blocks.reading import hold_all_but, new_block, note_count
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera
from obseq.images.poses import Poses

_ONE = ("F", "PPx", "PPy")
MODELS = {
    "pinhole": ("", (3, 1, 1), (), _ONE),
    "pinhole_radial_k1": ("disto_k1", (3, 1, 1), ("K1",), (*_ONE, "K1")),
    "pinhole_radial_k3": ("disto_k3", (3, 1, 1), ("K1", "K2", "K3"), (*_ONE, "K1", "K2", "K3")),
    "pinhole_brown_t2": (
        "disto_t2",
        (3, 1, 1),
        ("K1", "K2", "K3", "p2", "p1"),
        (*_ONE, "K1", "K2", "K3", "p1", "p2"),
    ),
    "fisheye": ("fisheye", (5, 1, 1), ("K1", "K2", "K3", "K4"), (*_ONE, "K1", "K2", "K3", "K4")),
}
"""Where the coefficients of a model are, our degree, our names of them, and what is unknown."""
NAMED = 1 << 31
"""A number of a class with this bit comes with its name, and without it when it comes again."""


def read_openmvg(path: str | Path) -> BundleAdjustment:
    """The scene of a file; points have the numbers of their tracks as names, images the names of their files.

    Raises:
        InputError: something is missing or broken, or a camera has a model that is not one of ours.
    """
    place = Path(path)
    root = read_json(place / "sfm_data.json" if place.is_dir() else place)
    with new_block(path) as block:
        _add_cameras(block, root)
        names = _add_images(block, root)
        _add_points(block, root["structure"], names)
        known = [str(item["key"].text()) for item in root.get("control_points", [])]
        note_count(
            block, known, "control points of the file are not read: give them with --control, --measures"
        )
    return block


def _data(item: Node) -> Node:
    return item["value"]["ptr_wrapper"]["data"]


def _add_cameras(block: BundleAdjustment, root: Node) -> None:
    kinds: dict[int, str] = {}
    free = {}
    for item in root["intrinsics"]:
        value, name = item["value"], f"camera {item['key'].text()}"
        number = int(value["polymorphic_id"].number())
        if "polymorphic_name" in value:
            kinds[number % NAMED] = value["polymorphic_name"].text()
        kind = kinds.get(number % NAMED, "")
        if kind not in MODELS:
            raise value.problem(f"the camera {kind or 'without a name'} is not read; {', '.join(MODELS)} are")
        key, degree, terms, free[name] = MODELS[kind]
        data = _data(item)
        size = int(data["width"].number()), int(data["height"].number())
        values = data[key].numbers(len(terms)).tolist() if key else []
        projection = "FE_EquiDist" if kind == "fisheye" else "Stenope"
        middle = data["principal_point"].numbers(2)
        given = dict(zip(terms, values, strict=True))
        block.add_cameras(
            Camera(name, *size, data["focal_length"].number(), middle, degree, given, projection)
        )
    hold_all_but(block, free)


def _add_images(block: BundleAdjustment, root: Node) -> dict[str, str]:
    """Names of the images that have a pose, by the number of their view."""
    poses = {item["key"].text(): item["value"] for item in root["extrinsics"]}
    names, centres, rotations, owners, waiting = {}, [], [], [], []
    for item in root["views"]:
        data = _data(item)
        pose, image = data["id_pose"].text(), data["filename"].text()
        camera = f"camera {data['id_intrinsic'].text()}"
        if pose not in poses:
            waiting.append(image)
            continue
        if camera not in block.cameras:
            raise data.problem(f"the intrinsics {data['id_intrinsic'].text()} are not there")
        names[item["key"].text()] = image
        centres.append(poses[pose]["center"].numbers(3))
        rotations.append(poses[pose]["rotation"].numbers(3, 3).T)
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
        places.append(item["value"]["X"].numbers(3))
        points.append(item["key"].text())
        for seen in item["value"]["observations"]:
            view = seen["key"].text()
            if view in number:
                rows.append((number[view], len(points) - 1, *seen["value"]["x"].numbers(2)))
    block.add_approximations(points, np.array(places).reshape(-1, 3))
    if rows:
        columns = np.array(rows)
        image, point = columns[:, :2].T.astype(np.int64)
        add_features(block, list(names.values()), points, image, point, columns[:, 2:])
