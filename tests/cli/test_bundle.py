"""`obseq bundle`: from tables to results, and its exit codes."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.formats.opk.reader import opk_text, read_opk
from obseq.images import BundleAdjustment

sys.path.insert(0, str(Path(__file__).parents[1] / "images"))
import scenes


@pytest.fixture
def tables(tmp_path):
    """A ring of eight images as tables, without poses."""
    poses, points = scenes.ring()
    names = [f"P{k}" for k in range(len(points))]
    measures = scenes.measured(poses, points, names, 0.5)
    rows = [
        f"{measures.image_names[i]},{measures.point_names[p]},{x},{y}"
        for i, p, (x, y) in zip(measures.image, measures.point, measures.xy, strict=True)
    ]
    control = [
        f"{name},{','.join(map(str, xyz))},0.001" for name, xyz in zip(names[:6], points, strict=False)
    ]
    texts = {
        "cameras": ["name,width,height,focal,K1,K2,p1", "c,2000,1500,1790,-0.08,0.02,0.001"],
        "images": ["image,camera", *(f"{image},c" for image in poses.images)],
        "control": ["point,x,y,z,sigma", *control],
        "measures": ["image,point,x,y", *rows],
    }
    for name, lines in texts.items():
        (tmp_path / f"{name}.csv").write_text("\n".join(lines) + "\n")
    options = [f"--{name}={tmp_path / name}.csv" for name in texts]
    return tmp_path, [*options, "--image-sigma=0.5", "--freeze=K.|p.|b."], poses


def test_a_block_goes_from_tables_to_results(tables, capsys):
    folder, options, poses = tables
    assert main(["bundle", *options, f"--out={folder / 'out'}"]) == 0
    shown = capsys.readouterr().out
    assert "The block is sound" in shown
    assert "Parameters of cameras. c: " in (folder / "out/bundle.txt").read_text()
    record = json.loads((folder / "out/bundle.json").read_text())
    assert (record["format"], record["version"], len(record["images"])) == ("obseq-bundle", 6, 8)
    found = np.array([image["centre"] for image in record["images"]])
    sigmas = np.array([image["centre_sigmas"] for image in record["images"]])
    assert (np.abs(found - poses.centres) < 5.0 * sigmas).all()
    assert record["cameras"][0]["parameters"][0]["value"] == pytest.approx(1800.0, abs=2.0)
    names = {
        "bundle.json",
        "bundle.html",
        "bundle.txt",
        "block.ply",
        "poses.csv",
        "cameras.csv",
        "points.csv",
    }
    assert {path.name for path in (folder / "out").iterdir()} == names


def test_a_quiet_block_is_a_sentence(tables, capsys):
    assert main(["bundle", *tables[1], "-q"]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("The block is sound")


def test_a_blunder_makes_sigma0_too_large_and_is_said(tables, capsys):
    folder, options, _ = tables
    assert main(["bundle", *options, f"--json={folder / 'good.json'}"]) == 0
    assert json.loads((folder / "good.json").read_text())["global_test"]["passed"]
    lines = (folder / "measures.csv").read_text().splitlines()
    image, point, x, y = lines[40].split(",")
    lines[40] = f"{image},{point},{float(x) + 60.0},{y}"
    (folder / "measures.csv").write_text("\n".join(lines) + "\n")
    capsys.readouterr()
    main(["bundle", *options, "--show", "residuals"])
    shown = capsys.readouterr().out
    assert "too large" in next(line for line in shown.splitlines() if line.startswith("  sigma0"))
    assert shown.partition("Image points.")[2].splitlines()[3].split()[:2] == [image, point]


def with_shift(path, row, column, shift):
    """Adds to one number of a table."""
    lines = path.read_text().splitlines()
    cells = lines[row].split(",")
    cells[column] = str(float(cells[column]) + shift)
    path.write_text("\n".join([*lines[:row], ",".join(cells), *lines[row + 1 :]]) + "\n")
    return cells


def suspect_of(options, capsys, *more):
    """Exit code, and what is printed of suspects; all of it without any."""
    capsys.readouterr()
    code = main(["bundle", *options, *more])
    told = " ".join(capsys.readouterr().out.split())
    return code, told.partition("Suspected errors ")[2].partition(": ")[2] or told


def test_a_wrong_pixel_is_the_suspect_with_its_size(tables, capsys):
    folder, options, _ = tables
    image, point, *_ = with_shift(folder / "measures.csv", 40, 2, 14.0)
    code, first = suspect_of(options, capsys)
    assert code == 1
    assert first.startswith(f"image {image}, point {point} (T ") and "): Off by (+1" in first


def test_a_wrong_control_coordinate_is_the_suspect(tables, capsys):
    folder, options, _ = tables
    with_shift(folder / "control.csv", 3, 2, 0.05)
    code, first = suspect_of(options, capsys)
    assert code == 1
    assert first.startswith("y of control point P2 (T ") and "): Off by +0.0" in first


def test_a_wrong_scale_bar_is_the_suspect_and_a_right_one_is_none(tables, capsys):
    folder, options, _ = tables
    truth = scenes.ring()[1]
    length = float(np.linalg.norm(truth[10] - truth[12]))
    bars = folder / "lengths.csv"
    bars.write_text(f"from,to,length,sigma\nP10,P12,{length},0.005\n")
    code, first = suspect_of(options, capsys, f"--lengths={bars}")
    assert code == 0
    assert "no error is suspected" in first
    with_shift(bars, 1, 2, 0.2)
    code, first = suspect_of(options, capsys, f"--lengths={bars}")
    assert code == 1
    assert first.startswith("length P10 to P12 (T ") and "): Off by +0." in first


def test_a_wrong_survey_distance_is_the_suspect_with_its_line(tables, capsys):
    folder, options, _ = tables
    truth = scenes.ring()[1]
    length = float(np.linalg.norm(truth[10] - truth[12])) + 0.2
    (folder / "d.obs").write_text(f"3 P10 P12 {length} 0.005\n")
    places = (f"0 P{k} {' '.join(map(str, truth[k]))}\n" for k in (10, 12))
    (folder / "p.cor").write_text("".join(places))
    more = [f"--obs={folder / 'd.obs'}", f"--cor={folder / 'p.cor'}"]
    code, first = suspect_of(options, capsys, *more)
    assert code == 1
    assert "P10 -> P12" in first
    assert "P10 -> P12 (d.obs:1)" in first and "Off by 0." in first


def test_sigmas_that_are_all_too_small_make_no_suspect(tables, capsys):
    folder, options, _ = tables
    code, first = suspect_of([*options, "--image-sigma=0.25", f"--json={folder / 'r.json'}"], capsys)
    assert code == 1  # as `obseq adjust` does: the overall test rejects, whatever is accused
    assert first.startswith("Image block: 8 images, 1 camera")
    assert json.loads((folder / "r.json").read_text())["global_test"]["passed"] is False


def test_sigmas_of_which_most_measures_say_otherwise_are_no_success(tables, capsys):
    code, first = suspect_of([*tables[1], "--image-sigma=0.05"], capsys)
    assert code == 1
    assert "the result is not to be trusted: half of the image coordinates or more are rejected" in first


def test_blunders_in_a_block_with_robust_weights_are_all_named(tables, capsys):
    folder, options, _ = tables
    robust = [*options, "--attenuation=1", f"--json={folder / 'r.json'}", f"--html={folder / 'r.html'}"]
    assert suspect_of(robust, capsys)[0] == 0
    assert "no error is suspected" in (folder / "r.html").read_text()
    planted = [with_shift(folder / "measures.csv", row, 2, shift)[:2] for row, shift in ((40, 14), (90, -25))]
    code, first = suspect_of(robust, capsys)
    assert code == 1
    record, page = json.loads((folder / "r.json").read_text()), (folder / "r.html").read_text()
    tests, accused = record["reliability"]["largest"], record["diagnosis"]["accused"]
    assert {one["what"] for one in accused} == {f"image {image}, point {point}" for image, point in planted}
    assert sorted(np.sign(one["size"][0]) for one in accused) == [-1.0, 1.0]
    assert first.startswith("image ") and "Off by" in first and tests["robust"]
    assert max(item["weight"] for item in tests["largest"][:2]) < 0.2
    for item in tests["largest"][:2]:
        measure = record["measures"][item["row"]]
        assert f"image {measure['image']}, point {measure['point']} x" in item["name"]
    assert "Not usable yet: 2 errors are suspected" in page
    assert page.count('"level":"bad"') == 3  # the verdict, and a finding for each


def test_robust_weights_with_sigmas_that_are_too_small_suspect_nothing(tables, capsys):
    _, options, _ = tables
    code, first = suspect_of([*options, "--image-sigma=0.1", "--attenuation=0.5"], capsys)
    assert code == 0
    assert first.startswith("Image block: 8 images, 1 camera")


def test_a_wrong_control_coordinate_is_named_beside_robust_weights(tables, capsys):
    folder, options, _ = tables
    with_shift(folder / "control.csv", 3, 2, 0.05)
    code, first = suspect_of([*options, "--attenuation=1"], capsys)
    assert code == 1
    assert first.startswith("y of control point P2 (T ") and "): Off by +0.0" in first


def test_control_points_in_no_image_are_named_and_change_nothing(tables, capsys):
    folder, options, _ = tables
    with (folder / "control.csv").open("a") as file:
        file.writelines(f"far{k},{k},0,0,0.01\n" for k in range(6))
    results = [f"--json={folder / 'r.json'}", f"--html={folder / 'r.html'}"]
    assert main(["bundle", *options, *results]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "Changes nothing: 6 control points: far0, far1, far2, far3, far4, far5: it is in no image" in shown
    named = [item["name"] for item in json.loads((folder / "r.json").read_text())["unmeasured"]]
    assert named == [f"far{k}" for k in range(6)]
    assert "Changes nothing: 6 " in (folder / "r.html").read_text()


def test_a_datum_whose_names_are_spelt_otherwise_is_told_so(tables, capsys):
    folder, options, poses = tables
    (folder / "control.csv").write_text((folder / "control.csv").read_text().replace("\nP", "\np"))
    (folder / "images.txt").write_text(opk_text(poses))
    words = [word for word in options if not word.startswith("--images")]
    assert main(["bundle", *words, f"--opk={folder / 'images.txt'}"]) == 2
    assert (
        "6 control points are in no image: p0, p1, p2; names count with their case" in capsys.readouterr().err
    )


def test_a_held_focal_length_is_told_beside_a_single_error(tables, capsys):
    folder, options, _ = tables
    text = (folder / "cameras.csv").read_text()
    (folder / "cameras.csv").write_text(text.replace(",1790,", ",1700,"))
    image, point, *_ = with_shift(folder / "measures.csv", 40, 2, 300.0)
    assert main(["bundle", *options, "--freeze=.*"]) == 1
    shown = " ".join(capsys.readouterr().out.split())
    assert f"image {image}, point {point} (T " in shown and "Off by (+300" in shown
    assert "F of camera c (T " in shown and "Off by -" in shown


def test_lines_counted_upwards_are_the_first_word(tables, capsys):
    folder, options, poses = tables
    values = np.hstack([poses.centres, np.degrees(poses.attitudes("opk"))])
    lines = [f"{image},c,{','.join(map(str, row))}" for image, row in zip(poses.images, values, strict=True)]
    (folder / "images.csv").write_text("\n".join(["image,camera,x,y,z,omega,phi,kappa", *lines]) + "\n")
    head, *rows = (folder / "measures.csv").read_text().splitlines()
    turned = [f"{start},{1500.0 - float(y)}" for start, _, y in (row.rpartition(",") for row in rows)]
    (folder / "measures.csv").write_text("\n".join([head, *turned]) + "\n")
    code, first = suspect_of([*options, f"--json={folder / 'b.json'}"], capsys)
    assert code == 1
    assert "counted upwards (y goes down here)" in first
    assert "counted upwards" in (folder / "b.json").read_text()


def test_points_measured_once_are_counted_by_their_reason(tables, capsys):
    folder, options, _ = tables
    with (folder / "measures.csv").open("a") as file:
        file.writelines(f"i0,once{k},{1000 + k},700\n" for k in range(30))
    with (folder / "images.csv").open("a") as file:
        file.write("spare,c\n")
    assert main(["bundle", *options, "--show", "without"]) == 1
    shown = capsys.readouterr().out
    assert "Without part (31)" in shown
    assert "once0, once1, once2, once3 and 26 more  it has 1 ray; a free point takes 2" in shown
    assert "Left out: 30 " in shown
    assert "spare" in shown


def test_what_is_left_out_is_named_and_makes_the_exit_code_1(tables, capsys):
    folder, options, _ = tables
    with (folder / "measures.csv").open("a") as file:
        file.write("i0,once,1000,700\n")
    assert main(["bundle", *options]) == 1
    assert "once" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (["--measures=nowhere.csv"], "nowhere.csv: there is no such file"),
        (["--freeze=Q9"], "no camera parameter matches 'Q9'"),
        (["--bal=b.txt"], "the block is given 2 times: --bal, tables (--cameras ...); give one"),
        (["--readout=0"], "--readout goes with --positions"),
        (["--chunk=A"], "--chunk goes with --metashape"),
        (["--frame=RTL"], "--frame goes with --obs or --control-crs or --positions-crs"),
        (["--obs=a.obs"], "--obs and --cor go together"),
        (["--json=."], "is a folder"),
        (["--bal-out=b.txt"], "BAL has no place for p1 of a camera, not zero here: give 0"),
        (
            ["--colmap-out=sparse", "--freeze=K1"],
            "COLMAP has no place for K3 of a camera, unknown here: give 0",
        ),
        (["--opk-out=p.txt", "--text=p.txt"], "two results cannot be written to the same file"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(tables, capsys, monkeypatch, change, message):
    folder, options, _ = tables
    monkeypatch.chdir(folder)
    monkeypatch.setattr(BundleAdjustment, "initialise", None)  # all of it is said before the work
    assert main(["bundle", *options, *change]) == 2
    said = capsys.readouterr()
    assert message in said.err
    assert said.err.count("\n") == 1
    assert not said.out


def test_lengths_and_positions_are_observations(tables, capsys):
    folder, options, poses = tables
    (folder / "control.csv").write_text("point,x,y,z,sigma\nP0,0,0,0,\n")
    truth = scenes.ring()[1]
    length = float(np.linalg.norm(truth[1] - truth[2]))
    (folder / "lengths.csv").write_text(f"from,to,length,sigma\nP1,P2,{length},0.0005\n")
    rows = [f"{i} {x} {y} {z} 0.01" for i, (x, y, z) in zip(poses.images, poses.centres, strict=True)]
    (folder / "positions.txt").write_text("image x y z sigma\n" + "\n".join(rows) + "\n")
    (folder / "images.txt").write_text(opk_text(poses))
    more = [f"--lengths={folder / 'lengths.csv'}", f"--positions={folder / 'positions.txt'}"]
    words = [word for word in options if not word.startswith(("--images", "--control"))]
    words += [f"--opk={folder / 'images.txt'}", *more, f"--json={folder / 'r.json'}"]
    assert main(["bundle", *words]) == 0
    record = json.loads((folder / "r.json").read_text())
    assert {"lengths", "observed poses"} <= record["squares"].keys()
    found = {point["name"]: [point[axis] for axis in "xyz"] for point in record["points"]}
    assert np.linalg.norm(np.subtract(found["P1"], found["P2"])) == pytest.approx(length, abs=0.002)
    assert "NOT CONVERGED" not in capsys.readouterr().out


def test_what_is_held_and_freed_is_told(tables, capsys):
    folder, options, _ = tables
    main(["bundle", *options, "--freeze=K.", "--free=K1", "--verbose", f"--opk-out={folder / 'p.txt'}"])
    said = capsys.readouterr().out
    assert "unknown, since --free comes after --freeze: K1 of" in " ".join(said.split())
    assert said.splitlines()[-1] == f"Written: {folder / 'p.txt'}"


def test_results_in_other_formats_are_blocks_again(tables, capsys):
    folder, options, poses = tables
    words = [word if not word.startswith("--freeze") else "--freeze=K3|b." for word in options]
    outs = [f"--colmap-out={folder / 'sparse'}", f"--opk-out={folder / 'poses.txt'}"]
    assert main(["bundle", *words, *outs]) == 0
    again = ["bundle", f"--colmap={folder / 'sparse'}", "--datum=centres", "--freeze=.*"]
    assert main([*again, f"--json={folder / 'r.json'}"]) == 0
    record = json.loads((folder / "r.json").read_text())
    centres = read_opk(folder / "poses.txt").centres
    sigma0 = record["sigma0"]
    assert main([*again, f"--json={folder / 'half.json'}", "--image-sigma=0.5"]) in (0, 1)
    half = json.loads((folder / "half.json").read_text())
    assert half["sigma0"] == pytest.approx(
        2.0 * sigma0, rel=1e-6
    )  # the file says no sigma: one pixel, or this
    # the free block of the same measures, without what the control points said
    np.testing.assert_allclose([image["centre"] for image in record["images"]], centres, atol=0.02)
    assert np.abs(centres - poses.centres).max() < 0.05


def test_two_control_points_are_too_few_and_their_file_is_named(tables, capsys):
    folder, options, _ = tables
    lines = (folder / "control.csv").read_text().splitlines()
    (folder / "control.csv").write_text("\n".join(lines[:3]) + "\n")
    assert main(["bundle", *options]) == 2
    said = capsys.readouterr().err
    assert f"{folder / 'control.csv'}: the images are placed by one another" in said
    assert "there are 2; give and measure three that are not on a line" in said


def test_angles_in_another_unit_are_told(tables, capsys):
    folder, options, poses = tables
    rows = np.hstack([poses.centres, poses.attitudes("opk") * 200.0 / np.pi]).tolist()
    lines = [f"{name} {' '.join(map(str, row))}" for name, row in zip(poses.images, rows, strict=True)]
    (folder / "gon.txt").write_text("\n".join(lines) + "\n")
    words = [word for word in options if not word.startswith("--images=")] + [f"--opk={folder / 'gon.txt'}"]
    assert main(["bundle", *words]) == 2
    said = capsys.readouterr().err
    assert (
        f"{folder / 'gon.txt'}: known points are where they were measured when the angles are in gon" in said
    )
    assert "give --opk-unit gon" in said
    assert main(["bundle", *words, "--opk-unit=gon"]) == 0


@pytest.mark.parametrize("strategy", ["controlled", "gauss-newton", "dogleg", "qr"])
def test_a_strategy_and_a_tolerance_lead_to_the_same_solution(tables, strategy):
    folder, options, _ = tables
    assert main(["bundle", *options, f"--json={folder / 'usual.json'}"]) == 0
    chosen = [f"--strategy={strategy}", "--tolerance=1e-9", f"--json={folder / 'chosen.json'}"]
    assert main(["bundle", *options, *chosen]) == 0
    usual, found = (json.loads((folder / f"{name}.json").read_text()) for name in ("usual", "chosen"))
    assert found["sigma0"] == pytest.approx(usual["sigma0"], rel=1e-10)
    for one, other in zip(usual["images"], found["images"], strict=True):
        np.testing.assert_allclose(other["centre"], one["centre"], atol=1e-7)


def test_a_tolerance_ends_the_iterations(tables):
    folder, options, _ = tables
    counts = []
    for tolerance in ("3", "1e-9"):
        main(["bundle", *options, f"--tolerance={tolerance}", f"--json={folder / 'r.json'}"])
        counts.append(len(json.loads((folder / "r.json").read_text())["iterations"]))
    assert counts[0] < counts[1]
