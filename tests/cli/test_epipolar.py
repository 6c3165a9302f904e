import numpy as np
import pytest

from obseq.cli.main import main
from obseq.geometry import exponential
from obseq.images import Camera, Poses
from obseq.images.epipolar import OrientedCamera
from obseq.project import pairs_text, write_orientation

CAMERA = Camera("Calib", 6000, 4000, focal=5000.0, distortion={"K1": -0.05})
POSES = Poses.of(
    ["a.tif", "b.tif"],
    [[0.0, 0.0, 0.0], [100.0, 2.0, 1.0]],
    [np.eye(3), exponential(np.array([0.01, -0.05, 0.02]))],
    cameras="Calib",
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    write_orientation(tmp_path / "Ori", POSES, {"Calib": CAMERA})
    rng = np.random.default_rng(6)
    scene = rng.uniform([-200, -200, 900], [300, 200, 1100], (120, 3))
    first, second = (OrientedCamera(CAMERA, POSES[image]).project(scene) for image in POSES)
    (tmp_path / "TieP" / "a.tif").mkdir(parents=True)
    pairs = np.hstack([first, second + rng.normal(0, 0.3, second.shape)])
    (tmp_path / "TieP" / "a.tif" / "b.tif.csv").write_text(pairs_text(pairs))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_pair_of_a_project_is_checked(folder, capsys):
    assert main("epipolar a.tif b.tif --orientation Ori --ties TieP --out check".split()) == 0
    text = capsys.readouterr().out
    median = float(text.split("Res[50.000000]=")[1].split()[0])
    assert 0.05 < median < 0.2
    names = sorted(path.name for path in (folder / "check").iterdir())
    assert names == [
        *(f"fit-degree-{degree}.ply" for degree in range(6)),
        "percentiles.txt",
        "residuals.csv",
        "residuals.html",
        "residuals.ply",
    ]
    assert text.startswith("Standard deviation of 120 residuals: 0.1")
    assert "expected of the measures: 0.354 px.\nGOOD: " in text
    assert text.endswith("\n\n" + (folder / "check" / "percentiles.txt").read_text())
    table = np.loadtxt(folder / "check" / "residuals.csv", delimiter=",", skiprows=1)
    assert table.shape == (120, 8)
    assert (folder / "check" / "residuals.ply").read_bytes().startswith(b"ply\nformat binary_little_endian")


def test_residuals_that_are_too_large_are_judged_poor(folder, capsys):
    command = "epipolar a.tif b.tif --orientation Ori --ties TieP --tie-sigma 0.05".split()
    assert main(command) == 1
    assert "POOR: 4" in (shown := capsys.readouterr().out) and "no pattern explains it" in shown
    turned = Poses.of(
        list(POSES.images),
        POSES.centres,
        [POSES.rotations[0], POSES.rotations[1] @ exponential(np.array([0.0, 0.0, 2e-3]))],
        cameras="Calib",
    )
    write_orientation(folder / "Ori", turned, {"Calib": CAMERA})
    assert main(command[:7]) == 1
    assert "POOR: " in (shown := capsys.readouterr().out) and "mostly a pattern over the image" in shown


def test_points_without_residual_are_counted(folder, capsys):
    (folder / "t.csv").write_text("3000 2000 2000 2000\n3000 2000 4500 2000\n3100 2000 2100 2003\n")
    assert main("epipolar a.tif b.tif --orientation Ori --ties t.csv --degree 1".split()) == 1
    shown = capsys.readouterr().out
    assert "of 3 points have no residual" in shown
    assert "  pair 2, (3000.00, 2000.00) with (4500.00, 2000.00)\n" in shown


def test_mismatches_are_named_and_make_the_exit_code_1(folder, capsys):
    path = folder / "TieP" / "a.tif" / "b.tif.csv"
    lines = path.read_text().splitlines()
    x1, y1, x2, y2 = map(float, lines[8].split(","))
    lines[8] = f"{x1},{y1},{x2},{y2 + 60.0}"
    path.write_text("\n".join(lines) + "\n")
    assert main("epipolar a.tif b.tif --orientation Ori --ties TieP --out check".split()) == 1
    shown = capsys.readouterr().out
    assert "GOOD" in shown
    assert "1 point is far beyond the others: mismatches, or gross errors.\n  pair 8, (" in shown
    assert f"pair 8, ({x1:.2f}, {y1:.2f})" in (folder / "check/residuals.html").read_text()


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ("a.tif c.tif --orientation Ori --ties TieP", "no tie points of a.tif and c.tif"),
        ("a.tif b.tif --orientation None --ties TieP", "no pose of the image a.tif"),
        ("a.tif b.tif --orientation Ori --ties absent", "there is no such file; check the path"),
        ("a.tif b.tif --orientation Ori --ties TieP --degree 9", "highest degree is 5"),
    ],
)
def test_what_cannot_run_says_why(folder, capsys, command, reason):
    assert main(["epipolar", *command.split()]) == 2
    assert reason in capsys.readouterr().err
