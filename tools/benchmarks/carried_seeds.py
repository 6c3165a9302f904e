"""Seeds of the fuzz of image readers: calibrations, projection matrices, tie points in an archive."""

import struct
import zipfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from obseq.formats.calibrations.reader import read_calibrations
from obseq.formats.metashape.reader import read_metashape
from obseq.formats.pix4d.reader import read_pix4d

Seed = tuple[dict[str, bytes], Callable[[Path], Any]]
KALIBR = b"""cam0:
  camera_model: pinhole
  distortion_coeffs: [-0.2, 0.06, 0.001, -0.002]
  distortion_model: radtan
  intrinsics: [1100.0, 1100.0, 641.0, 475.0]
  resolution: [1280, 960]
"""
OPENCV = b"""%YAML:1.0
---
image_width: 1280
image_height: 960
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1.1e+03, 0., 6.41e+02, 0., 1.1e+03, 4.75e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -2.0e-01, 6.0e-02, 1.0e-03, -2.0e-03, 1.0e-02 ]
"""
MATRICES = b"a.jpg 3000 0 2000 -1e5 0 3000 1500 2e4 0 0 1 7\nb.jpg 3000 0 2000 0 0 3000 1500 0 0 0 1 9\n"
CHUNK = b"""<document><chunks><chunk label="one"><sensors>
<sensor id="0" label="s" type="frame"><resolution width="2000" height="1500"/>
<calibration type="frame" class="adjusted"><f>1800</f></calibration></sensor></sensors><cameras>
<camera id="3" sensor_id="0" label="a"><transform>1 0 0 0 0 1 0 0 0 0 1 -10 0 0 0 1</transform></camera>
<camera id="5" sensor_id="0" label="b"><transform>1 0 0 2 0 1 0 0 0 0 1 -10 0 0 0 1</transform></camera>
</cameras><frames><frame id="0"><point_cloud><points path="o.ply"/>
<projections camera_id="3" path="p3.ply"/><projections camera_id="5" path="p5.ply"/>
</point_cloud></frame></frames>
<settings><property name="accuracy_projections" value="0.5"/></settings></chunk></chunks></document>
"""


def _ply(names: str, layout: str, rows: list[tuple[float, ...]]) -> bytes:
    types = {"f": "float", "i": "int"}
    columns = "".join(
        f"property {types[kind]} {name}\n" for name, kind in zip(names.split(), layout, strict=True)
    )
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{columns}end_header\n"
    return head.encode() + b"".join(struct.pack(f"<{layout}", *row) for row in rows)


TIES = {
    "doc.xml": CHUNK,
    "o.ply": _ply("x y z id", "fffi", [(0.5, 0.0, 1.0, 7), (1.0, 0.5, 0.0, 4)]),
    "p3.ply": _ply("x y size id", "fffi", [(1000.0, 700.0, 2.0, 4), (900.0, 650.0, 1.0, 7)]),
    "p5.ply": _ply("x y size id", "fffi", [(700.0, 600.0, 0.5, 7), (800.0, 620.0, 1.0, 4)]),
}


def _archived(folder: Path) -> Any:
    with zipfile.ZipFile(folder / "f.psz", "w") as archive:
        for name in TIES:
            archive.write(folder / name, name)
    return read_metashape(folder / "f.psz")


def carried_seeds() -> dict[str, Seed]:
    """By kind: the files, and what reads them in a folder; YAML where PyYAML is there."""
    calibrations: dict[str, Seed] = {
        "kalibr": ({"c.yaml": KALIBR}, lambda folder: read_calibrations(folder / "c.yaml")),
        "opencv": ({"c.yaml": OPENCV}, lambda folder: read_calibrations(folder / "c.yaml")),
    }
    return {
        **(calibrations if find_spec("yaml") else {}),
        "pmatrix": ({"m.txt": MATRICES}, lambda folder: read_pix4d(folder / "m.txt")),
        "tie points": (TIES, _archived),
    }
