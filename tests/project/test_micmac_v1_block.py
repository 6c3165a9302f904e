"""Blocks of MicMac v1: orientations, measures and points in its files."""

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.project import read_v1_block
from obseq.project.micmac_v1 import read_v1_points

ORIENTATION = """<ExportAPERO><OrientationConique>
<FileInterne>Ori-X/AutoCal.xml</FileInterne><ConvOri><KnownConv>eConvApero_DistM2C</KnownConv></ConvOri>
<Externe><Centre>{x} 0 0</Centre><ParamRotation><CodageMatr>
<L1>1 0 0</L1><L2>0 1 0</L2><L3>0 0 1</L3></CodageMatr></ParamRotation></Externe>
</OrientationConique></ExportAPERO>"""
CALIBRATION = """<ExportAPERO><CalibrationInternConique><PP>1000 750</PP><F>1800</F><SzIm>2000 1500</SzIm>
<CalibDistortion><ModNoDist><Inutile>0</Inutile></ModNoDist></CalibDistortion>
</CalibrationInternConique></ExportAPERO>"""
POINTS = """<Global><DicoAppuisFlottant>
<OneAppuisDAF><Pt>1 2 10</Pt><NamePt>A</NamePt><Incertitude>0.01 0.01 0</Incertitude></OneAppuisDAF>
<OneAppuisDAF><Pt>2 1 12</Pt><NamePt>B</NamePt><Incertitude>-1 -1 -1</Incertitude></OneAppuisDAF>
</DicoAppuisFlottant></Global>"""
MEASURES = """<SetOfMesureAppuisFlottants>
<MesureAppuiFlottant1Im><NameIm>a.jpg</NameIm>
<OneMesureAF1I><NamePt>A</NamePt><PtIm>1180 1110</PtIm></OneMesureAF1I>
<OneMesureAF1I><NamePt>B</NamePt><PtIm>1300 900</PtIm></OneMesureAF1I></MesureAppuiFlottant1Im>
<MesureAppuiFlottant1Im><NameIm>b.jpg</NameIm>
<OneMesureAF1I><NamePt>B</NamePt><PtIm>1150 900</PtIm></OneMesureAF1I></MesureAppuiFlottant1Im>
</SetOfMesureAppuisFlottants>"""


@pytest.fixture
def chantier(tmp_path):
    """Two images that look along z, a metre apart."""
    folder = tmp_path / "Ori-X"
    folder.mkdir()
    for name, x in (("a.jpg", 0), ("b.jpg", 1)):
        (folder / f"Orientation-{name}.xml").write_text(ORIENTATION.format(x=x))
    (folder / "AutoCal.xml").write_text(CALIBRATION)
    (tmp_path / "points.xml").write_text(POINTS)
    (tmp_path / "measures.xml").write_text(MEASURES)
    return tmp_path


def test_a_chantier_is_a_block_with_one_camera(chantier):
    block = read_v1_block(chantier / "Ori-X", chantier / "measures.xml", chantier / "points.xml", 0.5)
    assert list(block.cameras) == ["AutoCal"]
    assert block.poses.images == ("a.jpg", "b.jpg")
    assert block.control.sigmas.tolist() == [[0.01, 0.01, 0.0], [np.inf] * 3]
    (part,) = block.sets
    row = part.measures.labels(range(3)).index("image b.jpg, point B")
    point = block.control.coordinates[1]
    projected = block.cameras["AutoCal"].project(block.poses["b.jpg"].to_local(point[None]))
    np.testing.assert_allclose(part.measures.xy[row], projected[0])


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("measures.xml", "b.jpg", "c.jpg", "the image c.jpg has no orientation"),
        ("measures.xml", "1150 900", "1150", r"measures\.xml:6: <OneMesureAF1I>: PtIm should be 2"),
        ("points.xml", "<Pt>1 2 10", "<Pt>1 2 nan", r"points\.xml:2: <OneAppuisDAF>: Pt should be 3"),
        ("points.xml", "<Global>", '<!DOCTYPE x [<!ENTITY a "b">]><Global>', "entities"),
        ("points.xml", "DicoAppuisFlottant", "Dico", "DicoAppuisFlottant is expected"),
        ("points.xml", "NamePt>B", "NamePt>A", r"points\.xml: control point 'A' is given twice"),
        ("Ori-X/AutoCal.xml", "ModNoDist", "ModUnif", "distortion ModUnif"),
    ],
)
def test_what_is_wrong_is_named(chantier, name, old, new, message):
    path = chantier / name
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError, match=message):
        read_v1_block(chantier / "Ori-X", chantier / "measures.xml", chantier / "points.xml")


def test_a_folder_without_orientations(tmp_path):
    with pytest.raises(InputError, match="holds no orientation"):
        read_v1_block(tmp_path)
    with pytest.raises(InputError, match=r"none\.xml"):
        read_v1_points(tmp_path / "none.xml")
