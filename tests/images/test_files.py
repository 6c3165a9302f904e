"""Blocks in files: tables of ours, BAL, Bundler, COLMAP; and what is wrong with others."""

import bz2
from dataclasses import replace

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.formats.bal.reader import read_bal, write_bal
from obseq.formats.blocks.tables import read_cameras, read_control, read_images, read_measures
from obseq.formats.bundler.reader import read_bundler
from obseq.formats.colmap.reader import read_colmap, write_colmap
from obseq.images import BundleAdjustment
from obseq.images.output.clouds import camera_table, ply, pose_table
from obseq.images.output.record import record_of

HEADER = "# Bundle file v0.3\n"
CAMERA = "1 1\n9 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n"


def _written(tmp_path, name: str, text: str):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_tables_are_read_whatever_their_order(tmp_path):
    path = _written(
        tmp_path,
        "c.csv",
        "# title\nfocal, name, width, height, K1, b2\n1800.5, wide, 2000, 1500, -0.1, 1e-4\n",
    )
    (camera,) = read_cameras(path)
    assert (camera.name, camera.focal, camera.degree) == ("wide", 1800.5, (3, 1, 1))
    assert camera.principal_point.tolist() == [1000.0, 750.0]
    images = _written(tmp_path, "i.csv", "image camera x y z omega phi kappa\na wide 1 2 3 0 0 90\n")
    camera_of, poses = read_images(images)
    assert camera_of == {"a": "wide"}
    # kappa 90: the columns go north
    np.testing.assert_allclose(poses["a"].rotation[:, 0], [0.0, 1.0, 0.0], atol=1e-15)
    control = read_control(_written(tmp_path, "g.csv", "point,x,y,z,sx,sy,sz\nA,1,2,3,0,,0.5\n"))
    assert control.sigmas.tolist() == [[0.0, np.inf, 0.5]]
    measures = read_measures(_written(tmp_path, "m.csv", 'image;point;x;y\na;"P;1";10;20\n'), sigma=0.5)
    assert measures.point_names == ("P;1",)


def test_a_backward_camera_stays_one(tmp_path):
    head = "name width height focal backward K1\n"
    forward, backward = read_cameras(_written(tmp_path, "c.csv", head + "a 9 9 9 0 1e-3\nb 9 9 9 1 1e-3\n"))
    assert (forward.backward, backward.backward) == (False, True)
    block, _, _ = scenes.block()
    block.cameras["c"] = replace(block.cameras["c"], backward=True)
    solution = block.solve()
    (camera,) = read_cameras(_written(tmp_path, "c.csv", camera_table(solution)))
    assert camera.backward
    np.testing.assert_array_equal(camera.parameters, solution.cameras["c"].parameters)
    assert record_of(solution).cameras[0].backward


@pytest.mark.parametrize(
    ("reader", "text", "message"),
    [
        (
            read_cameras,
            "name,width,height,focal,backward\nc,9,9,9,2\n",
            r"f\.csv:2: backward is 0 or 1, not 2",
        ),
        (read_cameras, "", r"f\.csv:1: the file has no line of column names"),
        (read_cameras, "name,width,height\n", r"f\.csv: column 'focal' is missing"),
        (read_cameras, "name,width,height,focal\nc,10,10\n", r"f\.csv:2: 3 cells for 4 columns"),
        (
            read_cameras,
            "name,width,height,focal\nc,10,10,x\n",
            r"f\.csv:2: focal is 'x', which is no finite",
        ),
        (read_cameras, "name,width,height,focal\nc,10,10,nan\n", r"f\.csv:2: focal is 'nan'"),
        (read_cameras, "name,width,height,focal\nc,10,10,-1\n", r"f\.csv:2: camera c: the focal length"),
        (read_images, "image,x,y,z,omega,phi,kapa\n", r"f\.csv: column 'kapa' means nothing here"),
        (read_images, "image,x,y,z,qw,qx,qy,qz\na,0,0,0,0,0,0,0\n", r"f\.csv: A quaternion is zero"),
        (read_control, "point,x,y,z\nA,1,2,3\n", r"f\.csv: no column says how well"),
        (
            read_control,
            "point,x,y,z,sigma\nA,1,2,3,1\nA,1,2,3,1\n",
            r"f\.csv:3: control point 'A' is given twice",
        ),
        (read_measures, "image,point,x,y\na,P,1,2\n", r"f\.csv: no column says how good"),
        (read_measures, "image,point,x,y,sigma\na,P,1,2,0\n", r"f\.csv:2: image a, point P: the sigma"),
        (read_measures, "image,point,x,x\n", r"f\.csv:1: two columns have the name x"),
        (read_bal, "1 1\n", r"f\.csv: the first line of a BAL file"),
        (read_bal, "1 1 1\n0 0 1 2\n", r"f\.csv:1: .* are 19 numbers; the file has 7"),
        (
            read_bal,
            "1 1 1\n\n0 1\n1 2\n" + "0 0 0\n" * 2 + "9 0 0\n" + "0 0 5\n",
            r"f\.csv:3: an observation names camera 0 and point 1; there are 1 and 1",
        ),
        (read_bal, "1 0 0\n" + "a " * 9, r"f\.csv:2: a number is 'a', which is no finite number"),
        (read_bal, "1 0 0\n" + "0 " * 6 + "\n-9 0 0\n", r"f\.csv: camera .* focal length must be above zero"),
        (read_bundler, "# Bundle file v0.3\n1 0\n1 0 0\n1 0 nan\n", r"f\.csv:4: a number is 'nan'"),
        (
            read_bundler,
            "# Bundle file v0.3\n1 0\n1 0 0\n" + "0 0 0\n" * 4,
            r"f\.csv: A matrix is not|f\.csv: Several",
        ),
        (read_bundler, "# v0.2\n", r"not a Bundler file of version 0\.3"),
        (read_bundler, HEADER + "1 1\n1 2 3\n", r"f\.csv:2: 1 cameras and 1 points are 8 lines; 1 follow"),
        (read_bundler, HEADER + "1 x\n", r"f\.csv:2: a number is 'x'"),
        (read_bundler, HEADER + "1\n", r"f\.csv:2: the line after the first counts"),
        (read_bundler, HEADER + "1 0\n9 0 0\n\n1 0 0\n0 1\n0 0 1\n0 0 0\n", r"f\.csv:6: 3 numbers"),
        (read_bundler, HEADER + CAMERA + "0 0 5\n0 0 0\n2 0 1 1 1\n", r"f\.csv:10: 2 views are 8 numbers"),
        (read_bundler, HEADER + CAMERA + "0 0 5\n0 0 0\n1 1 1 1 1\n", r"f\.csv:10: .* seen by camera 1"),
    ],
)
def test_broken_files_are_refused_with_their_place(tmp_path, reader, text, message):
    with pytest.raises(InputError, match=message):
        reader(_written(tmp_path, "f.csv", text))


def test_a_missing_file_and_a_binary_one(tmp_path):
    with pytest.raises(InputError, match=r"none\.csv: there is no such file"):
        read_cameras(tmp_path / "none.csv")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"b\.csv: not a text in UTF-8"):
        read_cameras(tmp_path / "b.csv")


@pytest.fixture
def bal(tmp_path):
    """Two cameras that see two points: the second one is a metre to the right (its t is -1)."""
    text = "2 2 3\n0 0 10 -20\n1 0 -90 -20\n0 1 5 5\n" + "0 0 0 0 0 0 100 0.1 0\n0 0 0 -1 0 0 100 0 0\n"
    return _written(tmp_path, "p.txt", text + "0.1 -0.2 -1\n0.05 0.05 -1\n")


def test_bal_is_turned_to_our_axes_and_back(bal, tmp_path):
    block = read_bal(bal)
    assert block.poses["image 1"].centre.tolist() == [1.0, 0.0, 0.0]
    point = block.approximations["P0"]
    local = block.poses["image 0"].to_local(point[None])
    # P = (0.1, -0.2, -1), p = (0.1, -0.2), r2 = 0.05: 100 (1 + 0.005) p, and y goes down here
    camera = block.cameras["camera of image 0"]
    np.testing.assert_allclose(camera.project(local), [[10.05, 20.1]], rtol=1e-12)
    assert block.sets[0].measures.xy[0].tolist() == [10.0, 20.0]
    write_bal(block, tmp_path / "again.txt")
    np.testing.assert_allclose(
        np.array((tmp_path / "again.txt").read_text().split(), dtype=float),
        np.array(bal.read_text().split(), dtype=float),
        atol=1e-15,
    )
    (tmp_path / "p.txt.bz2").write_bytes(bz2.compress(bal.read_bytes()))
    assert read_bal(tmp_path / "p.txt.bz2").poses.images == block.poses.images


def test_terms_that_bal_does_not_have_are_named_with_the_way_to_hold_them(tmp_path):
    block, _, _ = scenes.block(n_images=3, n_points=6, n_control=6)
    with pytest.raises(
        InputError, match=r"BAL has no place for p1 of a camera, not zero here: .* --freeze 'p1'"
    ):
        write_bal(block, tmp_path / "b.bal")
    block.cameras["c"] = replace(scenes.CAMERA, distortion={"K1": -0.08, "K2": 0.02})
    write_bal(block, tmp_path / "b.bal")
    again = read_bal(tmp_path / "b.bal")
    local = np.array([[0.3, 0.2, 1.0], [-0.4, 0.1, 1.0]])
    (camera, *_), given = again.cameras.values(), block.cameras["c"]
    centred = given.project(local) - given.principal_point
    np.testing.assert_allclose(camera.project(local), centred, rtol=0.0, atol=1e-9)


def test_bundler_says_the_same_as_bal(bal, tmp_path):
    text = """# Bundle file v0.3
3 2
100 0.1 0
1 0 0
0 1 0
0 0 1
0 0 0
0 0 0
0 0 0
0 0 0
0 0 0
0 0 0
100 0 0
1 0 0
0 1 0
0 0 1
-1 0 0
0.1 -0.2 -1
255 0 0
2 0 7 10 -20 2 9 -90 -20
0.05 0.05 -1
255 0 0
1 0 8 5 5
"""
    block, other = read_bundler(_written(tmp_path, "bundle.out", text), ["a", "lost", "b"]), read_bal(bal)
    assert block.poses.images == ("a", "b")
    np.testing.assert_allclose(block.poses.centres, other.poses.centres)
    np.testing.assert_allclose(block.poses.rotations, other.poses.rotations)
    assert sorted(map(tuple, block.sets[0].measures.xy)) == sorted(map(tuple, other.sets[0].measures.xy))


def test_what_is_written_for_colmap_comes_back(tmp_path):
    block, _, _ = scenes.block()
    block.freeze_parameters("K3|b.")
    solution = block.solve()
    write_colmap(solution, tmp_path)
    again = read_colmap(tmp_path)
    np.testing.assert_allclose(again.poses.centres, solution.poses.centres, atol=1e-12)
    np.testing.assert_allclose(again.poses.rotations, solution.poses.rotations, atol=1e-14)
    camera = next(iter(again.cameras.values()))
    np.testing.assert_allclose(camera.parameters, solution.cameras["c"].parameters, atol=1e-12)
    assert len(again.sets[0].measures) == len(solution.residuals.row)
    (tmp_path / "cameras.txt").write_text("1 FOV 10 10 1 1 1 1\n")
    with pytest.raises(InputError, match=r"cameras\.txt:1: .* the models known here"):
        read_colmap(tmp_path)


def test_results_are_read_as_input_again(tmp_path):
    solution = scenes.block()[0].solve()
    (camera,) = read_cameras(_written(tmp_path, "c.csv", camera_table(solution)))
    assert camera.parameters.tolist() == solution.cameras["c"].parameters.tolist()
    _, poses = read_images(_written(tmp_path, "i.csv", pose_table(solution)))
    np.testing.assert_allclose(poses.rotations, solution.poses.rotations, atol=1e-14)
    assert poses.centres.tolist() == solution.poses.centres.tolist()
    assert isinstance(solution.block, BundleAdjustment)


def test_the_cloud_holds_points_and_cameras():
    solution = scenes.block()[0].solve()
    lines = ply(solution).splitlines()
    n, m = len(solution.points), len(solution.poses)
    assert f"element vertex {n + 5 * m}" in lines
    assert f"element edge {8 * m}" in lines
    assert len(lines) == lines.index("end_header") + 1 + n + 13 * m
    first = lines[lines.index("end_header") + 1].split()
    assert [float(value) for value in first[:3]] == solution.coordinates[0].tolist()


@pytest.mark.parametrize("seed", range(4))
def test_mutilated_tables_never_end_in_another_error(tmp_path, seed):
    rng = np.random.default_rng(seed)
    whole = b"name,width,height,focal,K1\nc,2000,1500,1800,-0.1\n"
    for _ in range(60):
        data = bytearray(whole)
        for place in rng.integers(0, len(data), rng.integers(1, 6)):
            data[place] = rng.integers(0, 256)
        path = tmp_path / "f.csv"
        path.write_bytes(bytes(data[: rng.integers(1, len(data) + 1)]))
        try:
            read_cameras(path)
        except InputError as error:
            assert "f.csv" in str(error)


def test_what_is_wrong_in_a_block_of_another_program_names_its_file(bal):
    with pytest.raises(InputError, match=f"^{bal}: the block has no datum"):
        read_bal(bal).solve()
    block = read_bal(bal)
    block.add_approximations(["P0"], [[0.0, 0.0, 50.0]])
    with pytest.raises(InputError, match=f"^{bal}: image .*, point P0: the point is behind the camera"):
        block.solve(datum="centres")
