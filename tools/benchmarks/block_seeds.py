"""A small whole example of every kind of file that image readers take, for benches that break them."""

from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING

import numpy as np
from carried_seeds import carried_seeds
from sfm_seeds import sfm_seeds

from obseq.formats.aicon.reader import read_aicon
from obseq.formats.bal.reader import read_bal
from obseq.formats.blocks.tables import read_cameras, read_control, read_images, read_measures
from obseq.formats.bundler.reader import read_bundler
from obseq.formats.colmap.reader import read_colmap
from obseq.formats.dbat.reader import read_dbat
from obseq.formats.metashape.reader import read_metashape
from obseq.formats.opk.reader import read_opk
from obseq.formats.photomodeler.reader import read_photomodeler
from obseq.geometry import RigidMotion
from obseq.images import Camera, ControlPoints, ImagePoints
from obseq.project import (
    BlockFile,
    block_text,
    calibration_text,
    measures_text,
    names_text,
    points_text,
    pose_text,
    read_block,
    read_calibration,
    read_control_points,
    read_image_measures,
    read_names,
    read_pose,
    read_rules,
    read_topo,
    read_tracks,
    read_v1_block,
    rules_text,
)
from obseq.project.instruments.blocks import read_clinometer_readings, read_instrument_block
from obseq.project.instruments.rigid_blocks import pose_tree
from obseq.project.metadata import Rules
from obseq.project.tie_points import read_pairs
from obseq.project.tree import data_text, tree_text

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from obseq.project.tree import Tree

    Seed = tuple[dict[str, bytes], Callable[[Path], object]]

CAMERA = Camera("c", 2000, 1500, 1800.0, distortion={"K1": -0.1, "p1": 1e-3})
POINTS = ControlPoints.of(["A", "B"], [[0.0, 0, 10], [1, 2, 12]], [[0.1] * 3, [np.inf] * 3])
MEASURES = ImagePoints.of(["a", "a"], ["A", "B"], [[900.0, 700], [950, 760]], 0.5)
TURN = RigidMotion(np.array([1.0, 2.0, 3.0]), np.eye(3))
METASHAPE = """<?xml version="1.0" encoding="UTF-8"?>
<document><chunk label="one">
<sensors><sensor id="0" label="X" type="frame"><resolution width="2000" height="1500"/>
<calibration class="adjusted"><f>1800</f><cx>-10</cx><k1>-0.1</k1><b1>0.5</b1></calibration>
</sensor></sensors>
<cameras><camera id="3" sensor_id="0" label="a">
<transform>1 0 0 0 0 1 0 0 0 0 1 -10 0 0 0 1</transform></camera>
<camera id="6" sensor_id="0" label="lost"/></cameras>
<markers><marker id="0" label="M"><reference x="1" y="2" z="3" sx="0.01" sy="0.01" sz="0.02"/></marker>
<marker id="1" label="N"/></markers>
<scalebars><scalebar id="0" marker_1_id="0" marker_2_id="1">
<reference distance="1.5" accuracy="0.001"/></scalebar>
</scalebars><frames><frame id="0"><markers><marker marker_id="0">
<location camera_id="3" pinned="true" x="1000" y="700"/></marker></markers></frame></frames>
<transform><rotation>0 -1 0 1 0 0 0 0 1</rotation>
<translation>1 2 3</translation><scale>2</scale></transform>
<settings><property name="accuracy_projections" value="0.5"/></settings></chunk></document>
"""
DBAT = """<document><input base_dir="$HERE">
<ctrl_pts><file format="id,x,y,z" sxyz="0.5">c.txt</file><filter id="9">remove</filter></ctrl_pts>
<images><file format="id,path">i.txt</file></images>
<image_pts><file format="im,id,x,y" sxy="0.1">m.txt</file></image_pts>
<cameras><camera><name>X</name><sensor>auto,15</sensor><image>2000,1500</image><aspect>1</aspect>
<focal>18</focal><model>3</model><K>0.001,0,0</K><P>0,0</P></camera></cameras></input>
<operations><operation><set_bundle_estimate_params><io><all>true</all><skew>false</skew></io>
</set_bundle_estimate_params></operation></operations></document>
"""
INTERIOR = "18 10 7.5 20 15 0.0001 0 0 0 0"
PHOTOMODELER = f"""title
1e-4 20 2000 1500
0.1 0.1
{INTERIOR}
0 0 0 0 0 0 0 0 0 0
0 C:\\p\\a.jpg
0 0 0 10 90 0 0
0 1 1 1 1 1 1

0 {INTERIOR}
0 0 0 0 0 0 0 0 0 0 0

1 0 0 0 0.1 0.1 0.2

7 3 4 5

0 1 1000 750 0.1 0.2
"""
V1_POSE = """<ExportAPERO><OrientationConique><FileInterne>Ori-X/AutoCal.xml</FileInterne>
<ConvOri><KnownConv>eConvApero_DistM2C</KnownConv></ConvOri><Externe><Centre>1 0 0</Centre><ParamRotation>
<CodageMatr><L1>1 0 0</L1><L2>0 1 0</L2><L3>0 0 1</L3></CodageMatr></ParamRotation></Externe>
</OrientationConique></ExportAPERO>"""
V1_CAMERA = """<ExportAPERO><CalibrationInternConique><PP>1000 750</PP><F>1800</F><SzIm>2000 1500</SzIm>
<CalibDistortion><ModPhgrStd><RadialePart><CDist>1000 750</CDist><CoeffDist>1e-8</CoeffDist></RadialePart>
<P1>1e-7</P1></ModPhgrStd></CalibDistortion></CalibrationInternConique></ExportAPERO>"""
V1_POINTS = """<DicoAppuisFlottant><OneAppuisDAF><Pt>1 2 10</Pt><NamePt>A</NamePt>
<Incertitude>0.01 0.01 0</Incertitude></OneAppuisDAF></DicoAppuisFlottant>"""
V1_MEASURES = """<SetOfMesureAppuisFlottants><MesureAppuiFlottant1Im><NameIm>a.jpg</NameIm>
<OneMesureAF1I><NamePt>A</NamePt><PtIm>1180 1110</PtIm></OneMesureAF1I></MesureAppuiFlottant1Im>
</SetOfMesureAppuisFlottants>"""
TOPO = {
    "AllObsSetStations": [
        {
            "TopoObsSetData": {
                "Type": "Station",
                "AllObs": [
                    {
                        "TopoObsData": {
                            "Type": "Hz",
                            "Pts": ["A", "B"],
                            "Measures": [(1.5,)],
                            "Sigmas": [(0.1,)],
                        }
                    }
                ],
                "StationOriStatus": "#VERT",
            }
        }
    ],
    "ObsSetSimple": {
        "TopoObsSetData": {
            "Type": "Simple",
            "AllObs": [
                {"TopoObsData": {"Type": "Dist", "Pts": ["A", "B"], "Measures": [(9.0,)], "Sigmas": [(0.1,)]}}
            ],
        }
    },
}


AVERAGES: Tree = {part: {"SumW": (4,), "SumVW": (0.4,), "Nb": (5,)} for part in ("Tr", "Rot")}
INSTRUMENTS: dict[str, Tree] = {
    "Cams": {
        "NumMaster": (0,),
        "NumPoseInstr": [(-1,)],
        "Set_Cams": [
            {
                "Num": (k,),
                "NameCalib": name,
                "PatTimeStamp": ".*_(.*)",
                "SelIsPat": (1,),
                "ImSelect": ".*",
                "IsInit": (1,),
                "Pose": pose_tree(TURN),
            }
            for k, name in enumerate("ab")
        ],
    },
    "Clinos": {
        "Set_Clinos": [
            {"Name": name, "IsInit": (1,), "PolCorr": [(0,), (1,), (0,), (0,)], "PtNorm": (1, 0, 0)}
            for name in "xy"
        ]
    },
    "SigmasPairs": [{"K": ("a", "b"), "V": AVERAGES}],
    "DescrIndiv": [{"K": "a", "V": {"Type": "Camera", "NameInstr": "a", "Sigma": AVERAGES}}],
    "CstrRelRot": [],
    "CstrOrthog": [{"K": ("x", "y"), "V": {"Sigma": (0.1,)}}],
}
READINGS: dict[str, Tree] = {
    "NamesClino": ["x", "y"],
    "SetMeasures": [{"Ident": "1", "Angles": [(0.1,), (0.2,)], "__Opt__Sigmas": [(1e-4,), (1e-4,)]}],
}


def _binary_colmap() -> dict[str, bytes]:
    image = struct.pack("<QI7dI", 1, 3, 1, 0, 0, 0, 0, 0, 10, 1) + b"a.jpg\0"
    features = struct.pack("<QddQddQ", 2, 1000, 700, 5, 3, 3, 2**64 - 1)
    return {
        "cameras.bin": struct.pack("<QIiQQ8d", 1, 1, 4, 2000, 1500, 1800, 1802, 1000, 750, -0.1, 0, 0, 0),
        "images.bin": image + features,
        "points3D.bin": struct.pack("<QQ3d3BdQII", 1, 5, 1, 2, 3, 9, 9, 9, 0.5, 1, 3, 0),
    }


def _tree(text: str, name: str, reader: Callable[[Path], object]) -> Seed:
    return {name: text.encode()}, lambda folder: reader(folder / name)


def _text(text: str, reader: Callable[[Path], object]) -> Seed:
    return _tree(text, "f.txt", reader)


BLOCK = BlockFile("B", "x", "(.*)_(.*)", 1, 2, {"x": TURN}, {})
RULES = Rules({"Focalmm": (("a.*", "8"),), "ModelCam": ((".*", "X"),)})
BAL = "2 2 3\n0 0 10 -20\n1 0 -90 -20\n0 1 5 5\n" + 2 * "0 0 0 0 0 0 100 0.1 0\n" + "0.1 -0.2 -1\n0 0 -1\n"
BUNDLER = "# Bundle file v0.3\n1 1\n100 0.1 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n0.1 -0.2 -1\n9 9 9\n1 0 7 10 -20\n"
COLMAP = {
    "cameras.txt": b"# c\n1 OPENCV 2000 1500 1800 1801 1000 750 -0.1 0 0 0\n",
    "images.txt": b"1 1 0 0 0 0 0 10 1 a.jpg\n1000 700 5 3 3 -1\n",
    "points3D.txt": b"5 1 2 3 9 9 9 0.5 1 0\n",
}
AICON = {
    "b.ior": b"5 0 -18 0.05 -0.02 -2e-4 0 8\n0\n1e-5 0\n1e-4 0\n20 15 2000 1500\n",
    "b.eor": b"i 5 0 0 1000 0 0 0 0 1 3\n",
    "b.obc": b"P 1 2 3 0 0 0 4 1 0 1\nQ 5 2 3 0 0 0 4 1 0 0\n",
    "b.phc": b"i P 1 2 1 1 0 0 0 1 0\ni Q 1 3 1 1 0 0 0 1 0\n",
    "b.scl": b'1 "bar" P Q 1234.5 0.01 1\n',
}
DBAT_FILES = {
    "s.xml": DBAT.encode(),
    "c.txt": b"1, 1, 2, 3\n",
    "i.txt": b"1, a.jpg\n",
    "m.txt": b"1,1,900,700\n",
}
V1 = {
    "Ori-X/Orientation-a.jpg.xml": V1_POSE.encode(),
    "Ori-X/AutoCal.xml": V1_CAMERA.encode(),
    "p.xml": V1_POINTS.encode(),
    "m.xml": V1_MEASURES.encode(),
}


def seeds() -> dict[str, Seed]:
    """By kind: the files, and what reads them in a folder."""
    found = (
        exchange_seeds()
        | sfm_seeds()
        | carried_seeds()
        | project_seeds(as_json=False)
        | project_seeds(as_json=True)
    )
    assert json.loads(found["pose json"][0]["p.json"])
    return found


def exchange_seeds() -> dict[str, Seed]:
    """Of tables, and of the files of other programs."""
    return {
        "cameras": _text("name,width,height,focal,K1\nc,2000,1500,1800,-0.1\n", read_cameras),
        "images": _text("image camera x y z omega phi kappa\na c 1 2 3 0 0 90\n", read_images),
        "control": _text("point,x,y,z,sx,sy,sz\nA,1,2,3,0,,0.5\n", read_control),
        "measures": _text('image;point;x;y;sigma\na;"P;1";10;20;1\n', read_measures),
        "opk": _text("# x\na 1 2 3 10 20 30\nb 1 2 3 1 2 3\n", read_opk),
        "bal": _text(BAL, read_bal),
        "bundler": _text(BUNDLER, read_bundler),
        "colmap": (COLMAP, read_colmap),
        "colmap binary": (_binary_colmap(), read_colmap),
        "metashape": _tree(METASHAPE, "f.xml", read_metashape),
        "dbat": (DBAT_FILES, lambda folder: read_dbat(folder / "s.xml")),
        "photomodeler": _text(PHOTOMODELER, read_photomodeler),
        "aicon": (AICON, lambda folder: read_aicon(folder, 0.1)),
        "micmac": (V1, lambda folder: read_v1_block(folder / "Ori-X", folder / "m.xml", folder / "p.xml")),
        "pairs": _text("x1,y1,x2,y2\n1,2,3,4\n", read_pairs),
        "tracks": ({"PMUL-a.csv": b"Pt.x,Pt.y,Id\n1,2,3\n"}, read_tracks),
    }


def project_seeds(*, as_json: bool) -> dict[str, Seed]:
    """Of the files of a project, which are trees in XML or in JSON."""
    ending = "json" if as_json else "xml"
    trees: dict[str, Seed] = {
        "calibration": _tree(calibration_text(CAMERA, as_json=as_json), f"c.{ending}", read_calibration),
        "pose": _tree(pose_text("a", "c", TURN, as_json=as_json), f"p.{ending}", read_pose),
        "rigid block": _tree(block_text(BLOCK, as_json=as_json), f"b.{ending}", read_block),
        "instruments": _tree(
            data_text(INSTRUMENTS, as_json=as_json), f"FileRB_i.{ending}", read_instrument_block
        ),
        "readings": (
            {f"ClinoMeasures.{ending}": data_text(READINGS, as_json=as_json).encode()},
            read_clinometer_readings,
        ),
        "rules": _tree(rules_text(RULES, as_json=as_json), f"r.{ending}", read_rules),
        "names": _tree(names_text(["a", "b"], as_json=as_json), f"n.{ending}", read_names),
        "points": (
            {f"MesGCP-x.{ending}": points_text(POINTS, "x", as_json=as_json).encode()},
            read_control_points,
        ),
        "targets": (
            {f"MesIm-a.{ending}": measures_text("a", MEASURES, as_json=as_json).encode()},
            read_image_measures,
        ),
        "topo": ({f"t.{ending}": tree_text("TopoData", TOPO, as_json=as_json).encode()}, read_topo),
    }
    return {f"{name} {ending}": seed for name, seed in trees.items()}
