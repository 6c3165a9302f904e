"""`obseq bundle` and the world: control in a system, check points, positions with a lever arm."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from obseq import crs
from obseq.cli.main import main
from obseq.report import formats

sys.path.append(str(Path(__file__).parents[1] / "images"))
import flights

SYSTEM = "EPSG:2154"
ORIGIN = np.array([700000.0, 6600000.0, 300.0])


@pytest.fixture(scope="module")
def made():
    return flights.flight()


@pytest.fixture
def tables(made, tmp_path):
    """The flight as tables: poses in a frame of their own, everything known in Lambert 93."""
    block = made.block
    frame = crs.rtl_at(ORIGIN, crs.parse(SYSTEM))
    to_map = crs.Transformer(frame, crs.parse(SYSTEM)).forward
    angles = np.degrees(block.poses.attitudes("opk"))
    (tmp_path / "cameras.csv").write_text(
        "name,width,height,focal,K1,K2,K3,p1,p2,b1,b2\nc,4000,3000,3010,0,0,0,0,0,0,0\n"
    )
    _write(tmp_path / "images.csv", "image,camera,x,y,z,omega,phi,kappa", [
        (image, "c", *centre, *angle)
        for image, centre, angle in zip(block.poses.images, block.poses.centres, angles, strict=True)
    ])  # fmt: skip
    measures = block.sets[0].measures
    _write(tmp_path / "measures.csv", "image,point,x,y,sigma", [
        (measures.image_names[i], measures.point_names[p], x, y, 0.5)
        for i, p, (x, y) in zip(measures.image, measures.point, measures.xy, strict=True)
    ])  # fmt: skip
    for name, control in (("control", block.control), ("check", block.check_points)):
        rows = zip(control.names, to_map(control.coordinates), strict=True)
        _write(tmp_path / f"{name}.csv", "point,x,y,z,sigma", [(point, *xyz, 0.01) for point, xyz in rows])
    antenna = block.antennas[0]
    rows = zip(antenna.images, to_map(antenna.positions), made.velocities, strict=True)
    _write(tmp_path / "gnss.csv", "image,x,y,z,sx,sy,sz,vx,vy,vz", [
        (image, *xyz, *flights.GPS, *velocity) for image, xyz, velocity in rows
    ])  # fmt: skip
    return tmp_path


def _write(path, head, rows):
    path.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n")


def _options(folder, *more):
    files = [f"--{name}={folder / name}.csv" for name in ("cameras", "images", "measures", "control")]
    return ["bundle", *files, f"--check-points={folder / 'check.csv'}", *more]


def test_a_flight_in_a_national_system(tables, capsys):
    given = _options(tables, f"--control-crs={SYSTEM}", f"--positions={tables / 'gnss.csv'}")
    given += ["--lever-arm", "0", "0", "0", "--readout=0", f"--out={tables / 'out'}"]
    assert main(given) == 0
    said = capsys.readouterr()
    assert re.search(r"  sigma0 +(0\.9|1\.0)", said.out)
    assert "heights are taken above the ellipsoid" in said.out
    assert len(said.err.splitlines()) == 7
    assert "3 observed (sigma 0.01), 12 check points; frame RTL*70" in said.err
    assert "lever arm unknown" in said.err
    head, *rows = (tables / "out" / "checks.csv").read_text().splitlines()
    assert head == "point,dx,dy,dz,sx,sy,sz,rays"
    differences = np.array([row.split(",")[1:4] for row in rows], dtype=float)
    assert np.abs(differences).max() < 0.15
    assert len(rows) == 12
    assert "heck points" in (tables / "out" / "bundle.html").read_text()


def test_control_points_outside_the_area_of_their_system_are_said_without_being_asked(tables, capsys):
    main(_options(tables, "--control-crs=EPSG:2056"))
    said = " ".join(capsys.readouterr().err.split())
    assert f"warning: {tables / 'control.csv'}: " in said
    assert "outside the area where 'EPSG:2056' is used" in said


def test_check_points_are_no_control_points(tables, capsys):
    text = (tables / "control.csv").read_text() + (tables / "check.csv").read_text().split("\n", 1)[1]
    (tables / "control.csv").write_text(text)
    main(_options(tables, f"--control-crs={SYSTEM}"))
    said = capsys.readouterr()
    assert "12 control points are check points: they take no part as control" in said.out
    assert "3 observed (sigma 0.01), 12 check points" in said.err


def test_a_control_point_in_two_tables_is_still_refused(tables, capsys):
    assert main([*_options(tables), f"--control={tables / 'control.csv'}"]) == 2
    assert "is given twice" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--lever-arm-sigma=0"], "--lever-arm-sigma goes with --lever-arm"),
        (["--readout-sigma=0"], "--readout-sigma goes with --readout"),
        (["--free=Q"], "no camera parameter matches 'Q'"),
    ],
)
def test_options_that_need_others(tables, capsys, more, message):
    assert main(_options(tables, f"--positions={tables / 'gnss.csv'}", *more)) == 2
    assert message in capsys.readouterr().err


def test_velocities_are_asked_for(tables, capsys):
    path = tables / "gnss.csv"
    rows = [line.split(",")[:7] for line in path.read_text().splitlines()]
    path.write_text("\n".join(map(",".join, rows)) + "\n")
    assert main(_options(tables, f"--positions={path}", "--readout=0")) == 2
    assert "columns vx vy vz, or time" in capsys.readouterr().err


def test_a_large_block_is_columns(tables, capsys, monkeypatch):
    out, again = tables / "out", tables / "again"
    given = _options(tables, f"--control-crs={SYSTEM}", f"--out={out}")
    code = main([*given, f"--json={tables / 'all.json'}"])
    monkeypatch.setattr(formats, "LARGE", 100)
    assert main(given) == code
    assert "more than 100 observations: bundle.json and bundle.txt, nor kept" in capsys.readouterr().out
    names = {path.name for path in out.iterdir()}
    assert {"bundle.npz", "bundle.html", "points.csv"} < names
    assert not names & {"bundle.json", "bundle.txt"}
    assert main(["report", str(out / "bundle.npz"), f"--out={again}", f"--json={again}.json"]) == code
    assert (again / "bundle.html").read_text() == (out / "bundle.html").read_text()
    one, other = (json.loads(path.read_text()) for path in (tables / "all.json", tables / "again.json"))
    assert one.pop("run") != other.pop("run")
    assert one == other
