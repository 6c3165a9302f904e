import csv
import io
import json

import numpy as np
import pytest

from obseq.cli.main import main

SHOTS = """N X Y H O P K C
A 700000 6600000 1500 0 0 0 cam
B 700400 6600000 1500 0 0 0 cam
C 700200 6600300 1500 0 0 90 cam
"""
CAMERA = "name = cam\nppax = 500\nppay = 400\nfocal = 1000\nwidth = 1000\nheight = 800\n"
GROUND = """P 3 700200 6600100 10
Q 3 700050 6599900 0
R 3 700360 6600250 60
S 3 700000 6600180 -45
T 3 700400 6599950 20
U 3 700200 6600200 90
far 3 0 0 0
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "shots.opk").write_text(SHOTS)
    (tmp_path / "cam.txt").write_text(CAMERA)
    (tmp_path / "ground.app").write_text(GROUND)
    monkeypatch.chdir(tmp_path)
    return tmp_path


SITE = "--shots shots.opk --shots-header NXYHOPKC --no-alteration --cameras cam.txt --crs EPSG:2154".split()


def rows(text):
    return list(csv.DictReader(io.StringIO(text)))


def projected(folder, capsys):
    """The measures of the ground points in all images that have them."""
    code = main(["world-image", *SITE, "--ground", "ground.app", "--ground-header", "PTXYH"])
    out = capsys.readouterr()
    assert code == 1
    assert "left out: far: no image sees it" in out.err
    found = rows(out.out)
    text = "".join(f"{r['point']} {r['shot']} {r['column']} {r['line']}\n" for r in found)
    (folder / "measured.mes").write_text(text)
    return found


def test_what_is_projected_is_intersected_and_resected(folder, capsys):
    seen = projected(folder, capsys)
    assert {(r["point"], r["shot"]) for r in seen} >= {("P", "A"), ("P", "B"), ("P", "C")}
    for method in ("pair", "all"):
        assert main(["intersect", *SITE, "--points", "measured.mes", "--method", method]) == 0
        found = {r["point"]: r for r in rows(capsys.readouterr().out)}
        for line in GROUND.splitlines()[:6]:
            name, _, *place = line.split()
            computed = [float(found[name][axis]) for axis in "xyz"]
            np.testing.assert_allclose(computed, np.array(place, dtype=float), rtol=0.0, atol=2e-3)
    command = "resect --cameras cam.txt --crs EPSG:2154 --points measured.mes --ground ground.app"
    options = "--ground-header PTXYH --opk again.opk --out poses.csv"
    assert main([*command.split(), *options.split()]) == 0
    assert (folder / "again.opk").read_text().splitlines()[0] == "N   X   Y   H   O   P   K   C"
    pose = {r["shot"]: r for r in rows((folder / "poses.csv").read_text())}["C"]
    assert float(pose["kappa"]) == pytest.approx(90.0, abs=1e-3)
    assert float(pose["z"]) == pytest.approx(1500.0, abs=0.05)


def with_noise(folder, sigma, wrong=None):
    """Gives the measures noise, and one column an error of 40 pixels."""
    noise = np.random.default_rng(3)
    lines = []
    for line in (folder / "measured.mes").read_text().splitlines():
        point, shot, *pixel = line.split()
        column, row = np.array(pixel, dtype=float) + noise.normal(0.0, sigma, 2)
        row += 40.0 * ((point, shot) == wrong)
        lines.append(f"{point} {shot} {column} {row}\n")
    (folder / "noisy.mes").write_text("".join(lines))


@pytest.mark.parametrize("method", ["pair", "all"])
def test_intersections_are_judged(folder, capsys, method):
    projected(folder, capsys)
    command = ["intersect", *SITE, "--points", "noisy.mes", "--method", method]
    with_noise(folder, 0.5)
    assert main([*command, "--sigma", "0.5"]) == 0
    shown = capsys.readouterr()
    assert "what --sigma announces: GOOD" in shown.err
    sigmas0 = [float(row["sigma0"]) for row in rows(shown.out)]
    assert 0.3 < np.sqrt(np.mean(np.square(sigmas0))) < 2.0
    assert main([*command, "--sigma", "0.05"]) == 1
    assert "TOO LARGE: look at orientations" in capsys.readouterr().err
    with_noise(folder, 0.5, wrong=("P", "A"))
    assert main([*command, "--sigma", "0.5"]) == 1
    said = capsys.readouterr().err
    assert "a gross error is suspected: point P (" in said


def test_image_points_go_to_the_ground_and_to_a_map(folder, capsys):
    (folder / "m.mes").write_text("P A 500 400\n# comment\nQ Z 1 2\nP A 1 2\nR B x 3\n")
    command = ["image-world", *SITE, "--points", "m.mes", "--height", "10", "--z-type", "height"]
    assert main([*command, "--out", "ground.geojson"]) == 1
    said = capsys.readouterr().err
    assert "m.mes:3: shot Z is unknown" in said
    assert "m.mes:4: P A was given before, in line 1" in said
    assert "m.mes:5: 'x' is not a number" in said
    (feature,) = json.loads((folder / "ground.geojson").read_text())["features"]
    assert feature["properties"]["z"] == pytest.approx(10.0, abs=1e-6)
    assert feature["geometry"]["coordinates"] == pytest.approx([3.0, 46.5], abs=1e-3)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--crs", "EPSG:4326"], "not a projected system"),
        (["--geoid", "nothing_here"], "geoid grid nothing_here"),
        (["--dtm", "absent.asc"], "no such terrain model"),
        (["--out", "x.xlsx"], "as .csv or .geojson"),
        (["--shots", "cam.txt"], "shot"),
    ],
)
def test_what_cannot_run_says_why(folder, capsys, options, reason):
    (folder / "m.mes").write_text("P A 500 400\n")
    command = ["image-world", *SITE, "--points", "m.mes", *options]
    command += [] if "--dtm" in options else ["--height", "0"]
    code = main(command)
    err = capsys.readouterr().err
    if "cam.txt" in options and code != 2:
        assert code == 1
        assert "columns" in err
    else:
        assert code == 2
        assert reason in err
    assert not (folder / "x.xlsx").exists()


def test_the_ground_must_be_given_once(folder, capsys):
    (folder / "m.mes").write_text("P A 500 400\n")
    assert main(["image-world", *SITE, "--points", "m.mes"]) == 2
    assert "one of them" in capsys.readouterr().err


def test_two_cameras_are_resected_and_intersected(folder, capsys):
    name = "cam"
    (folder / "other.txt").write_text(CAMERA.replace(name, "other", 1))
    (folder / "shots.opk").write_text(SHOTS.replace("1500 0 0 0 cam\nC", "1500 0 0 0 other\nC"))
    site = [*SITE[: SITE.index("cam.txt") + 1], "other.txt", *SITE[SITE.index("cam.txt") + 1 :]]
    given = ["--ground", "ground.app", "--ground-header", "PTXYH", "--out", "seen.csv"]
    assert main(["world-image", *site, *given]) == 1  # one point is in no image
    seen = rows((folder / "seen.csv").read_text())
    measured = "".join(f"{r['point']} {r['shot']} {r['column']} {r['line']}\n" for r in seen)
    (folder / "measured.mes").write_text(measured)
    capsys.readouterr()
    assert main(["intersect", *site, "--points", "measured.mes"]) == 0
    command = "resect --cameras cam.txt other.txt --crs EPSG:2154 --points measured.mes --ground ground.app"
    command += " --ground-header PTXYH --opk again.opk --out poses.csv"
    assert main(command.split()) == 2
    assert "say which of the 2 cameras took each shot" in capsys.readouterr().err
    shots = list(dict.fromkeys(r["shot"] for r in seen))
    table = [f"{shot},{'other' if shot == 'B' else name}" for shot in shots]
    (folder / "of.csv").write_text("\n".join(["image,camera", *table]) + "\n")
    assert main([*command.split(), "--camera-of", "of.csv"]) == 0
    cameras = {r.split()[0]: r.split()[-1] for r in (folder / "again.opk").read_text().splitlines()[1:]}
    assert cameras == {shot: "other" if shot == "B" else name for shot in shots}
    (folder / "of.csv").write_text("\n".join(["image,camera", *table[1:]]) + "\n")
    assert main([*command.split(), "--camera-of", "of.csv"]) == 2
    assert f"no row says which camera took {shots[0]}" in capsys.readouterr().err


def test_images_outside_the_area_of_the_map_are_said(folder, capsys):
    projected(folder, capsys)
    (folder / "far.opk").write_text(SHOTS.replace(" 66", " 6"))
    command = ["intersect", *SITE, "--points", "measured.mes"]
    main(command)
    assert "outside" not in capsys.readouterr().err
    main([*command, "--shots", "far.opk"])
    assert "warning: far.opk: A" in capsys.readouterr().err
