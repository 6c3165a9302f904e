"""The plan of points that only levelling knows is no number between the file and the export."""

import csv
import json

import pytest

from obseq.cli.main import main
from obseq.report.result_file import read_json

LINES = ("A B 1.001", "B C 2.002", "C A -3.000")
GAMA = """<?xml version="1.0" ?>
<gama-local xmlns="http://www.gnu.org/software/gama/gama-local"><network><points-observations>
<point id="A" z="100.0" fix="z"/><point id="B" adj="z"/><point id="C" adj="z"/><height-differences>
{}
</height-differences></points-observations></network></gama-local>
"""
FILES = {
    "gama": {
        "n.gkf": GAMA.format(
            "\n".join('<dh from="{}" to="{}" val="{}" stdev="1.0"/>'.format(*line.split()) for line in LINES)
        )
    },
    "starnet": {
        "n.dat": ".UNITS Meters\n.3D\nE A 100.0 !\n"
        + "".join("L {}-{} {} 1 0.001\n".format(*line.split()) for line in LINES)
    },
    "tables": {
        "p.csv": "name,x,y,z,sx,sy,sz\nA,,,100.0,,,0\nB,,,,,,\nC,,,,,,\n",
        "o.csv": "type,from,to,value,sigma\n"
        + "".join("DH,{},{},{},0.001\n".format(*line.split()) for line in LINES),
    },
}


@pytest.fixture(params=FILES)
def result(request, tmp_path):
    """The result of a levelling in which no point has a plan."""
    for name, text in FILES[request.param].items():
        (tmp_path / name).write_text(text)
    out = tmp_path / "r.json"
    read = [str(tmp_path / name) for name in FILES[request.param]]
    assert main(["adjust", *read, "--json", str(out), "--html", str(tmp_path / "r.html")]) == 0
    return out


def test_a_result_has_heights_alone(result):
    record = read_json(result)
    heights = {point.name: point.z for point in record.points}
    assert heights == pytest.approx({"A": 100.0, "B": 101.0, "C": 103.001}, abs=1e-6)
    for point in record.points:
        assert point.plan is None and (point.crs_x, point.crs_y, point.sx, point.crs_sy) == (None,) * 4
        assert point.ellipse is None and point.known == ("Z" if point.name == "A" else "")
        assert point.covariance[:5] == (None,) * 5 and point.covariance[5] is not None


def test_tables_have_empty_cells_and_are_read_again(result, tmp_path, capsys):
    assert main(["convert", str(result), "--to", str(tmp_path / "points.csv")]) == 0
    rows = list(csv.DictReader((tmp_path / "points.csv").read_text().splitlines()))
    assert all(row[cell] == "" for row in rows for cell in ("x", "y", "sx", "sy"))
    assert [round(float(row["z"]), 4) for row in rows] == [100.0, 101.0, 103.001]
    (tmp_path / "again.csv").write_text(FILES["tables"]["o.csv"])
    assert main(["adjust", str(tmp_path / "points.csv"), str(tmp_path / "again.csv")]) == 0
    assert main(["convert", str(result), "--to", str(tmp_path / "points.cor")]) == 2
    assert "point A has z only, which a COR file cannot say; write .csv" in capsys.readouterr().err


def test_a_map_has_points_without_a_place(tmp_path):
    """Levelled points beside known ones, on the Earth."""
    (tmp_path / "p.csv").write_text(
        "name,x,y,z,sx,sy,sz\nK,700000,6600000,100,0.01,0.01,0.01\nB,,,,,,\nC,,,,,,\n"
    )
    (tmp_path / "o.csv").write_text(
        "type,from,to,value,sigma\nDH,K,B,1.0,0.001\nDH,B,C,1.0,0.001\nDH,C,K,-2.001,0.001\n"
    )
    read = [str(tmp_path / "p.csv"), str(tmp_path / "o.csv"), "--points-crs", "EPSG:2154"]
    result = tmp_path / "r.json"
    assert main(["adjust", *read, "--json", str(result), "--html", str(tmp_path / "r.html")]) == 0
    assert main(["convert", str(result), "--to", str(tmp_path / "m.geojson")]) == 0
    features = json.loads((tmp_path / "m.geojson").read_text())["features"]
    layers = [(f["properties"]["layer"], f["properties"].get("name", "line")) for f in features]
    placed = dict(zip(layers, (f["geometry"] is not None for f in features), strict=True))
    assert placed[("points", "K")] and not placed[("points", "B")] and not placed[("observations", "line")]
    assert ("ellipses", "B") not in placed


def test_a_simulated_levelling_has_no_plan_either(tmp_path):
    read = []
    for name, text in FILES["tables"].items():
        (tmp_path / name).write_text(text)
        read.append(str(tmp_path / name))
    assert main(["simulate", *read, "--seed", "3", "--out", str(tmp_path / "s")]) == 0
    assert sorted(path.name for path in (tmp_path / "s").iterdir()) == ["simulated.csv", "simulated.obs"]
    rows = list(csv.DictReader((tmp_path / "s" / "simulated.csv").read_text().splitlines()))
    assert all(row[cell] == "" for row in rows for cell in ("x", "y", "sx", "sy"))
    again = [str(tmp_path / "s" / name) for name in ("simulated.csv", "simulated.obs")]
    assert main(["adjust", *again, "--json", str(tmp_path / "r.json")]) == 0
    heights = {point.name: point.z for point in read_json(tmp_path / "r.json").points}
    assert heights == pytest.approx({"A": 100.0, "B": 101.0, "C": 103.001}, abs=0.01)


@pytest.mark.parametrize("rise", [0.0, 0.05, 80.0])
def test_one_levelled_point_beside_one_known_point_on_the_earth(tmp_path, rise):
    """Both stand on one vertical: that it could turn there is rounding, and no motion."""
    known = "A,700000,6600000,100,0.001,0.001,0.001"
    (tmp_path / "p.csv").write_text(f"name,x,y,z,sx,sy,sz\n{known}\nB,,,,,,\n")
    (tmp_path / "o.csv").write_text(f"type,from,to,value,sigma\nDH,A,B,{rise},0.001\n")
    read = [str(tmp_path / name) for name in ("p.csv", "o.csv")]
    assert main(["adjust", *read, "--points-crs", "EPSG:2154", "--json", str(tmp_path / "r.json")]) == 0
    point = read_json(tmp_path / "r.json").points[1]
    assert (point.crs_z, point.crs_sz) == pytest.approx((100.0 + rise, 0.001 * 2**0.5), abs=1e-6)
