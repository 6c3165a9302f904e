"""Reading definitions, and the messages for those that cannot be read."""

import subprocess
import sys

import numpy as np
import pytest

from obseq import ObseqError, crs
from obseq.crs import CrsError, Kind, LocalTangent, parse


@pytest.mark.parametrize(
    ("definition", "kind", "euclidean"),
    [
        ("LocalNONE", Kind.LOCAL, True),
        ("Local", Kind.LOCAL, True),
        ("GeoC", Kind.GEOCENTRIC, True),
        ("LEuc*1*2*3*0.1*0.2*0.3", Kind.LOCAL_EUCLIDEAN, True),
        ("RTL*657700*6860700*0*IGNF:LAMB93", Kind.LOCAL_TANGENT, True),
        ("RTL", Kind.LOCAL_TANGENT, True),
        ("IGNF:LAMB93", Kind.PROJ, False),
        ("EPSG:2154", Kind.PROJ, False),
        ("+proj=utm +zone=31 +datum=WGS84", Kind.PROJ, False),
    ],
)
def test_kinds(definition, kind, euclidean) -> None:
    system = parse(definition)
    assert (system.kind, system.is_euclidean, system.definition) == (kind, euclidean, definition)
    assert system.is_complete is (definition != "RTL")


def test_aliases_are_resolved_also_inside_an_rtl() -> None:
    assert parse("L93") == parse("IGNF:LAMB93")
    assert parse("Geog").definition == "+proj=latlong +datum=WGS84"
    assert parse(" RTL * 657700*6860700*0*L93 ").definition == "RTL*657700*6860700*0*IGNF:LAMB93"
    own = {"site": "RTL*2.4*48.8*0*wgs", "wgs": "EPSG:4326"}
    assert parse("site", own).definition == "RTL*2.4*48.8*0*EPSG:4326"


def test_equality_is_that_of_definitions() -> None:
    assert parse("RTL*657700*6860700*0*L93") == parse("RTL*657700*6860700*0*IGNF:LAMB93")
    assert parse("RTL*657700*6860700*0*L93") != parse("RTL*657700*6860701*0*L93")
    assert parse("EPSG:2154") != parse("IGNF:LAMB93")
    assert parse("LocalA") != parse("LocalB")
    assert len({parse("GeoC"), parse("GeoC"), parse("Local")}) == 2


def test_one_trailing_star_is_tolerated() -> None:
    assert parse("RTL*657700*6860700*0*L93*") == parse("RTL*657700*6860700*0*L93")
    assert parse("LEuc*1*2*3*0*0*0*").definition == "LEuc*1*2*3*0*0*0"


@pytest.mark.parametrize(
    ("definition", "message"),
    [
        ("RTL*1*2*3", r"Malformed definition 'RTL\*1\*2\*3': expected RTL\*X0\*Y0\*Z0\*DEFINITION"),
        ("RTL*1*2*3*L93*4", "expected RTL"),
        ("RTL*1*2*3*L93**", "expected RTL"),
        ("RTL*1*2*3*", "expected RTL"),
        ("RTL*", "expected RTL"),
        ("RTLx*1*2*3*L93", "expected RTL"),
        ("RTL*1*two*3*L93", "'two' is not a number"),
        ("RTL*1*nan*3*L93", "'nan' is not a number"),
        ("RTL*1*inf*3*L93", "'inf' is not a number"),
        ("RTL*1*2*3*GeoC", "must be given in a system that PROJ knows, not in 'GeoC'"),
        ("RTL*1*2*3*foo", "Unknown coordinate system 'foo'"),
        ("RTL*2*95*0*EPSG:4326", r"Point origin of RTL\*2\*95\*0\*EPSG:4326 .* outside the domain"),
        ("LEuc*1*2*3*4*5", r"Malformed definition 'LEuc\*1\*2\*3\*4\*5': expected LEuc"),
        ("LEuc*1*2*3*4*5*x", "'x' is not a number"),
        ("foo", "Unknown coordinate system 'foo'. Accepted: Local..., GeoC, LEuc.*EPSG:2154.*PROJ said"),
        ("", "Unknown coordinate system ''"),
        ("EPSG:99999999", "EPSG:99999999"),
        ("+proj=foo", r"Unknown coordinate system '\+proj=foo'"),
        ("EPSG:5720", r"'EPSG:5720' \(NGF-IGN69 height, Vertical CRS\) does not give a position"),
        ("+proj=pipeline +step +proj=utm +zone=31", "is a transformation"),
    ],
)
def test_messages_of_bad_definitions(definition, message) -> None:
    with pytest.raises(CrsError, match=message) as caught:
        parse(definition)
    assert isinstance(caught.value, ObseqError)


def test_rtl_completed_at_the_mean_of_points() -> None:
    """The mean of TopoMini: (657705, 6860700, 10), geocentric position from the reference, section 15.5."""
    points = [[657700, 6860700, 10], [657710, 6860700, 10], [657710, 6860710, 10], [657700, 6860690, 10]]
    frame = crs.complete_rtl(np.array(points, dtype=float), parse("L93"))
    assert isinstance(frame, LocalTangent)
    assert frame.definition == "RTL*657705.00000000*6860700.00000000*10.00000000*IGNF:LAMB93"
    assert frame.translation == pytest.approx([4201676.882175, 177842.876148, 4779236.877570], abs=1e-5)
    assert parse(frame.definition) == frame
    assert parse(frame.definition).geocentric_pose()[1] == pytest.approx(frame.translation, abs=0.0)


def test_origin_is_what_the_eight_decimals_say() -> None:
    frame = crs.rtl_at([2.123456789012, -0.0000000001, 1.5], parse("EPSG:4326"))
    assert frame.definition == "RTL*2.12345679*0.00000000*1.50000000*EPSG:4326"
    assert frame.origin == (2.12345679, 0.0, 1.5)
    assert frame.to_geocentric([0.0, 0.0, 0.0]) == pytest.approx(
        parse(frame.definition).to_geocentric([0.0, 0.0, 0.0]), abs=0.0
    )


def test_rtl_from_a_system_that_is_not_projs() -> None:
    base = parse("RTL*657700*6860700*0*L93")
    frame = crs.complete_rtl([[0.0, 0.0, 0.0], [200.0, 0.0, 0.0]], base)
    assert frame.base.definition == "+proj=geocent +datum=WGS84"
    assert base.from_geocentric(frame.translation) == pytest.approx([100.0, 0.0, 0.0], abs=1e-7)


def test_rtl_completed_across_the_date_line() -> None:
    points = [[179.9995, -17.0, 10.0], [-179.9995, -17.0, 12.0]]
    frame = crs.complete_rtl(points, parse("EPSG:4326"))
    assert np.abs(crs.Transformer(parse("EPSG:4326"), frame).forward(points)).max() < 60.0
    assert crs.side_by_side(np.array(points), parse("L93")).tolist() == points


def test_rtl_cannot_be_completed_without_a_place() -> None:
    with pytest.raises(CrsError, match="at least one point"):
        crs.complete_rtl(np.empty((0, 3)), parse("L93"))
    with pytest.raises(CrsError, match="'LocalA' is local"):
        crs.complete_rtl([[0.0, 0.0, 0.0]], parse("LocalA"))
    with pytest.raises(CrsError, match=r"index 1 .* the mean of the points is undefined"):
        crs.complete_rtl([[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0]], parse("L93"))


@pytest.mark.parametrize(
    ("definition", "message"),
    [("LocalA", "no place on the Earth, no vertical"), ("RTL", "no origin yet: complete it")],
)
def test_unreferenced_systems_refuse_everything(definition, message) -> None:
    system, points = parse(definition), np.zeros((2, 3))
    for ask in (system.to_geocentric, system.from_geocentric, system.geodetic, system.vertical_rotation):
        with pytest.raises(CrsError, match=message):
            ask(points)
    with pytest.raises(CrsError, match=message):
        system.geocentric_pose()


def test_proj_is_loaded_when_first_needed() -> None:
    code = (
        "import sys; from obseq import crs; crs.parse('GeoC'); crs.parse('LocalA'); "
        "crs.parse('LEuc*1*2*3*0*0*0').to_geocentric([1, 2, 3]); assert 'pyproj' not in sys.modules; "
        "crs.parse('L93'); assert 'pyproj' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
