"""What is wrong in the tables of a block is told with its file and line."""

import pytest

from obseq.errors import InputError
from obseq.formats.blocks.observations import add_lengths, observe_positions
from obseq.formats.blocks.tables import BlockFiles, add_measures
from obseq.images import BundleAdjustment

TABLES = {
    "cameras": "name,width,height,focal\n# the only one\nwide,2000,1500,1800\n",
    "images": "image,camera,x,y,z,omega,phi,kappa\n\na,wide,0,0,9,0,0,0\nb,wide,1,0,9,0,0,0\n",
    "control": "point,x,y,z,sigma\nP,0,0,0,0.01\nQ,1,0,0,0.01\n",
    "measures": "image,point,x,y\na,P,1000,750\nb,P,800,750\na,Q,1200,750\n",
}


def _filled(folder, **changed):
    for name, text in {**TABLES, **changed}.items():
        (folder / f"{name}.csv").write_text(text)
    cameras, images, control, measures = (folder / f"{name}.csv" for name in TABLES)
    block = BundleAdjustment()
    BlockFiles(cameras, images, [measures], [control], 0.5).fill(block)
    return block


@pytest.mark.parametrize(
    ("table", "more", "message"),
    [
        ("measures", "c,P,1,1\n", "measures.csv:5: image points: image 'c' is not known"),
        ("measures", "b,P,1,1\n", "measures.csv:5: image b, point P: measured twice in the image"),
        ("measures", "\nb,Q,5000,1\n", "measures.csv:6: image b, point Q: (5000, 1) is outside the image"),
        (
            "measures",
            "A.JPG,P,1,1\n",
            "measures.csv:5: image points: image 'A.JPG' is not known ('a' is: names",
        ),
        (
            "measures",
            "D:\\flight\\A.JPG,P,1,1\n",
            "is not known ('a' is: names count with folder, case and ending)",
        ),
        ("measures", "b,Q,-900,1\n", "an origin in the middle of the image add half of its width"),
        ("measures", "b,Q,1e999,1\n", "measures.csv:5: x is '1e999', which is no finite number"),
        ("control", "P,0,0,0,0.01\n", "control.csv:4: control point 'P' is given twice"),
        ("control", "R,0,0,0,-1\n", "control.csv:4: control point R: a sigma is above zero"),
        ("images", "a,wide,0,0,9,0,0,0\n", "images.csv:5: image 'a' is given twice"),
        ("images", "a,wide,,,,,,\n", "images.csv:5: image 'a' is given twice"),
        ("images", "c,tele,0,0,9,0,0,0\n", "images.csv:5: image c: its calibration tele is missing"),
        ("cameras", "tele,2000,1500,-3\n", "cameras.csv:4: "),
        ("cameras", "wide,2000,1500,1800\n", "cameras.csv:4: camera 'wide' is given twice"),
        ("cameras", "tele,2000,1500,28\n", "cameras.csv:4: camera tele: a focal length of 28"),
    ],
)
def test_a_wrong_row_is_told_with_its_line(tmp_path, table, more, message):
    with pytest.raises(InputError) as error:
        _filled(tmp_path, **{table: TABLES[table] + more})
    assert message in str(error.value)
    assert str(error.value).count(f"{table}.csv") == 1


def test_adjusted_points_are_read_as_control_points(tmp_path):
    table = "point,x,y,z,sx,sy,sz,rays\nP,0,0,0,0.1,0.1,0.2,4\nQ,1,0,0,0.1,0.1,0.2,2\n"
    assert _filled(tmp_path, control=table).control.sigmas[1].tolist() == pytest.approx([0.1, 0.1, 0.2])


def test_control_on_a_line_is_told_with_its_lines(tmp_path):
    on_a_line = {
        "control": "point,x,y,z,sigma\nP,0,0,0,0.01\n\nQ,1,0,0,0.01\nR,2,0,0,0.01\n",
        "measures": TABLES["measures"] + "b,Q,1000,750\na,R,1400,750\nb,R,1200,750\n",
    }
    with pytest.raises(InputError) as error:
        _filled(tmp_path, **on_a_line).solve()
    path = tmp_path / "control.csv"
    assert f"3 control points (P ({path}:2), Q ({path}:4), R ({path}:5)) are on a line" in str(error.value)


def test_control_in_degrees_is_told(tmp_path):
    table = "point,x,y,z,sigma\nP,2.0001,48.0001,10,0.01\nQ,2.0002,48.0001,75,0.01\nR,2.0,48.0,140,0.01\n"
    measures = TABLES["measures"] + "b,Q,1000,750\na,R,1400,750\nb,R,1200,750\n"
    high = TABLES["images"].replace("0,0,9", "2,48,900").replace("1,0,9", "3,48,900")
    with pytest.raises(InputError, match="x and y look like degrees: give lengths, in a local frame"):
        _filled(tmp_path, control=table, measures=measures, images=high).solve()


def test_a_block_without_datum_is_told_with_its_files(tmp_path):
    with pytest.raises(InputError) as error:
        _filled(tmp_path).solve()
    assert str(error.value).startswith(f"{tmp_path / 'control.csv'}: the block has no datum: 6 coordinates")
    with pytest.raises(InputError) as error:
        _filled(tmp_path, control="point,x,y,z,sigma\n").solve()
    assert "the block has no datum: 0 coordinates" in str(error.value)


def test_a_point_behind_its_camera_is_told_with_its_line(tmp_path):
    high = "point,x,y,z,sigma\nP,0,0,0,0.01\nQ,1,0,20,0.01\n"
    with pytest.raises(InputError) as error:
        _filled(tmp_path, control=high).solve()
    behind = (
        f"{tmp_path / 'measures.csv'}:4: image a, point Q: the point is behind the camera (1 measures are)"
    )
    assert str(error.value).startswith(behind)


def test_decimal_commas_between_semicolons_are_told(tmp_path):
    with pytest.raises(InputError) as error:
        _filled(tmp_path, control="point;x;y;z;sigma\nP;-0,5;0;0;0,01\n")
    assert "control.csv:2: x is '-0,5', which is no finite number; decimals are written with" in str(
        error.value
    )
    block = _filled(tmp_path, control='point;x;y;z;sigma\n"P, old";0.5;0;0;0.01\n')
    assert block.control.names == ("P, old",)


def test_a_second_table_of_measures_is_told_with_its_own_line(tmp_path):
    block = _filled(tmp_path)
    again = tmp_path / "again.csv"
    again.write_text("image,point,x,y\nb,Q,900,750\nb,P,800,750\n")
    with pytest.raises(InputError, match=r"again\.csv:3: image b, point P: measured twice"):
        add_measures(block, again, 0.5)


def test_other_observations_are_told_with_their_lines(tmp_path):
    block = _filled(tmp_path)
    positions = tmp_path / "positions.csv"
    positions.write_text("image,x,y,z,sigma\na,0,0,9,0.1\nz,0,0,9,0.1\n")
    with pytest.raises(InputError, match=r"positions\.csv:3: observed poses: image 'z' is not known"):
        observe_positions(block, positions)
    positions.write_text("image,x,y,z,sigma\na,0,0,9,0.1\nb,0,0,9,-0.1\n")
    with pytest.raises(InputError, match=r"positions\.csv:3: .*image b"):
        observe_positions(block, positions)
    lengths = tmp_path / "lengths.csv"
    lengths.write_text("from,to,length,sigma\nP,P,1,0.1\n")
    with pytest.raises(InputError, match=r"lengths\.csv:2: "):
        add_lengths(block, lengths)
