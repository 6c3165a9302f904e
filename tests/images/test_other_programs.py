"""Blocks of OpenSfM, VisualSFM, OpenMVG and Meshroom, written by their own descriptions."""

import json

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.formats.meshroom.reader import read_meshroom
from obseq.formats.nvm.reader import read_nvm
from obseq.formats.openmvg.reader import read_openmvg
from obseq.formats.opensfm.reader import read_opensfm
from obseq.geometry import RigidMotion, attitudes, logarithm
from obseq.images import Camera

K1, K2 = -0.08, 0.02
CAMERA = Camera("c", 2000, 1500, 1800.0, degree=(3, 1, 1), distortion={"K1": K1, "K2": K2})


@pytest.fixture(scope="module")
def scene():
    """Poses, points and image points without noise."""
    poses, points = scenes.ring(n_images=5, n_points=20)
    names = [str(10 + k) for k in range(len(points))]
    return poses, points, scenes.measured(poses, points, names, 0.0, camera=CAMERA)


def _check(block, scene, tolerance=1e-6):
    """Poses and points are those of the scene, and the cameras project them where they were measured."""
    poses, _, measures = scene
    np.testing.assert_allclose(block.poses.centres, poses.centres, atol=1e-9)
    np.testing.assert_allclose(block.poses.rotations, poses.rotations, atol=1e-9)
    (part,) = block.sets
    found = part.measures
    assert len(found) == len(measures)
    local = RigidMotion(block.poses.centres[found.image], block.poses.rotations[found.image]).to_local(
        np.array([block.approximations[found.point_names[p]] for p in found.point])
    )
    for k, image in enumerate(found.image_names):
        rows = found.image == k
        camera = block.cameras[block.camera_of[image]]
        np.testing.assert_allclose(camera.project(local[rows]), found.xy[rows], atol=tolerance)


def _free(block):
    name = next(iter(block.cameras))
    return {term for term in block.cameras[name].parameter_names if not block.is_frozen(name, term)}


# OpenSfM


def _opensfm(folder, scene, **more):
    poses, points, measures = scene
    back = poses.motions.inverse()
    camera = {
        "projection_type": "perspective",
        "width": 2000,
        "height": 1500,
        "focal": 0.9,
        "k1": K1,
        "k2": K2,
    }
    shots = {
        image: {
            "rotation": logarithm(back.rotation)[k].tolist(),
            "translation": back.centre[k].tolist(),
            "camera": "v2 c",
            "gps_position": (poses.centres[k] + 0.1).tolist(),
            "gps_dop": 0.5,
        }
        for k, image in enumerate(poses.images)
    }
    whole = {
        "cameras": {"v2 c": camera},
        "shots": shots,
        "points": {
            name: {"coordinates": xyz.tolist()}
            for name, xyz in zip(measures.point_names, points, strict=True)
        },
        "reference_lla": {"latitude": 52.5, "longitude": 13.4, "altitude": 40.0},
    } | more
    small = {"cameras": {}, "shots": {}, "points": {}}
    (folder / "reconstruction.json").write_text(json.dumps([small, whole]))
    lines = ["OPENSFM_TRACKS_VERSION_v2"]
    for i, p, (x, y) in zip(measures.image, measures.point, measures.xy.tolist(), strict=True):
        image, point = measures.image_names[i], measures.point_names[p]
        at = f"{(x - 1000.0) / 2000.0!r}\t{(y - 750.0) / 2000.0!r}"
        lines.append(f"{image}\t{point}\t7\t{at}\t0.01\t1\t2\t3\t-1\t-1")
    (folder / "tracks.csv").write_text("\n".join(lines) + "\n")
    return folder


def test_opensfm_says_cameras_poses_points_and_where_it_is(scene, tmp_path):
    block = read_opensfm(_opensfm(tmp_path, scene))
    _check(block, scene)
    assert _free(block) == {"F", "K1", "K2"}
    assert block.frame == "RTL*13.4*52.5*40.0*Geog"
    (antenna,) = block.antennas
    np.testing.assert_allclose(antenna.positions, scene[0].centres + 0.1)
    assert (antenna.sigmas == 0.5).all()
    assert "1 smaller reconstructions are left out" in block.notes[0]


def test_opensfm_without_tracks_has_poses(scene, tmp_path):
    folder = _opensfm(tmp_path, scene)
    (folder / "tracks.csv").unlink()
    block = read_opensfm(folder)
    assert len(block.poses) == len(scene[0]) and not block.sets
    assert any(
        "tracks.csv: there is no such file: image points come from --measures" in n for n in block.notes
    )


def test_opensfm_in_the_folder_of_odm_with_positions_and_ground_points(scene, tmp_path):
    poses, points, measures = scene
    (tmp_path / "opensfm").mkdir()
    _opensfm(tmp_path / "opensfm", scene)
    from obseq import crs

    frame = crs.parse("RTL*13.4*52.5*40.0*Geog")
    to_map = crs.Transformer(frame, crs.parse("EPSG:32633")).forward
    ground = [" ".join(map(repr, xyz)) for xyz in to_map(points[:4]).tolist()]
    marked = [
        (measures.image_names[i], f"G{p}", x, y)
        for i, p, (x, y) in zip(measures.image, measures.point, measures.xy.tolist(), strict=True)
        if p < 4
    ]
    rows = [f"{ground[int(name[1:])]} {x - 0.5!r} {y - 0.5!r} {image} {name}" for image, name, x, y in marked]
    text = "\n".join(["WGS84 UTM 33N", *rows, f"{ground[0]} 4 5 nowhere.jpg G0"]) + "\n"
    (tmp_path / "gcp_list.txt").write_text(text)
    places = to_map(poses.centres)
    lines = [
        f"{image} {' '.join(map(repr, xyz))} 0 0 0 0.02 0.04"
        for image, xyz in zip(poses.images, places.tolist(), strict=True)
    ]
    (tmp_path / "geo.txt").write_text("\n".join(["EPSG:32633", *lines]))
    block = read_opensfm(tmp_path)
    assert set(block.control.names) == {"G0", "G1", "G2", "G3"}
    order = [f"G{k}" for k in range(4)]
    np.testing.assert_allclose(block.control.select(order).coordinates, points[:4], atol=1e-6)
    np.testing.assert_allclose(block.antennas[0].positions, poses.centres, atol=1e-6)
    assert block.antennas[0].sigmas[0].tolist() == [0.02, 0.02, 0.04]
    marks = block.sets[1].measures
    found = {
        (marks.image_names[i], marks.point_names[p]): xy
        for i, p, xy in zip(marks.image, marks.point, marks.xy, strict=True)
    }
    assert len(found) == len(rows)
    for image, name, *xy in marked:
        np.testing.assert_allclose(found[image, name], xy, atol=1e-9)
    assert any("1 marks of ground points are in images that are not placed" in note for note in block.notes)


def test_a_rig_of_opensfm(scene, tmp_path):
    still = {"rotation": [0, 0, 0], "translation": [0, 0, 0]}
    rig = {
        "rig_cameras": {
            "left": still,
            "right": {"rotation": [0, 0.1, 0], "translation": [0.3, 0, 0]},
        },
        "rig_instances": {
            "a": still | {"rig_camera_ids": {"i0": "left", "i1": "right"}},
            "b": still | {"rig_camera_ids": {"i2": "left", "i3": "right"}},
        },
    }
    (block,) = read_opensfm(_opensfm(tmp_path, scene, **rig)).rigid_blocks
    assert (block.master, block.exposures.names) == ("left", ("a", "b"))
    # Camera = R rig + t: the centre of the right camera in the rig is -R^T t.
    turn = np.array([[np.cos(0.1), 0, np.sin(0.1)], [0, 1, 0], [-np.sin(0.1), 0, np.cos(0.1)]])
    np.testing.assert_allclose(block.places["right"].centre, -turn.T @ [0.3, 0, 0], atol=1e-12)


# VisualSFM


def _nvm(path, scene, corner):
    poses, points, measures = scene
    quaternions = attitudes(np.swapaxes(poses.rotations, 1, 2), "quaternion")
    lines = ["NVM_V3", "", str(len(poses))]
    for k, image in enumerate(poses.images):
        numbers = [1800.0, *quaternions[k], *poses.centres[k], 0.0, 0]
        lines.append(f"my folder/{image}.jpg " + " ".join(map(repr, map(float, numbers))))
    lines += ["", str(len(points))]
    for p, xyz in enumerate(points):
        rows = np.flatnonzero(measures.point == p)
        shift = [0.0, 0.0] if corner else [1000.0, 750.0]
        seen = " ".join(
            f"{measures.image[r]} 5 {x!r} {y!r}"
            for r, (x, y) in zip(rows, (measures.xy[rows] - shift).tolist(), strict=True)
        )
        lines.append(f"{' '.join(map(repr, xyz.tolist()))} 1 2 3 {len(rows)} {seen}")
    path.write_text("\n".join([*lines, "", "0", ""]))
    return path


@pytest.mark.parametrize("corner", [False, True])
def test_visualsfm_from_the_middle_or_from_the_corner(tmp_path, corner):
    straight = Camera("c", 2000, 1500, 1800.0)
    poses, points = scenes.ring(n_images=5, n_points=20)
    names = [str(k) for k in range(1, 21)]
    made = poses, points, scenes.measured(poses, points, names, 0.0, camera=straight)
    block = read_nvm(_nvm(tmp_path / "a.nvm", made, corner))
    _check(block, made)
    assert block.poses.images[0] == "my folder/i0.jpg"
    assert _free(block) == {"F", "K1"}
    camera = next(iter(block.cameras.values()))
    assert camera.backward
    assert camera.principal_point.tolist() == ([1000.0, 750.0] if corner else [0.0, 0.0])


# OpenMVG, Meshroom


def test_openmvg(scene, tmp_path):
    poses, points, measures = scene

    def wrapped(key, data, **more):
        return {"key": key, "value": {**more, "ptr_wrapper": {"id": key, "data": data}}}

    camera = {
        "width": 2000,
        "height": 1500,
        "focal_length": 1800.0,
        "principal_point": [1000.0, 750.0],
        "disto_k3": [K1, K2, 0.0],
    }
    views = [
        wrapped(k, {"filename": image, "id_view": k, "id_intrinsic": 0, "id_pose": k}, polymorphic_id=1 << 30)
        for k, image in enumerate([*poses.images, "unplaced.jpg"])
    ]
    extrinsics = [
        {"key": k, "value": {"rotation": poses.rotations[k].T.tolist(), "center": poses.centres[k].tolist()}}
        for k in range(len(poses))
    ]
    structure = [
        {
            "key": int(name),
            "value": {
                "X": points[p].tolist(),
                "observations": [
                    {"key": int(measures.image[r]), "value": {"id_feat": 3, "x": measures.xy[r].tolist()}}
                    for r in np.flatnonzero(measures.point == p)
                ],
            },
        }
        for p, name in enumerate(measures.point_names)
    ]
    kind = {"polymorphic_id": (1 << 31) + 1, "polymorphic_name": "pinhole_radial_k3"}
    root = {
        "sfm_data_version": "0.3",
        "views": views,
        "intrinsics": [wrapped(0, camera, **kind)],
        "extrinsics": extrinsics,
        "structure": structure,
        "control_points": [],
    }
    path = tmp_path / "sfm_data.json"
    path.write_text(json.dumps(root))
    block = read_openmvg(tmp_path)
    _check(block, scene)
    assert _free(block) == {"F", "PPx", "PPy", "K1", "K2", "K3"}
    assert any("1 images have no pose" in note for note in block.notes)
    path.write_text(json.dumps(root | {"views": 3}))
    with pytest.raises(InputError, match=r"sfm_data\.json/views: a list is expected"):
        read_openmvg(tmp_path)


@pytest.mark.parametrize("newer", [False, True])
def test_meshroom(scene, tmp_path, newer):
    poses, points, measures = scene
    camera = {
        "intrinsicId": "7",
        "width": "2000",
        "height": "1500",
        "type": "radial3",
        "pxFocalLength": "1800",
        "principalPoint": ["1000", "750"],
        "distortionParams": [str(K1), str(K2), "0"],
        "locked": "0",
    }
    if newer:
        camera |= {"type": "pinhole", "distortionType": "radialk3", "principalPoint": ["0", "0"]}
        camera |= {"focalLength": "36", "sensorWidth": "40"}
        del camera["pxFocalLength"]
    root = {
        "views": [
            {"viewId": str(k), "poseId": str(k), "intrinsicId": "7", "path": f"C:\\images\\{image}"}
            for k, image in enumerate(poses.images)
        ],
        "intrinsics": [camera],
        "poses": [
            {
                "poseId": str(k),
                "pose": {
                    "transform": {
                        "rotation": list(map(str, poses.rotations[k].ravel())),
                        "center": list(map(str, poses.centres[k])),
                    }
                },
            }
            for k in range(len(poses))
        ],
        "structure": [
            {
                "landmarkId": name,
                "X": list(map(str, points[p])),
                "observations": [
                    {"observationId": str(measures.image[r]), "x": list(map(str, measures.xy[r]))}
                    for r in np.flatnonzero(measures.point == p)
                ],
            }
            for p, name in enumerate(measures.point_names)
        ],
    }
    (tmp_path / "sfm.json").write_text(json.dumps(root))
    block = read_meshroom(tmp_path / "sfm.json")
    _check(block, scene)
    assert set(block.poses.images) == set(poses.images)
    (tmp_path / "sfm.json").write_text(json.dumps(root)[:-20])
    with pytest.raises(InputError, match=r"sfm\.json:1: no JSON"):
        read_meshroom(tmp_path / "sfm.json")


# What is broken


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("\t7\t0", "\t7\tx0"), r"tracks\.csv:\d+: a track is"),
        (("VERSION_v2", "VERSION_v9"), "tracks of version '9' are not read"),
    ],
)
def test_broken_tracks_are_named(scene, tmp_path, change, message):
    path = _opensfm(tmp_path, scene) / "tracks.csv"
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(InputError, match=message):
        read_opensfm(tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("NVM_V3", "NVM_V9"), "the first word"),
        (("\n5\n", "\n99999\n"), "a number of lines that follow"),
        ((" 1 2 3 5 ", " 1 2 3 4 "), "a point is"),
    ],
)
def test_broken_models_of_visualsfm_are_named(scene, tmp_path, change, message):
    path = _nvm(tmp_path / "a.nvm", scene, False)
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(InputError, match=message):
        read_nvm(path)
