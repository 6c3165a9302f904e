"""A block of another program, adjusted with control by name, goes back to that program and comes again."""

import sys
from pathlib import Path

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.formats.colmap.reader import read_colmap, write_colmap
from obseq.formats.metashape.reader import read_metashape
from obseq.formats.opensfm.reader import read_opensfm
from obseq.images import Poses
from obseq.project import read_v1_block

sys.path.append(str(Path(__file__).parents[1] / "images"))
import scenes

SCALE, SHIFT = 2.5, np.array([100.0, 200.0, 50.0])
"""From the frame of the other program to that of the control points."""
MARKED = ("P0", "P1", "P2", "P3", "P4")


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A model of COLMAP in a frame of its own, marks of named points, control and check points."""
    folder = tmp_path_factory.mktemp("block")
    block, poses, places = scenes.block(noise=0.3, n_control=0)
    names = list(places)
    block.add_approximations(names, np.array([places[name] for name in names]))
    tie = block.sets[0].measures
    marked = np.array([name in MARKED for name in tie.point_names])[tie.point]
    block.sets[0] = block.sets[0].__class__(tie.rows(~marked), None, "tie points")
    for camera in block.cameras.values():
        block.freeze_parameters("K3|b.", camera.name)
    write_colmap(block.solve(datum="centres"), folder / "sparse")
    marks = tie.rows(marked)
    rows = [
        f"{marks.image_names[i]},{marks.point_names[p]},{x!r},{y!r},0.3"
        for i, p, (x, y) in zip(marks.image, marks.point, marks.xy.tolist(), strict=True)
    ]
    (folder / "marks.csv").write_text("\n".join(["image,point,x,y,sigma", *rows]) + "\n")
    ground = {name: SCALE * places[name] + SHIFT for name in MARKED}
    for file, chosen in (("gcp", MARKED[:4]), ("check", MARKED[4:])):
        lines = [f"{name},{','.join(map(repr, ground[name].tolist()))},0.002" for name in chosen]
        (folder / f"{file}.csv").write_text("\n".join(["point,x,y,z,sigma", *lines]) + "\n")
    wanted = Poses(poses.images, SCALE * poses.centres + SHIFT, poses.rotations, poses.cameras)
    return folder, wanted


def _adjusted(source, *outputs):
    folder, _ = source
    given = ["bundle", f"--colmap={folder / 'sparse'}", f"--measures={folder / 'marks.csv'}"]
    given += [
        f"--control={folder / 'gcp.csv'}",
        f"--check-points={folder / 'check.csv'}",
        "--image-sigma=0.3",
    ]
    return main([*given, *outputs])


def _check_poses(poses, wanted, tolerance=0.05):
    found = poses.select(wanted.images)
    np.testing.assert_allclose(found.centres, wanted.centres, atol=tolerance)
    np.testing.assert_allclose(found.rotations, wanted.rotations, atol=1e-2)


def test_colmap_control_by_name_colmap(source, tmp_path, capsys):
    assert _adjusted(source, f"--colmap-out={tmp_path / 'out'}", "--show", "check-points") == 0
    shown = capsys.readouterr().out
    assert "are moved to the control points" in " ".join(shown.split())
    (check,) = [
        line for line in shown.partition("\nCheck points.")[2].splitlines() if line.startswith("  P4 ")
    ]
    assert check.endswith("as expected")
    again = read_colmap(tmp_path / "out")
    before = read_colmap(source[0] / "sparse")
    assert set(before.approximations) | set(MARKED) == set(again.approximations)
    _check_poses(again.poses, source[1])
    model = (tmp_path / "out" / "cameras.txt").read_text().split()[1]
    assert model == "OPENCV"
    assert main(["bundle", f"--colmap={tmp_path / 'out'}", "--datum=centres"]) in (0, 1)
    assert "NOT CONVERGED" not in capsys.readouterr().out


def test_micmac_v1_there_and_back(source, tmp_path, capsys):
    out = tmp_path / "Ori-Out"
    assert _adjusted(source, f"--micmac-out={out}") == 0
    block = read_v1_block(out, out / "Measures-S2D.xml", out / "Points-S3D.xml", 0.3)
    _check_poses(block.poses, source[1])
    assert set(MARKED) <= set(block.control.names)
    known = [
        name for name, free in zip(block.control.names, block.control.is_free, strict=True) if not free.all()
    ]
    assert set(known) == set(MARKED[:4])
    given = [f"--micmac={out}", f"--micmac-measures={out / 'Measures-S2D.xml'}"]
    given += [f"--micmac-points={out / 'Points-S3D.xml'}", f"--micmac-out={tmp_path / 'Ori-Again'}"]
    capsys.readouterr()
    assert main(["bundle", *given, "--image-sigma=0.3", "--freeze=K3|b."]) == 0
    _check_poses(read_v1_block(tmp_path / "Ori-Again").poses, source[1])
    assert main(["bundle", *given[:3], f"--micmac-out={out}", "--image-sigma=0.3"]) == 2
    assert "Measures-S2D.xml" in capsys.readouterr().err


def test_metashape_there_and_back(source, tmp_path, capsys):
    path = tmp_path / "out.xml"
    assert _adjusted(source, "--freeze=b1", f"--metashape-out={path}") == 0
    block, frame = read_metashape(path)
    assert frame == "LocalNONE"
    _check_poses(block.poses, source[1])
    assert set(block.control.names) == set(MARKED[:4])
    np.testing.assert_allclose(block.control.sigmas, 0.002)
    marks = block.sets[0].measures
    assert set(MARKED) < set(marks.point_names)  # the others have names too, in comments of the model
    assert len(marks.of_points(MARKED)) == 40
    given = ["bundle", f"--metashape={path}", "--freeze=.*", f"--metashape-out={tmp_path / 'again.xml'}"]
    assert main(given) in (0, 1)
    _check_poses(read_metashape(tmp_path / "again.xml")[0].poses, source[1])


def test_opensfm_and_mmvii(source, tmp_path):
    outputs = f"--opensfm-out={tmp_path / 'osfm'}", f"--mmvii-out={tmp_path / 'mmvii'}"
    assert _adjusted(source, "--freeze=b1", *outputs) == 0
    block = read_opensfm(tmp_path / "osfm")
    _check_poses(block.poses, source[1])
    assert set(MARKED) <= set(block.approximations)
    from obseq.project.cameras import read_orientation
    from obseq.project.points import read_control_points

    tree = tmp_path / "mmvii" / "MMVII-PhgrProj"
    poses, cameras = read_orientation(tree / "Ori" / "Obseq")
    _check_poses(poses, source[1])
    assert set(cameras) == {"camera 1"}
    points = read_control_points(tree / "ObjCoordWorld" / "Obseq")
    assert set(MARKED) <= set(points.names)
    assert len(list((tree / "ObjMesInstr" / "Obseq").glob("MesIm-*.xml"))) == 8


def test_what_a_format_cannot_hold_is_refused_before_the_work(source, tmp_path, capsys):
    assert _adjusted(source, "--free=K3", f"--micmac-out={tmp_path / 'Ori-X'}") == 0
    assert _adjusted(source, "--free=b1", f"--opensfm-out={tmp_path / 'x'}") == 2
    assert "OpenSfM has no place for b1" in capsys.readouterr().err
