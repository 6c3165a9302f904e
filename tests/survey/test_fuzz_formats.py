"""Mutated files of Gama, STAR*NET and LandXML: refused in words, or a result that can be trusted."""

import importlib
import random
from collections import Counter
from pathlib import Path

import pytest

from obseq.errors import ObseqError
from obseq.survey import Network
from obseq.survey.conversion import write_gama

TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"
GAMA = """<?xml version="1.0"?>
<gama-local xmlns="http://www.gnu.org/software/gama/gama-local">
<network axes-xy="ne" angles="left-handed">
<parameters sigma-apr="10" conf-pr="0.95" tol-abs="1000" sigma-act="aposteriori" />
<points-observations distance-stdev="3 2 1" direction-stdev="10" angle-stdev="10" azimuth-stdev="20">
<point id="A" x="0" y="0" z="10" fix="xyz" />
<point id="B" x="100" y="0" z="12" fix="xyz" />
<point id="P" x="60" y="80" z="15" adj="xyz" />
<point id="Q" adj="XY" x="10" y="90" />
<point id="H" adj="z" />
<obs from="A" from_dh="1.5">
<direction to="B" val="0.0000" />
<direction to="P" val="59.0334" stdev="8.5" />
<direction to="Q" val="92.9553" />
<distance to="P" val="100.0030" stdev="5" />
<z-angle to="P" val="96.8195" stdev="10" to_dh="1.5" />
<azimuth to="Q" val="92.9553" />
</obs>
<obs>
<angle from="B" bs="A" fs="P" val="296-33-54.2" />
<angle from="B" bs="P" fs="Q" val="20.4833" />
<cov-mat dim="2" band="1"> 100 -50 100 </cov-mat>
</obs>
<obs> <distance from="B" to="Q" val="127.2792" />
<s-distance from="B" to="P" val="89.4930" stdev="5" /> </obs>
<height-differences>
<dh from="A" to="H" val="2.5010" dist="0.5" />
<dh from="H" to="P" val="2.4980" stdev="2" />
</height-differences>
<vectors> <vec from="A" to="P" dx="60.001" dy="80.002" dz="4.999" />
<cov-mat dim="3" band="2"> 25 1 0 25 1 50 </cov-mat> </vectors>
<coordinates> <point id="Q" x="10.002" y="90.001" />
<cov-mat dim="2" band="1"> 25 1 25 </cov-mat> </coordinates>
</points-observations>
</network>
</gama-local>
"""
STARNET = """# a network
.3D
.UNITS Meters DMS
.ORDER EN AtFromTo
C A 0 0 10 ! ! !
C B 0 100 12 0.01 0.01 *
C P 80 60 15
E H 12.5
M A-B-P 53-07-48.4 100.1351 87-01-23.9 5 0.005 5 1.5/1.7
DB P
DN A 0 5
DM B 63-26-05.8 89.4930 91-55-15.7 5 0.005 5
DE
D B-P 89.4930 0.005 'remark
V B-P 88-04-44.3 8
DV A-P 100.1300 87-04-49.6 0.004 6 1.5/1.6
B A-P N53-07-48.4E 10
BM A-Q 300.15 50.001 90-00-00 10 0.005 10
L A-H 2.501 500 0.002
L H-P 2.498 0.6 &
TB B
T A 71-33-54.2 63.246 90-00-00.0 5 .01 8
T R 135-00-00.0 45.000 83-37-14.3 5 .01 8
TE P 26-33-54.2 A 8
SS A-B-S 90 20 90 5 .01 5
.DELTA ON
DV A-P 100.000 5.001 0.004 .004
.DATA OFF
rubbish
.DATA ON
"""
LANDXML = """<?xml version="1.0"?>
<LandXML xmlns="http://www.landxml.org/schema/LandXML-1.2" version="1.2">
<Units><Metric linearUnit="meter" angularUnit="decimal degrees" directionUnit="decimal dd.mm.ss"/></Units>
<CgPoints>
<CgPoint name="A" pntSurv="control">0 0 10</CgPoint>
<CgPoint name="B" pntSurv="control">100 0 12</CgPoint>
<CgPoint name="P" pntSurv="sideshot">60 80 15</CgPoint>
</CgPoints>
<Survey> <SurveyHeader name="s"/>
<InstrumentSetup id="s1" stationName="A" instrumentHeight="1.5">
<InstrumentPoint pntRef="A"/> </InstrumentSetup>
<ObservationGroup setupID="s1">
<RawObservation horizAngle="0"> <TargetPoint pntRef="B"/> </RawObservation>
<RawObservation horizAngle="53.13" slopeDistance="100.135" zenithAngle="87.0233" targetHeight="1.7">
<TargetPoint pntRef="P"/> </RawObservation>
<RawObservation horizAngle="233.13" zenithAngle="272.9767" targetHeight="1.7" directFace="false">
<TargetPoint pntRef="P"/> </RawObservation>
<RawObservation azimuth="53.0748" horizDistance="100.002"> <TargetPoint pntRef="P"/> </RawObservation>
<RawObservation vertDistance="5.201" unused="false"> <TargetPoint pntRef="P"/> </RawObservation>
</ObservationGroup>
</Survey>
</LandXML>
"""
ADJUSTED = {"n.gkf": 0.3, "n.dat": 0.04, "n.xml": 0.3}
"""Shares of the files that are adjusted: most mutations of XML are refused."""
TEXTS = {"n.gkf": GAMA, "n.dat": STARNET, "n.xml": LANDXML}
SIGMAS = ["distance=3mm", "direction=5sec", "zenith=5sec", "azimuth=5sec", "height=2mm", "height-per-km=1mm"]


def outcome(bench, folder, name, seed, adjusts):
    """ "refused", "read" or "adjusted"; raises when the result cannot be trusted."""
    chance = random.Random(seed)
    path = folder / name
    path.write_bytes(bench.mutated(TEXTS[name], chance))
    try:
        network = Network.read_project(path, sigmas=[] if name == "n.gkf" else SIGMAS)
        if chance.random() >= adjusts:
            if network.frame.is_plane and chance.random() < 0.1:
                write_gama(folder / "again.gkf", network)
            return "read"
        record = network.adjust().record()
    except ObseqError as error:
        bench.check_message(str(error))
        return "refused"
    bench.check_result(record)
    return "adjusted"


@pytest.mark.parametrize("name", TEXTS)
def test_the_files_without_mutation_are_adjusted(tmp_path, name):
    (tmp_path / name).write_text(TEXTS[name])
    adjusted = Network.read_project(tmp_path / name, sigmas=SIGMAS).adjust()
    assert adjusted.converged
    assert not adjusted.left_out


@pytest.mark.slow  # reads five thousand files, adjusts some
@pytest.mark.parametrize("name", TEXTS)
def test_mutated_files_are_refused_or_give_what_can_be_trusted(monkeypatch, tmp_path, name):
    monkeypatch.syspath_prepend(TOOLS)
    bench, counts = importlib.import_module("fuzz_readers"), Counter()
    cases = (
        (seed, lambda seed=seed: outcome(bench, tmp_path, name, seed, ADJUSTED[name])) for seed in range(1700)
    )
    failures = [said for seed, work in cases if (said := bench.judged(f"seed {seed}", work, counts))]
    assert failures == []
    assert counts["refused"] > 400
    assert counts["read"] > 50
    assert counts["adjusted"] > 3
