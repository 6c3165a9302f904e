"""Networks and results in other formats: what is written is read back to the same adjustment."""

import csv
import json
import shlex
import shutil
import subprocess
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from outside import OutsideData

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.formats.conversion import datum_options, write_gama
from obseq.survey import Datum, Network, read_cor

SETS = ("gama-local-small", "gama-textbook-1d", "gama-textbook-2d", "gama-textbook-3d")
FILES = sorted(path for folder in OutsideData().sets(SETS) for path in folder.glob("*.gkf"))
NETWORKS = [f"{path.parent.name}/{path.name}" for path in FILES]
PLUMB = """
<point id="A" x="0" y="0" z="10" fix="xyz" /> <point id="B" x="100" y="0" z="12" fix="xyz" />
<point id="P" x="60" y="80" z="15" adj="xyz" />
<obs from="A"> <direction to="B" val="0" stdev="10" /> <direction to="P" val="59.0334" stdev="10" />
<z-angle to="P" val="96.8196" stdev="10" from_dh="1.6" to_dh="1.6" /> </obs>
<obs> <distance from="B" to="P" val="89.443" stdev="5" /> <s-distance from="B" to="P" val="89.49" stdev="5" />
<distance from="A" to="P" val="100.003" stdev="5" /> </obs>
"""


@pytest.fixture
def gkf(tmp_path):
    path = tmp_path / "plumb.gkf"
    head = '<network axes-xy="ne"><points-observations>'
    path.write_text(f"<gama-local>{head}{PLUMB}</points-observations></network></gama-local>")
    return path


@pytest.mark.usefixtures("unsearched")
@pytest.mark.parametrize("name", NETWORKS)
def test_gama_networks_come_back(tmp_path, shared_data, name):
    first = Network.read_project(shared_data / name)
    write_gama(tmp_path / "again.gkf", first)
    before, after = first.adjust(), Network.read_project(tmp_path / "again.gkf").adjust()
    assert after.sigma0 == pytest.approx(before.sigma0, rel=1e-9)
    assert after.solution.redundancy == before.solution.redundancy
    rows = [after.points.names.index(point) for point in before.points.names]
    free = before.points.points.is_free
    assert after.points.crs_coordinates[rows][free] == pytest.approx(
        before.points.crs_coordinates[free], abs=1e-9
    )
    assert after.points.crs_precisions[rows] == pytest.approx(
        before.points.crs_precisions, abs=1e-9, nan_ok=True
    )


@pytest.mark.usefixtures("unsearched")
@pytest.mark.parametrize("name", NETWORKS)
def test_gama_adjusts_what_is_written(tmp_path, shared_data, name):
    program = shutil.which("gama-local")
    if program is None:
        pytest.skip(reason="gama-local is not installed (the package gama of some distributions)")
    network = Network.read_project(shared_data / name)
    write_gama(tmp_path / "written.gkf", network)
    command = [program, "written.gkf", "--xml", "out.xml"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=60)
    space = "{http://www.gnu.org/software/gama/gama-local-adjustment}"
    adjusted = ElementTree.parse(tmp_path / "out.xml").getroot().find(f"{space}coordinates/{space}adjusted")
    ours = network.adjust()
    for point in adjusted:
        row = ours.points.names.index(point.find(f"{space}id").text)
        for axis, letter in enumerate("xyz"):
            for found in (point.find(space + letter), point.find(space + letter.upper())):
                if found is not None:
                    given = ours.points.crs_coordinates[row, axis]
                    assert float(found.text) == pytest.approx(given, abs=1e-5)


def test_obs_and_cor_of_a_gama_network_adjust_to_the_same(tmp_path, capfd, gkf):
    obs, cor = tmp_path / "n.obs", tmp_path / "n.cor"
    assert main(["convert", str(gkf), "--to", str(obs), str(cor)]) == 0
    assert "--refraction 1" in capfd.readouterr().out
    there = Network.read_project(gkf).adjust()
    back = Network.read(obs, cor, points_crs="Local*ne", refraction=1.0).adjust()
    assert back.points.coordinates == pytest.approx(there.points.coordinates, abs=1e-9)
    assert back.sigma0 == pytest.approx(there.sigma0, rel=1e-9)
    options = ["--points-crs", "Local*ne", "--refraction", "1", "--to", str(gkf)]
    assert main(["convert", "--obs", str(obs), "--cor", str(cor), *options]) == 0
    again = Network.read_project(gkf).adjust()
    assert again.points.coordinates == pytest.approx(there.points.coordinates, abs=1e-9)


def test_adjusted_coordinates_become_a_point_file(tmp_path, gkf):
    result = tmp_path / "r.json"
    assert main(["adjust", str(gkf), "--json", str(result)]) == 0
    cor, table = tmp_path / "a.cor", tmp_path / "a.csv"
    assert main(["convert", str(result), "--to", str(cor), str(table)]) == 0
    adjusted = Network.read_project(gkf).adjust()
    points = read_cor(cor)
    assert points.names == adjusted.points.names
    assert points.coordinates == pytest.approx(adjusted.points.crs_coordinates, abs=1e-9)
    assert points.sigmas == pytest.approx(adjusted.points.crs_precisions, abs=1e-12)
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert [row["name"] for row in rows] == list(points.names)
    assert float(rows[2]["x"]) == points.coordinates[2, 0]


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo") / "out"
    assert main(["demo", "--out", str(folder)]) == 0
    return folder / "adjustment.json"


def test_geojson_is_longitude_latitude_and_counter_clockwise(tmp_path, demo):
    assert main(["convert", str(demo), "--to", str(tmp_path / "m.geojson")]) == 0
    record = json.loads(demo.read_text(encoding="utf-8"))
    collection = json.loads((tmp_path / "m.geojson").read_text(encoding="utf-8"))
    assert "crs" not in collection
    layers = {feature["properties"]["layer"] for feature in collection["features"]}
    assert layers == {"points", "ellipses", "observations"}
    point = collection["features"][0]
    assert point["properties"]["name"] == record["points"][0]["name"]
    longitude, latitude, _ = point["geometry"]["coordinates"]
    assert 2.0 < longitude < 3.0
    assert 48.0 < latitude < 49.0
    for feature in collection["features"]:
        if feature["geometry"]["type"] == "Polygon":
            (ring,) = np.array(feature["geometry"]["coordinates"])
            x, y = (ring[:, :2] - ring[0, :2]).T
            assert ring[0].tolist() == ring[-1].tolist()
            assert np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) > 0.0


def test_a_geopackage_holds_a_layer_for_each_kind(tmp_path, demo, gkf):
    pyogrio = pytest.importorskip("pyogrio", reason="pyogrio is an extra: pip install obseq[maps]")
    package = tmp_path / "m.gpkg"
    assert main(["convert", str(demo), "--to", str(package)]) == 0
    record = json.loads(demo.read_text(encoding="utf-8"))
    assert set(pyogrio.list_layers(package)[:, 0]) == {"points", "ellipses", "observations"}
    meta, _, shapes, _ = pyogrio.raw.read(package, layer="points")
    assert "LAMB93" in meta["crs"]
    first = np.frombuffer(shapes[0][5:], "<f8")
    given = [record["points"][0][f"crs_{axis}"] for axis in "xyz"]
    assert first == pytest.approx(given, abs=1e-6)
    result = tmp_path / "plane.json"
    assert main(["adjust", str(gkf), "--json", str(result)]) == 0
    assert main(["convert", str(result), "--to", str(package)]) == 0
    assert set(pyogrio.list_layers(package)[:, 0]) == {"points", "ellipses", "observations"}


def refused(capfd, *arguments):
    assert main([str(argument) for argument in arguments]) == 2
    return capfd.readouterr().err


def test_what_a_format_cannot_say_is_refused_by_name(tmp_path, capfd, gkf, demo):
    result = tmp_path / "r.json"
    assert main(["adjust", str(gkf), "--json", str(result)]) == 0
    capfd.readouterr()
    assert "no place on the Earth" in refused(capfd, "convert", result, "--to", tmp_path / "m.geojson")
    assert ".gkf" in refused(capfd, "convert", gkf, "--to", tmp_path / "n.xyz")
    assert "replace an input" in refused(capfd, "convert", gkf, "--to", gkf)
    table = tmp_path / "points.csv"
    result.write_text(result.read_text().replace(str(gkf), str(table)))
    assert "replace an input" in refused(capfd, "convert", result, "--to", table)
    for folder in OutsideData().sets(["gama-local-small"]):
        vectors = folder / "cube-1.gkf"
        said = refused(capfd, "convert", vectors, "--to", tmp_path / "n.obs")
        assert f"{vectors}:27" in said
    assert not (tmp_path / "n.obs").exists()


def test_gama_gets_no_corrections_nor_places_on_the_earth(tmp_path, gkf):
    network = Network.read_project(gkf, refraction=0.13)
    with pytest.raises(InputError, match=r"plumb\.gkf:\d+\): zenith angles are corrected"):
        write_gama(tmp_path / "n.gkf", network)
    book, points = tmp_path / "n.obs", tmp_path / "n.cor"
    assert main(["convert", str(gkf), "--to", str(book), str(points)]) == 0
    placed = Network.read(book, points, frame="RTL*2*48*0*EPSG:4326", points_crs="RTL*2*48*0*EPSG:4326")
    with pytest.raises(InputError, match="Gama computes in a plane"):
        write_gama(tmp_path / "n.gkf", placed)


def test_inner_constraints_of_a_project_are_named_or_refused(tmp_path, capsys, shared_data):
    """Without --datum inner the precisions would be those of its sigmas of a decimetre."""
    project = shared_data / "comp3d-no-redundancy" / "project.comp"
    files = [str(tmp_path / "n.obs"), str(tmp_path / "n.cor")]
    assert main(["convert", str(project), "--to", *files]) == 0
    options = shlex.split(capsys.readouterr().out.partition("adjust them with ")[2])
    assert options[-2:] == ["--datum", "inner"]
    for arguments in ([str(project)], ["--obs", files[0], "--cor", files[1], *options]):
        assert main(["adjust", *arguments, "--json", str(tmp_path / "r.json")]) == 0
        first = json.loads((tmp_path / "r.json").read_text())["points"][0]
        assert (first["name"], round(1e3 * first["sy"], 2)) == ("S1", 0.37)
    assert main(["convert", str(project), "--to", str(tmp_path / "n.xml")]) == 2
    assert "rests on inner constraints, which a file for DynAdjust would lose" in capsys.readouterr().err


def test_points_without_inner_constraints_are_said(gkf):
    network = Network.read_project(gkf)
    assert datum_options(network) == ""
    inner = replace(network, datum=Datum("inner", (), ("B",)))
    assert datum_options(inner) == " --datum inner --datum-points A P"
    with pytest.raises(InputError, match="point A stays known beside the inner constraints"):
        datum_options(replace(network, datum=Datum("inner", (), (), ("A", "P"))))


def test_shapes_are_cut_at_the_meridian_of_180_degrees(tmp_path, capsys):
    (tmp_path / "n.cor").write_text(
        "1 A 179.999 -20 5 0.001\n1 B -179.9995 -20 8 0.001\n1 C 180 -20.001 8 0.001\n"
    )
    (tmp_path / "n.obs").write_text("3 A B 156.96 1\n3 A C 152.25 1\n4 A B 3 0.001\n3 B C 122.52 1\n")
    files = ["--obs", str(tmp_path / "n.obs"), "--cor", str(tmp_path / "n.cor")]
    main(["adjust", *files, "--points-crs", "EPSG:4326", "--json", str(tmp_path / "r.json")])
    main(
        ["convert", str(tmp_path / "r.json"), "--to", str(tmp_path / "m.geojson"), "--ellipse-scale", "50000"]
    )
    capsys.readouterr()
    features = json.loads((tmp_path / "m.geojson").read_text())["features"]
    shapes = [feature["geometry"] for feature in features]
    lines = [shape for shape in shapes if shape["type"] == "MultiLineString"]
    assert lines, "the line from A to B crosses it"
    (start, border), (other, end) = lines[0]["coordinates"]
    assert (start[0], border[0], other[0], end[0]) == pytest.approx(
        (179.999, 180.0, -180.0, -179.9995), abs=1e-7
    )
    assert border[1:] == other[1:] and border[2] == pytest.approx(5.0 + 3.0 * 2.0 / 3.0, abs=0.002)
    for shape in shapes:
        parts = shape["coordinates"] if "Multi" in shape["type"] else [shape["coordinates"]]
        for part in parts:
            longitudes = np.array(part).reshape(-1, 3)[:, 0]
            assert np.ptp(longitudes) < 1.0 and np.abs(longitudes).max() <= 180.0


def test_kml_lies_on_the_ground_in_longitude_and_latitude(tmp_path, demo):
    pyogrio = pytest.importorskip("pyogrio", reason="pyogrio is an extra: pip install obseq[maps]")
    placed = tmp_path / "m.kml"
    assert main(["convert", str(demo), "--to", str(placed), str(tmp_path / "m.geojson")]) == 0
    assert set(pyogrio.list_layers(placed)[:, 0]) == {"points", "ellipses", "observations"}
    meta, _, shapes, values = pyogrio.raw.read(placed, layer="points")
    collection = json.loads((tmp_path / "m.geojson").read_text(encoding="utf-8"))
    point = collection["features"][0]
    assert np.frombuffer(shapes[0][5:], "<f8")[:2] == pytest.approx(
        point["geometry"]["coordinates"][:2], abs=1e-8
    )
    names = dict(zip(meta["fields"], values, strict=True))["Name"]
    assert point["properties"]["name"] == names[0]


def test_dxf_is_the_plan_in_the_system_of_the_points(tmp_path, demo):
    ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is an extra: pip install obseq[dxf]")
    assert main(["convert", str(demo), "--to", str(tmp_path / "plan.dxf")]) == 0
    record = json.loads(demo.read_text(encoding="utf-8"))
    drawing = ezdxf.readfile(tmp_path / "plan.dxf")
    space = drawing.modelspace()
    points = [list(item.dxf.location) for item in space.query('POINT[layer=="POINTS"]')]
    given = [[point[f"crs_{axis}"] for axis in "xyz"] for point in record["points"]]
    assert np.array(points) == pytest.approx(np.array(given), abs=1e-6)
    assert [item.dxf.text for item in space.query("TEXT")] == [point["name"] for point in record["points"]]
    assert drawing.units == ezdxf.units.M
    drawn = [point["name"] for point in record["points"] if point["ellipse"]["semi_major"]]
    assert len(space.query('POLYLINE[layer=="ELLIPSES"]')) == len(drawn) > 0
    assert len(space.query('LINE[layer=="OBSERVATIONS"]')) == len(record["observations"])


@pytest.mark.parametrize(
    ("suffix", "package", "extra"),
    [("gpkg", "pyogrio", "maps"), ("kml", "pyogrio", "maps"), ("dxf", "ezdxf", "dxf")],
)
def test_what_needs_a_package_says_how_to_install_it(
    tmp_path, capfd, demo, monkeypatch, suffix, package, extra
):
    monkeypatch.setattr("obseq.packages.missing", lambda *names: [name for name in names if name == package])
    said = refused(capfd, "convert", demo, "--to", tmp_path / f"m.{suffix}")
    assert f"needs {package}; install with: pip install 'obseq[{extra}]'" in said
    assert f"pip install -e '.[{extra}]'" in said
