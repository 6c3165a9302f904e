"""Scripts of DBAT and exports of PhotoModeler as blocks."""

import json

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.formats.dbat.reader import read_dbat
from obseq.formats.photomodeler.reader import read_photomodeler


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
        (lambda text: text, "1,2,3,x", r"m\.txt:1: y is 'x', which is no finite number"),
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


def _export(shared_data, size="2272 1704", marks=None):
    """The calibration of DBAT as PhotoModeler exports it, line by line: from its measures and stations."""
    folder = shared_data / "dbat-camcal"
    expected = json.loads((folder / "expected.json").read_text())["dbat"]
    interior = "7.45700 3.61546 2.61329 7.25020 5.43764 0.00498 -0.00010 0.00000 -0.00007 -0.00003"
    zeros = "0.00000 0.00725 0.00544 0.500000 0.500000 0.001000 0.000100 0.000100 0.001000 0.001000"
    lines = [
        "Bundle Soln PhotoModeler Calibration Project",
        f" 0.000500 20 {size}",
        " 1.0 0.1 10 100 100 100 20 20 20",
    ]
    lines += [f" {interior}", f" {zeros}"]
    for k, row in enumerate(expected["camera_stations_rad"].values()):
        x, y, z, omega, phi, kappa = *row[:3], *np.degrees(np.array(row[3:]))
        pose = f"{x:8.3f} {y:8.3f} {z:8.3f} {kappa:8.3f} {phi:8.3f} {omega:8.3f}"
        lines += [
            f"   {k} e:\\pm\\images\\P{k:03}.JPG",
            f"   {k} {pose}",
            f"   {k}   0.0002 0.0001 0.0001 0.003 0.005 0.005",
        ]
        lines += ["", f"   {k}  {interior}", f"   {k} {zeros}"]
    control = [
        line.replace(",", " ").split()
        for line in (folder / "reference/camcal-fixed.txt").read_text().splitlines()
        if line[:1].strip() not in ("", "#")
    ]
    fixed = [f"    {row[0]} {' '.join(row[2:5])} -1.778088 -1.778088 -1.778088" for row in control]
    given = [
        line.replace(",", " ").split()
        for line in (folder / "measurements/markpts.txt").read_text().splitlines()
        if line[:1] != "#"
    ]
    measured = [f"   {int(row[0]) - 1} {row[1]} {row[2]} {row[3]}  0.10000  0.10000" for row in given]
    return "\n".join([*lines, "", *fixed, "", *fixed, "", *(marks or measured), ""]) + "\n"


def test_an_export_of_photomodeler_in_its_own_layout(shared_data, tmp_path):
    """Its lines have numbers before them, an empty line of covariances, negative sigmas for what is fixed."""
    path = tmp_path / "camcal.txt"
    path.write_text(_export(shared_data))
    expected = json.loads((shared_data / "dbat-camcal/expected.json").read_text())["dbat"]
    block = read_photomodeler(path)
    assert len(block.poses) == 21
    assert block.control.sigmas.tolist() == [[0.0] * 3] * 4
    (camera,) = block.cameras.values()
    block.freeze_parameters("b2")  # the skew, which DBAT does not estimate
    solution = block.solve()
    assert solution.sigma0 == pytest.approx(expected["sigma0"], abs=5e-4)
    assert solution.result.redundancy == expected["redundancy"]
    accented = _export(shared_data).replace("images\\P", "débruitées\\P").encode("cp1252")
    path.write_bytes(accented)
    assert b"\xe9" in accented and read_photomodeler(path).poses.images == block.poses.images
    path.write_text(_export(shared_data, size=""))
    with pytest.raises(InputError, match=r"camcal\.txt:2: the size of the images is missing"):
        read_photomodeler(path)
    assert read_photomodeler(path, (2272, 1704)).cameras["camera 1"].focal == camera.focal


@pytest.mark.parametrize(
    ("marks", "message"),
    [
        (["9 7 900 700 0.1 0.1", "99 7 900 700 0.1 0.1"], "the photo 99 is not there"),
        (["0 7 900 700 0 0"], "the mark has no sigma, as those of SmartPoints"),
        (["0 7 900"], "4 numbers are expected"),
    ],
)
def test_marks_that_do_not_do_are_refused(shared_data, tmp_path, marks, message):
    path = tmp_path / "p.txt"
    path.write_text(_export(shared_data, marks=marks))
    with pytest.raises(InputError, match=rf"p\.txt:\d+: {message}"):
        read_photomodeler(path)


def test_photos_that_do_not_do_are_refused(shared_data, tmp_path):
    path = tmp_path / "p.txt"
    text = _export(shared_data)
    first = text.splitlines()[6]
    path.write_text(text.replace(first, first.replace("0 ", "1 ", 1), 1))
    with pytest.raises(InputError, match=r"p\.txt:7: a line of photo 0 begins with its number"):
        read_photomodeler(path)
    path.write_text("\n".join(text.splitlines()[:13]))
    with pytest.raises(InputError, match="6 lines for each photo"):
        read_photomodeler(path)
