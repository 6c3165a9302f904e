"""Scripts of DBAT and exports of PhotoModeler as blocks."""

import json

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.images.files.dbat import read_dbat
from obseq.images.files.photomodeler import read_photomodeler


def test_the_calibration_of_dbat_from_its_own_script(shared_data):
    expected = json.loads((shared_data / "dbat-camcal/expected.json").read_text())["dbat"]
    block = read_dbat(shared_data / "dbat-camcal/camcaldemo.xml")
    assert "P8250021.JPG" in block.camera_of
    block.initialise()
    solution = block.solve()
    assert solution.result.redundancy == expected["redundancy"]
    assert solution.sigma0 == pytest.approx(expected["sigma0"], abs=5e-5)


def test_the_aerial_block_of_dbat_from_its_own_script(shared_data):
    expected = json.loads((shared_data / "dbat-sxb/expected.json").read_text())["dbat"]
    block = read_dbat(shared_data / "dbat-sxb/sxb.xml")
    assert not {"351", "410"} & set(block.control.names)
    block.initialise()
    solution = block.solve()
    assert solution.result.redundancy == expected["redundancy"]
    assert solution.sigma0 == pytest.approx(expected["sigma0"], abs=5e-5)


def _dbat(tmp_path, change=lambda text: text, points="1, 2, 3, 4\n"):
    text = """<document><input base_dir="$HERE">
<ctrl_pts><file format="id,x,y,z" sxyz="0.5">c.txt</file></ctrl_pts>
<images><file format="id,path">i.txt</file></images>
<image_pts><file format="im,id,x,y" sxy="0.1">m.txt</file></image_pts>
<cameras><camera><name>X</name><unit>mm</unit><sensor>auto,15</sensor><image>2000,1500</image>
<aspect>1</aspect><focal>18</focal><model>3</model><nK>3</nK><nP>2</nP></camera></cameras>
</input></document>"""
    (tmp_path / "s.xml").write_text(change(text))
    (tmp_path / "c.txt").write_text("1, 1, 2, 3\n")
    (tmp_path / "i.txt").write_text("1, a/x.jpg # first\n2, b/x.jpg\n")
    (tmp_path / "m.txt").write_text(points)
    return tmp_path / "s.xml"


def test_sigmas_may_be_attributes_and_files_may_be_called_alike(tmp_path):
    block = read_dbat(_dbat(tmp_path))
    assert list(block.camera_of) == ["1", "2"]
    assert block.control.sigmas.tolist() == [[0.5, 0.5, 0.5]]
    assert block.sets[0].measures.sigmas.tolist() == [[0.1, 0.1]]
    (camera,) = block.cameras.values()
    assert camera.focal == pytest.approx(1800.0)
    assert camera.backward


@pytest.mark.parametrize(
    ("change", "points", "message"),
    [
        (
            lambda text: text.replace("<model>3", "<model>-1"),
            "1,2,3,4",
            r"s\.xml:\d+: <camera>: camera model -1",
        ),
        (lambda text: text.replace(' sxy="0.1"', ""), "1,2,3,4", "the measures have no sigma"),
        (lambda text: text, "1,2,3", r"m\.txt:1: 3 fields where im,id,x,y are expected"),
        (lambda text: text, "1,2,3,x", r"m\.txt:1: y is 'x', which is no number"),
        (lambda text: text, "7,2,3,4", "the image 7 is not in the list"),
        (lambda text: text.replace("$HERE", "$DBAT"), "", r"only \$HERE is known"),
        (lambda text: text.replace("<sensor>auto", "<sensor>40"), "1,2,3,4", "2 times as wide as high"),
        (lambda text: text.replace("c.txt", "none.txt"), "1,2,3,4", "none.txt"),
        (lambda text: "<a/>", "", "no script of DBAT"),
    ],
)
def test_scripts_that_cannot_be_read_are_refused_by_their_line(tmp_path, change, points, message):
    with pytest.raises(InputError, match=message):
        read_dbat(_dbat(tmp_path, change, points))


def test_an_export_of_photomodeler(tmp_path):
    interior = "18 10 7.5 20 15 0.0001 0 0 0 0"
    photo = (
        "{k} C:\\p\\{name}.jpg\n{k} 0 10 90 0 0\n1 1 1 1 1 1\n0 0 0 0\n"
        + interior
        + "\n0 0 0 0 0 0 0 0 0 0\n0\n"
    )
    photos = photo.format(k=0, name="a") + photo.format(k=1, name="b")
    head = f"title\n1e-4 20 2000 1500\n0.1 0.1\n{interior}\n0 0 0 0 0 0 0 0 0 0\n"
    text = (
        head
        + photos
        + "\n1 0 0 0 0.1 0.1 0.2\n2 1 0 0 0 0 0\n\n7 3 4 5\n"
        + "\n0 1 1000 750 0.001 0.002\n1 7 900 700 0.001 0.001\n"
    )
    (tmp_path / "p.txt").write_text(text)
    block = read_photomodeler(tmp_path / "p.txt")
    assert block.poses.images == ("a.jpg", "b.jpg")
    np.testing.assert_allclose(block.poses.attitudes("opk")[0], [0, 0, np.pi / 2], atol=1e-15)
    (camera,) = block.cameras.values()
    assert camera.focal == pytest.approx(1800.0)
    assert camera.principal_point.tolist() == [1000.0, 750.0]
    assert dict(zip(camera.coefficient_names, camera.coefficients, strict=True))["K1"] == pytest.approx(
        0.0001 * 324
    )
    assert block.control.names == ("1", "2")
    np.testing.assert_allclose(block.sets[0].measures.sigmas, [[0.1, 0.2], [0.1, 0.1]])
    (tmp_path / "p.txt").write_text(text.replace("1 7 900", "9 7 900"))
    with pytest.raises(InputError, match=r"p\.txt:\d+: the photo 9 is not there"):
        read_photomodeler(tmp_path / "p.txt")
