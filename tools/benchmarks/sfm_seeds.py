"""Small whole examples of files of structure from motion and of satellites, to be broken."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from obseq.formats.blocks.observations import observe_positions
from obseq.formats.colmap.reader import read_colmap
from obseq.formats.meshroom.reader import read_meshroom
from obseq.formats.nvm.reader import read_nvm
from obseq.formats.openmvg.reader import read_openmvg
from obseq.formats.opensfm.reader import read_opensfm
from obseq.formats.rpc.files import read_rpc, rpb_text, xml_text
from obseq.images import BundleAdjustment, Camera, ImagePoints
from obseq.images.aerial.rpc import KEYS, Rpc

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Seed = tuple[dict[str, bytes], Callable[[Path], object]]

STILL = {"rotation": [0.1, 0.0, 0.0], "translation": [1.0, 2.0, 3.0]}
RECONSTRUCTION = [
    {
        "cameras": {
            "c": {
                "projection_type": "brown",
                "width": 200,
                "height": 100,
                "focal_x": 0.9,
                "focal_y": 0.9,
                "k1": 0.1,
            }
        },
        "shots": {
            "a": {**STILL, "camera": "c", "gps_position": [1, 2, 3], "gps_dop": 2},
            "b": {**STILL, "camera": "c"},
        },
        "points": {"7": {"coordinates": [1.0, 2.0, 30.0]}},
        "rig_cameras": {"l": STILL, "r": STILL},
        "rig_instances": {"0": {**STILL, "rig_camera_ids": {"a": "l", "b": "r"}}},
        "reference_lla": {"latitude": 44.0, "longitude": 5.0, "altitude": 100.0},
    }
]
TRACKS = b"OPENSFM_TRACKS_VERSION_v2\na\t7\t1\t0.1\t0.05\t1\t1\t2\t3\t-1\t-1\n"
TRACKS += b"b\t7\t1\t0.2\t0.1\t1\t1\t2\t3\t-1\t-1\n"
NVM = b"""NVM_V3

2
a.jpg 900 1 0 0 0 0 0 0 0.01 0
b.jpg 900 1 0 0 0 1 0 0 0.01 0

1
0.5 0.2 10 1 2 3 2 0 4 -5.0 6.0 1 5 7.0 -8.0

0
"""
SPARSE = {
    "cameras.txt": b"1 FOV 200 100 180 180 100 50 0.3\n2 EUCM 200 100 180 180 100 50 0.4 1.1\n",
    "images.txt": b"1 1 0 0 0 0 0 9 1 a\n90 40 5\n2 1 0 0 0 -1 0 9 2 b\n80 45 5\n",
    "points3D.txt": b"# point 5 is called P 1\n5 0 0 0 1 2 3 0.5 1 0 2 0\n",
    "rigs.txt": b"3 2 CAMERA 1 CAMERA 2 1 1 0 0 0 0.1 0 0\n",
    "frames.txt": b"1 3 1 0 0 0 0 0 9 2 CAMERA 1 1 CAMERA 2 2\n",
}


def _wrapped(key: int, data: dict[str, object], **more: object) -> dict[str, object]:
    return {"key": key, "value": {**more, "ptr_wrapper": {"id": key, "data": data}}}


OPENMVG = {
    "views": [
        _wrapped(k, {"filename": name, "id_view": k, "id_intrinsic": 0, "id_pose": k}, polymorphic_id=1 << 30)
        for k, name in enumerate("ab")
    ],
    "intrinsics": [
        _wrapped(
            0,
            {
                "width": 200,
                "height": 100,
                "focal_length": 180,
                "principal_point": [99, 51],
                "disto_k3": [0.1, 0, 0],
            },
            polymorphic_id=(1 << 31) + 1,
            polymorphic_name="pinhole_radial_k3",
        )
    ],
    "extrinsics": [
        {"key": k, "value": {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "center": [k, 0, 0]}}
        for k in (0, 1)
    ],
    "structure": [
        {
            "key": 4,
            "value": {
                "X": [0, 0, 9],
                "observations": [{"key": k, "value": {"id_feat": 0, "x": [100 - k, 50]}} for k in (0, 1)],
            },
        }
    ],
    "control_points": [],
}
MESHROOM = {
    "views": [{"viewId": k, "poseId": k, "intrinsicId": "7", "path": f"/x/{k}.jpg"} for k in "12"],
    "intrinsics": [
        {
            "intrinsicId": "7",
            "width": "200",
            "height": "100",
            "type": "radial3",
            "pxFocalLength": "180",
            "principalPoint": ["100", "50"],
            "distortionParams": ["0.1", "0", "0"],
        }
    ],
    "poses": [
        {"poseId": k, "pose": {"transform": {"rotation": list("100010001"), "center": [k, "0", "0"]}}}
        for k in "12"
    ],
    "structure": [
        {
            "landmarkId": "3",
            "X": ["1", "2", "9"],
            "observations": [{"observationId": k, "featureId": "0", "x": ["100", "51"]} for k in "12"],
        }
    ],
}


def _rpc() -> Rpc:
    ones = {key: 1.0 + k for k, key in enumerate(KEYS)}
    rows = [[1.0] + [0.01 * k for k in range(19)] for _ in range(4)]
    return Rpc(ones, ones, np.array(rows))


def _positions(folder: Path) -> object:
    block = BundleAdjustment()
    block.add_cameras(Camera("c", 2000, 1500, 1800.0))
    block.add_images(["a", "b"], "c")
    block.add_measures(ImagePoints.of(["a", "b"], ["P", "P"], [[900.0, 700], [950, 760]], 0.5))
    observe_positions(block, folder / "f.txt")
    return block


def sfm_seeds() -> dict[str, Seed]:
    """By kind: the files, and what reads them in a folder."""
    reconstruction = {"reconstruction.json": json.dumps(RECONSTRUCTION).encode(), "tracks.csv": TRACKS}
    ground = {
        "gcp_list.txt": b"WGS84 UTM 31N\n660000 4870000 120 10 20 a G1\n660000 4870000 120 11 21 b G1\n",
        "geo.txt": b"EPSG:32631\na 660000 4870000 200 1 2 3 0.02 0.03\nb 660010 4870000 200\n",
    }
    texts = {
        "rpb": (rpb_text(_rpc()), "a.rpb"),
        "rpc": (_rpc().text(), "a_RPC.TXT"),
        "rpc xml": (xml_text(_rpc()), "a.xml"),
    }
    return {
        "opensfm": (reconstruction, read_opensfm),
        "odm": (reconstruction | ground, read_opensfm),
        "nvm": ({"f.nvm": NVM}, lambda folder: read_nvm(folder / "f.nvm")),
        "openmvg": (
            {"sfm_data.json": json.dumps(OPENMVG, indent=1).encode()},
            lambda folder: read_openmvg(folder / "sfm_data.json"),
        ),
        "meshroom": (
            {"f.sfm": json.dumps(MESHROOM, indent=1).encode()},
            lambda folder: read_meshroom(folder / "f.sfm"),
        ),
        "colmap rigs": (SPARSE, read_colmap),
        "positions": ({"f.txt": b"image,x,y,z,sx,sy,sz\na,1,2,3,0.1,,0.1\nb,4,5,6,1,1,1\n"}, _positions),
        **{
            kind: ({name: text.encode()}, lambda folder, name=name: read_rpc(folder / name))
            for kind, (text, name) in texts.items()
        },
    }
