"""Surveys in LandXML: what raw observations mean, and what is refused."""

import math

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.survey import KINDS, Datum, Network

SIGMAS = ["distance=3mm", "direction=5sec", "zenith=5sec", "azimuth=5sec", "height=2mm"]
UNITS = (
    '<Units><Metric linearUnit="meter" angularUnit="decimal degrees" directionUnit="decimal dd.mm.ss"/>'
    "</Units>"
)
POINTS = """<CgPoints>
<CgPoint name="A" pntSurv="control">0 0 10</CgPoint> <CgPoint name="B" pntSurv="control">100 0 12</CgPoint>
<CgPoint name="P" pntSurv="sideshot">60 80 15</CgPoint>
</CgPoints>"""
SIGHTS = """<InstrumentSetup id="s1" stationName="A" instrumentHeight="1.5"><InstrumentPoint pntRef="A"/>
</InstrumentSetup>
<ObservationGroup setupID="s1">
<Backsight><BacksightPoint pntRef="B"/></Backsight>
<RawObservation horizAngle="0"><TargetPoint pntRef="B"/></RawObservation>
<RawObservation horizAngle="53.13" slopeDistance="100.12" zenithAngle="87.134" targetHeight="1.7">
<TargetPoint pntRef="P"/></RawObservation>
<RawObservation horizAngle="233.13" zenithAngle="272.866" targetHeight="1.7" directFace="false">
<TargetPoint pntRef="P"/></RawObservation>
<RawObservation horizDistance="1" unused="true"><TargetPoint pntRef="P"/></RawObservation>
</ObservationGroup>"""


def written(tmp_path, sights=SIGHTS, points=POINTS, units=UNITS, head=""):
    path = tmp_path / "s.xml"
    name_space = "http://www.landxml.org/schema/LandXML-1.2"
    survey = f"<Survey><SurveyHeader name='s'/>\n{sights}\n</Survey>"
    path.write_text(
        f'<LandXML xmlns="{name_space}" version="1.2">\n{units}{head}{points}\n{survey}\n</LandXML>'
    )
    return path


def read(tmp_path, **parts):
    return Network.read_project(written(tmp_path, **parts), sigmas=SIGMAS, faces="all")


def test_a_survey_is_adjusted_with_heights_and_both_faces(tmp_path):
    network = read(tmp_path)
    kinds = {kind.code: kind.name for kind in KINDS}
    rows = network.book.observations
    assert [kinds[code] for code in rows.types.tolist()] == ["Hz", "Hz", "Zen", "Dist", "Hz", "Zen", "DistHz"]
    assert rows.active.tolist() == [True] * 6 + [False]
    assert rows.values[4] == pytest.approx(math.radians(53.13))
    assert rows.values[5] == pytest.approx(math.radians(360 - 272.866))
    assert rows.from_heights[3] == 1.5
    assert rows.to_heights[3] == 1.7
    adjusted = network.adjust()
    # 100 m at 53.13 degrees from north is 80 m east and 60 m north; 5 m up and 0.2 m lower at the target
    row = adjusted.points.names.index("P")
    assert adjusted.points.coordinates[row] == pytest.approx([80.0, 60.0, 14.8], abs=0.05)
    assert any("<Backsight>" in text for text in adjusted.warnings)


def test_units_of_angles_and_lengths(tmp_path):
    grads = UNITS.replace("decimal degrees", "grads").replace('"meter"', '"USSurveyFoot"')
    network = read(tmp_path, units=grads, sights=SIGHTS.replace('"53.13"', '"59.0333"'))
    assert network.book.observations.values[1] == pytest.approx(math.radians(53.13), abs=1e-6)
    assert network.book.observations.values[3] == pytest.approx(100.12 * 1200 / 3937)
    azimuth = SIGHTS.replace('horizDistance="1" unused="true"', 'azimuth="53.0748"')
    network = read(tmp_path, sights=azimuth)
    assert network.book.observations.values[-1] == pytest.approx(math.radians(53 + 7 / 60 + 48 / 3600))


def test_points_of_a_numbered_system_are_on_the_earth(tmp_path):
    points = POINTS.replace(">0 0 10<", ">6860700 657700 10<").replace(">100 0 12<", ">6860800 657700 12<")
    points = points.replace(">60 80 15<", ">6860760 657780 15<")
    network = read(tmp_path, points=points, head='<CoordinateSystem epsgCode="2154"/>')
    assert network.points_crs.definition == "EPSG:2154"
    assert network.adjust().converged


WRONG = {
    "--sigmas height=": SIGHTS.replace('horizDistance="1" unused="true"', 'vertDistance="5"'),
    "is no InstrumentSetup": SIGHTS.replace('setupID="s1"', 'setupID="s2"'),
    "has no TargetPoint": SIGHTS.replace('<TargetPoint pntRef="B"/>', "", 1),
    "is observed from itself": SIGHTS.replace('<TargetPoint pntRef="B"/>', '<TargetPoint pntRef="A"/>', 1),
    "is not a number": SIGHTS.replace('"100.12"', '"100,12"'),
    "is above zero": SIGHTS.replace('"100.12"', '"-100.12"'),
    "is not known there": SIGHTS.replace("slopeDistance", "slopDistance"),
    "reduce it to the points": SIGHTS.replace("slopeDistance", "MSLDistance"),
    "it has no covariance": SIGHTS + '<GPSVector dX="1" dY="1" dZ="1"/>',
}


@pytest.mark.parametrize("problem", WRONG)
def test_what_cannot_be_read_is_refused_with_its_line(tmp_path, capfd, problem):
    path = written(tmp_path, sights=WRONG[problem])
    sigmas = [sigma for sigma in SIGMAS if not sigma.startswith("height")]
    assert main(["adjust", str(path), "--sigmas", *sigmas]) == 2
    said = capfd.readouterr().err
    assert problem in said
    assert f"{path}:" in said


def test_a_file_needs_units_and_observations(tmp_path):
    with pytest.raises(InputError, match="has no <Units>"):
        read(tmp_path, units="")
    with pytest.raises(InputError, match="no sight is in it"):
        read(tmp_path, sights="")
    with pytest.raises(InputError, match="is none of meter"):
        read(tmp_path, units=UNITS.replace('"meter"', '"rod"'))
    with pytest.raises(InputError, match="given twice"):
        read(tmp_path, points=POINTS.replace('"B"', '"A"'))


def test_a_survey_without_control_is_free(tmp_path):
    network = read(tmp_path, points=POINTS.replace("control", "sideshot"))
    assert any("coordinates of 3 points are first values" in text for text in network.book.warnings)
    with pytest.raises(InputError, match="no point is known"):
        network.adjust()
    assert network.adjust(datum=Datum("inner")).converged


def test_a_target_that_is_only_described_has_the_description_for_a_name(tmp_path):
    place = '<TargetPoint desc="850">60 80 15</TargetPoint>'
    network = read(
        tmp_path,
        points=POINTS.replace('"P"', '"Q"'),
        sights=SIGHTS.replace('<TargetPoint pntRef="P"/>', place),
    )
    assert "850" in network.points.names
    other = SIGHTS.replace('<TargetPoint pntRef="P"/>', place, 1).replace(
        '<TargetPoint pntRef="P"/>', place.replace("60", "61"), 1
    )
    with pytest.raises(InputError, match="described as '850'"):
        read(tmp_path, sights=other)


REDUCED = """<LandXML xmlns="http://www.landxml.org/schema/LandXML-1.2" version="1.2">
<Units><Metric linearUnit="meter" angularUnit="decimal dd.mm.ss" directionUnit="decimal dd.mm.ss" /></Units>
<CgPoints>
<CgPoint name="1" state="existing" pntSurv="control" oID="7">0 0</CgPoint>
<CgPoint name="2" state="existing" pntSurv="control" oID="8">100 0</CgPoint>
<CgPoint name="3" state="proposed" pntSurv="boundary" oID="9">61 79</CgPoint>
</CgPoints>
<Survey><SurveyHeader name="plan"/>
<InstrumentSetup id="IS-1" stationName="1" instrumentHeight="0"> <InstrumentPoint pntRef="1"/>
</InstrumentSetup>
<InstrumentSetup id="IS-2" stationName="2" instrumentHeight="0"> <InstrumentPoint pntRef="2"/>
</InstrumentSetup>
<InstrumentSetup id="IS-3" stationName="3" instrumentHeight="0"> <InstrumentPoint pntRef="3"/>
</InstrumentSetup>
<ObservationGroup id="OG-1">
<ReducedObservation name="1" setupID="IS-1" targetSetupID="IS-3" azimuth="53.0748" horizDistance="100.003"
 distanceType="measured" azimuthType="measured" purpose="boundary" equipmentUsed="EDM" distanceAccuracy="1"/>
<ReducedObservation name="2" setupID="IS-2" targetSetupID="IS-3" azimuth="116.3354" horizDistance="89.443"
 distanceType="measured" azimuthType="computed" purpose="normal"/>
</ObservationGroup></Survey></LandXML>
"""


def test_reduced_observations_are_taken_on_request(tmp_path, capsys):
    path = tmp_path / "plan.xml"
    path.write_text(REDUCED)
    sigmas = ["distance=5mm", "azimuth=20sec"]
    assert main(["adjust", str(path), "--sigmas", *sigmas]) == 2
    assert "--ignore reductions takes them as measured" in capsys.readouterr().err
    network = Network.read_project(path, sigmas=sigmas, ignore=["reductions"])
    assert network.book.observations.n_inactive == 1  # the azimuth that was computed
    adjusted = network.adjust()
    row = adjusted.points.names.index("3")
    np.testing.assert_allclose(adjusted.points.coordinates[row, :2], (80, 60), atol=0.01)
