from collections import Counter

import numpy as np
import pytest
from cases import FOLDER, cases, check, identify

from obseq.errors import InputError
from obseq.images.aerial import (
    HeightType,
    Shots,
    read_camera,
    read_ground_points,
    read_image_points,
    read_shots,
    shots_text,
)
from obseq.images.aerial.files import Columns

OPK = "A 1 2 100 0.1 -0.2 3 cam\nB 4 5 200 0 0 0 cam\n"


def written(tmp_path, text, name="f.opk"):
    path = tmp_path / name
    path.write_text(text)
    return path


@pytest.mark.parametrize("case", [c for c in cases("reader") if "file" in c["inputs"]], ids=identify)
def test_shots_are_read(case):
    inputs, expected = case["inputs"], case["expected"]
    path, interval = FOLDER / inputs["file"], tuple(inputs["interval"])
    if "error" in expected:
        with pytest.raises(InputError, match="begin at line 2"):
            read_shots(path, inputs["header"], interval=interval)
        return
    shots, _ = read_shots(path, inputs["header"], interval=interval)
    if "shots" in expected:
        assert list(shots.names) == expected["shots"]
        return
    assert len(shots) == expected["n_shots"]
    if "first" in expected:
        for row, wanted in ((0, expected["first"]), (-1, expected["last"])):
            assert shots.names[row] == wanted[0]
            assert shots.positions[row].tolist() == wanted[1]
            np.testing.assert_allclose(np.rad2deg(shots.angles()[row]), wanted[2], atol=1e-12)
        assert shots.height_type is HeightType.ALTITUDE


def test_the_large_block_is_read(shared_data):
    folder = shared_data / "borea"
    (case,) = [c for c in cases("reader") if c["id"] == "read-dataset2"]
    inputs, expected = case["inputs"], case["expected"]
    shots, _ = read_shots(folder / inputs["opk"], interval=(2, None))
    tie = read_image_points(folder / inputs["co_point"])
    control = read_image_points(folder / inputs["gcp2d"])
    ground = read_ground_points(folder / inputs["gcp3d"], "PTXYH")
    seen = Counter(Counter(tie.names).values())
    check(case, n_shots=len(shots), n_tie_points=len(set(tie.names)), n_tie_measures=len(tie.names))
    assert {str(key): value for key, value in seen.items()} == expected["multiplicity_histogram"]
    assert dict(Counter(control.names)) == expected["n_gcp2d"]
    found = zip(ground.names, ground.codes, ground.coordinates.tolist(), strict=True)
    assert {name: [code, place] for name, code, place in found} == expected["gcp3d"]
    assert ground.height_type is HeightType.HEIGHT


@pytest.mark.parametrize("case", cases("opk_to_opk"), ids=identify)
def test_shots_are_written(case, tmp_path):
    inputs, expected = case["inputs"], case["expected"]
    options = inputs["args"]
    shots, _ = read_shots(FOLDER / inputs["opk"], interval=(2, None))
    header = options["header"] or "NXYZOPKC"
    text = shots_text(shots, header, order=options["order_axe"] or "opk")
    title, *lines = text.splitlines()
    assert title.split() == expected["header_line"]
    for line, wanted in zip(lines, expected["rows"], strict=True):
        for word, value in zip(line.split(), wanted, strict=True):
            if value.lstrip("-")[:1].isdigit() and "x" not in value:
                assert float(word) == pytest.approx(float(value), abs=1e-9)
            else:
                assert word == value
    again, _ = read_shots(
        written(tmp_path, text), header, interval=(2, None), order=options["order_axe"] or "opk"
    )
    np.testing.assert_allclose(again.matrices, shots.matrices, atol=1e-15)


def test_shots_in_gon_come_back(tmp_path):
    shots = Shots.from_angles(
        ["A"], [[1.5, 2.5, 3.5]], [[0.1, 0.2, 0.3]], ["c"], height_type=HeightType.HEIGHT
    )
    text = shots_text(shots, "NXYHOPKC", unit="gon")
    assert text.startswith("N   X   Y   H   O   P   K   C\n")
    again, _ = read_shots(written(tmp_path, text), "NXYHOPKC", interval=(2, None), unit="gon")
    np.testing.assert_allclose(again.angles(), shots.angles(), atol=1e-15)
    assert again.height_type is HeightType.HEIGHT


@pytest.mark.parametrize(
    ("header", "reason"),
    [
        ("XYZOPKC", "N missing"),
        ("NNXYZOPKC", "N stands twice"),
        ("NXYZHOPKC", "one of them"),
        ("NXYZAOPKC", "'A' has no meaning"),
        ("NXYOPKC", "one of them"),
    ],
)
def test_headers_of_shots(header, reason):
    with pytest.raises(InputError, match=reason):
        Columns.of(header, "NXYOPKC", "NXYOPKC", has_z=True)


def test_a_bad_line_is_refused_by_number(tmp_path):
    path = written(tmp_path, OPK.replace("200", "2oo"))
    with pytest.raises(InputError, match=r"f\.opk:2: '2oo' is not a number"):
        read_shots(path)


def test_good_lines_are_kept_on_request(tmp_path):
    text = "NAME X Y Z O P K CAM\n# comment\n" + OPK + "C 1 2 3\nA 7 8 9 0 0 0 cam\nD 1 2 nan 0 0 0 cam\n"
    shots, bad = read_shots(written(tmp_path, text), keep_good=True)
    assert shots.names == ("A", "B")
    assert [line.number for line in bad] == [5, 6, 7]
    assert "3 columns" not in bad[0].reason
    assert "has 4 columns" in bad[0].reason
    assert "was given before, in line 3" in bad[1].reason
    assert "not a finite number" in bad[2].reason


def test_a_measure_given_twice_is_refused(tmp_path):
    path = written(tmp_path, "P a 1 2\nP b 1 2\nP a 1 3\n")
    with pytest.raises(InputError, match=r"f\.opk:3: P a was given before, in line 1"):
        read_image_points(path)


def test_a_camera_without_final_newline(tmp_path):
    path = written(tmp_path, "Name = c\nPPAx = 10\nppay = 20\nFOCAL = 100.5\nwidth = 17004\nheight = 17004")
    camera = read_camera(path)
    assert (camera.name, camera.principal_point, camera.focal) == ("c", (10.0, 20.0), 100.5)
    assert camera.size == (17004, 17004)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("name = c\nppax = 1\nppay = 2\n", "lacks focal"),
        ("name = c\nppax = 1\nppay = 2\nfocal = -3\n", "focal positive"),
        ("name = c\nppax = x\nppay = 2\nfocal = 3\n", "ppax: 'x' is not a number"),
        ("name = c\nfoo\n", "key = value"),
        ("name = c\nname = d\n", "given twice"),
    ],
)
def test_bad_cameras_are_refused(tmp_path, text, reason):
    with pytest.raises(InputError, match=reason):
        read_camera(written(tmp_path, text))
