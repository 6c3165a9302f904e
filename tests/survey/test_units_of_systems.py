"""Coordinates whose file names a unit of length, in systems of other units: feet, degrees."""

import numpy as np
import pytest
from msgspec import structs

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.formats.point_files import csv_of
from obseq.report.result_file import read_json
from obseq.survey import Network

US_FOOT = 1200.0 / 3937.0
PLACE = np.array([2602000.0, 250000.0, 300.0])
"""In US survey feet: in EPSG:6565, whose heights are in metres."""
OBSERVATIONS = (
    "type,from,to,value,sigma,unit\nDist,A,P,1000,0.01,us-ft\nAzim,A,P,90,0.001,deg\nDH,A,P,0,0.01,us-ft\n"
)
STARNET = """.UNITS {unit} DMS
.3D
.ORDER EN AtFromTo
C A {a} {b} {c} ! ! !
C P {p} {b} {c}
B A-P 90-00-00 5
D A-P {d} 0.01
V A-P 90-00-00 5
"""
LANDXML = """<?xml version="1.0"?>
<LandXML xmlns="http://www.landxml.org/schema/LandXML-1.2" version="1.2">
<Units>
<Imperial linearUnit="USSurveyFoot" angularUnit="decimal degrees" directionUnit="decimal degrees"/></Units>
<CoordinateSystem epsgCode="6565"/>
<CgPoints><CgPoint name="A" pntSurv="control">250000 2602000 300</CgPoint>
<CgPoint name="P">250000 2603000 300</CgPoint></CgPoints>
<Survey><SurveyHeader name="s"/>
<InstrumentSetup id="sA" stationName="A" instrumentHeight="0"><InstrumentPoint pntRef="A"/></InstrumentSetup>
<ObservationGroup id="gA" setupID="sA">
<RawObservation azimuth="90" slopeDistance="1000" zenithAngle="90"><TargetPoint pntRef="P"/></RawObservation>
</ObservationGroup></Survey></LandXML>
"""


def tables(folder, rows, system):
    (folder / "p.csv").write_text(f"name,x,y,z,sx,sy,sz,unit\n{rows}")
    (folder / "o.csv").write_text(OBSERVATIONS)
    return Network.read_project([folder / "p.csv", folder / "o.csv"], points_crs=system)


def given(network):
    return network.given_points().coordinates


def starnet(folder, unit, metres):
    a, b, p = (value * US_FOOT / metres for value in (2602000.0, 250000.0, 2603000.0))
    c, d = 300.0 * US_FOOT / metres, 1000.0 * US_FOOT / metres
    (folder / "n.dat").write_text(STARNET.format(unit=unit, a=a, b=b, c=c, d=d, p=p))
    return Network.read_project(folder / "n.dat", points_crs="EPSG:6565", refraction=1.0)


def landxml(folder):
    (folder / "n.xml").write_text(LANDXML)
    return Network.read_project(
        folder / "n.xml", sigmas=["distance=0.01us-ft", "azimuth=3sec", "zenith=3sec"]
    )


@pytest.mark.parametrize(
    "read",
    [
        lambda folder: starnet(folder, "FeetUS", US_FOOT),
        lambda folder: starnet(folder, "Meters", 1.0),
        landxml,
        lambda folder: tables(
            folder,
            "A,2602000,250000,300,0,0,0,us-ft\nP,2603000,250000,300,,,,us-ft\n",
            "EPSG:6565",
        ),
        lambda folder: tables(
            folder,
            f"A,2602000,250000,{300 * US_FOOT},0,0,0,\nP,{2603000 * US_FOOT},{250000 * US_FOOT},91.4,,,,m\n",
            "EPSG:6565",
        ),
    ],
    ids=[
        "STAR*NET in feet",
        "STAR*NET in metres",
        "LandXML",
        "table in feet",
        "table without unit and in metres",
    ],
)
def test_feet_of_a_file_are_those_of_the_system(tmp_path, read):
    network = read(tmp_path)
    np.testing.assert_allclose(given(network)[0], PLACE * [1.0, 1.0, US_FOOT], rtol=0, atol=1e-6)
    np.testing.assert_allclose(given(network)[1, :2], [2603000.0, 250000.0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(network.frame.system.origin[:2], PLACE[:2], rtol=0, atol=1e-6)


@pytest.mark.parametrize(("system", "degree"), [("EPSG:4326", 1.0), ("EPSG:4171", 1.0)])
def test_angles_are_never_multiplied_by_a_unit_of_length(tmp_path, system, degree):
    network = tables(tmp_path, "A,2.5,48,300,0,0,0,us-ft\nP,2.504,48,91,,,,m\n", system)
    expected = [[2.5, 48.0, 300.0 * US_FOOT], [2.504, 48.0, 91.0]]
    np.testing.assert_allclose(given(network), expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("read", [lambda folder: starnet(folder, "FeetUS", US_FOOT), landxml])
def test_bearings_of_grid_jobs_are_from_grid_north(tmp_path, read):
    """Due east on the map, where the meridian converges by 1.47 degrees: 26 ft in a thousand."""
    network = read(tmp_path)
    adjusted = network.point_system.coordinates(network.adjust().points.coordinates)
    assert adjusted[1, 1] == pytest.approx(250000.0, abs=2e-3)
    assert adjusted[1, 0] == pytest.approx(2603000.0, abs=0.05)
    (said,) = [text for text in network.book.warnings if "grid north" in text]
    assert said.startswith("1 bearing is from grid north of EPSG:6565") and "1.467" in said


def test_a_bearing_to_a_point_without_coordinates_is_turned_as_well(tmp_path):
    text = STARNET.format(unit="FeetUS", a=2602000, b=250000, c=300, d=1000, p=2603000)
    (tmp_path / "n.dat").write_text("".join(line for line in text.splitlines(True) if "C P" not in line))
    network = Network.read_project(tmp_path / "n.dat", points_crs="EPSG:6565", refraction=1.0)
    adjusted = network.point_system.coordinates(network.adjust().points.coordinates)
    assert adjusted[1, 1] == pytest.approx(250000.0, abs=2e-3)


@pytest.mark.parametrize("frame", ["GeoC", "LEuc*0*0*0*0*0*0"])
def test_a_bearing_of_a_map_needs_a_horizon(tmp_path, frame):
    (tmp_path / "n.dat").write_text(
        STARNET.format(unit="FeetUS", a=2602000, b=250000, c=300, d=1000, p=2603000)
    )
    with pytest.raises(InputError, match=r"n\.dat:\d+\): a bearing from grid north .* local tangent frame"):
        Network.read_project(tmp_path / "n.dat", points_crs="EPSG:6565", frame=frame)


def test_azimuths_of_tables_are_from_geographic_north(tmp_path):
    rows = "A,2602000,250000,300,0,0,0,us-ft\nP,2603000,250000,300,,,,us-ft\n"
    network = tables(tmp_path, rows, "EPSG:6565")
    assert network.book.observations.values[1] == pytest.approx(np.pi / 2.0, abs=1e-12)


def test_results_in_feet_are_read_again(tmp_path):
    rows = "A,2602000,250000,300,0.01,0.01,0.01,us-ft\nP,2603000,250000,300,,,,us-ft\n"
    record = tables(tmp_path, rows, "EPSG:6565").adjust().record()
    text = csv_of(record)
    assert text.splitlines()[0].endswith(",unit") and text.splitlines()[1].endswith(",us-ft")
    again = tables(tmp_path, "".join(f"{line}\n" for line in text.splitlines()[1:]), "EPSG:6565")
    expected = [[point.crs_x, point.crs_y, point.crs_z] for point in record.points]
    np.testing.assert_allclose(given(again), expected, rtol=0, atol=1e-6)
    np.testing.assert_allclose(again.points.sigmas[0], 0.01 * US_FOOT, rtol=1e-6)
    metric = csv_of(structs.replace(record, units=structs.replace(record.units, length="m")))
    assert not metric.splitlines()[0].endswith(",unit")


def test_a_table_of_points_goes_with_obs_files(tmp_path):
    (tmp_path / "p.csv").write_text("name,x,y,z,sx,sy,sz,unit\nA,0,0,300,0,0,0,ft\nP,0,100,300,0,0,,ft\n")
    (tmp_path / "o.obs").write_text("4 A P 1.5 0.001\n")
    for files in (["p.csv", "--obs", "o.obs"], ["--obs", "o.obs", "--cor", "p.csv"]):
        named = [str(tmp_path / name) if "." in name else name for name in files]
        assert main(["adjust", *named, "--json", str(tmp_path / "r.json")]) == 0
        _, point = read_json(tmp_path / "r.json").points
        assert (point.x, point.y, point.z) == pytest.approx((0.0, 30.48, 300 * 0.3048 + 1.5), abs=1e-9)
