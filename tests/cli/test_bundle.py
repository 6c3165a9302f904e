"""`obseq bundle`: from tables to results, and its exit codes."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from obseq.cli.main import main

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
    assert "converged after" in shown
    assert "Camera c (" in shown
    record = json.loads((folder / "out/bundle.json").read_text())
    assert (record["format"], record["version"], len(record["images"])) == ("obseq-bundle", 1, 8)
    found = np.array([image["centre"] for image in record["images"]])
    sigmas = np.array([image["centre_sigmas"] for image in record["images"]])
    assert (np.abs(found - poses.centres) < 5.0 * sigmas).all()
    assert record["cameras"][0]["parameters"][0]["value"] == pytest.approx(1800.0, abs=2.0)
    names = {"bundle.json", "bundle.txt", "block.ply", "poses.csv", "cameras.csv", "points.csv"}
    assert {path.name for path in (folder / "out").iterdir()} == names


def test_what_is_left_out_is_named_and_makes_the_exit_code_1(tables, capsys):
    folder, options, _ = tables
    with (folder / "measures.csv").open("a") as file:
        file.write("i0,once,1000,700\n")
    assert main(["bundle", *options]) == 1
    assert "once" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (["--measures=nowhere.csv"], "nowhere.csv: No such file"),
        (["--freeze=Q9"], "no camera parameter matches 'Q9'"),
        (["--bal=b.txt"], "say where the block is"),
        (["--obs=a.obs"], "--obs and --cor go together"),
        (["--json=."], "is a folder"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(tables, capsys, change, message):
    _, options, _ = tables
    assert main(["bundle", *options, *change]) == 2
    said = capsys.readouterr()
    assert message in said.err
    assert said.err.count("\n") == 1
    assert not said.out
