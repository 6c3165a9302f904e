"""Networks near a pole, of weak datum, and free ones of which one thing is known: what others got wrong."""

import numpy as np
import pytest
from outside import OutsideData

from obseq.survey import Datum, Network, Quality

CASES = "verdict-cases"


def read(name, frame, **more):
    folder = OutsideData() / CASES / name
    return Network.read(folder / "a.obs", folder / "a.cor", frame=frame, **more)


@pytest.mark.parametrize(
    ("name", "frame", "more", "sigma0", "whole"),
    [
        (
            "02-pole",
            "RTL*-172.54436241806692*-89.97457027681882*0*EPSG:4326",
            {"points_crs": "EPSG:4326"},
            0.96650,
            89.4948 / 90,
        ),
        (
            "fa_4251",
            "RTL*120.47641955883734*-89.97666178049114*0*EPSG:4326",
            {"points_crs": "EPSG:4326", "refraction": 0.0},
            0.89464,
            0.8175,
        ),
        (
            "fa_4158",
            "RTL*25.202274520873715*17.534062074131725*0*EPSG:4326",
            {"refraction": 0.2},
            1.15356,
            45.2435 / 34,
        ),
    ],
)
def test_exact_derivatives_need_three_iterations(name, frame, more, sigma0, whole):
    """Wherever plumb lines turn much: near a pole, or where curvature alone holds a network to 768 m."""
    found = read(name, frame, **more).adjust()
    assert found.converged and len(found.solution.iterations) == 3
    assert found.sigma0 == pytest.approx(sigma0, rel=2e-5)
    assert found.solution.variance_factor == pytest.approx(whole, rel=1e-4)
    assert not found.gross_errors and not found.warnings


FREE = "RTL*1.3531152325011035*44.411357323372066*0*EPSG:4326"


@pytest.mark.parametrize(
    ("name", "redundancy"),
    [("05-inner-one_y_of_a_known_point_sigma_0", 72 - 23 + 3), ("05-inner-one_DistHz0", 73 - 24 + 4)],
)
def test_one_known_thing_of_a_free_network(name, redundancy):
    """One coordinate held takes one motion; a distance at height 0 sees the height by the curvature alone."""
    found = read(name, FREE).adjust(datum=Datum("inner"))
    assert found.converged and len(found.solution.iterations) <= 3
    assert found.solution.redundancy == redundancy
    assert found.book.observations.active.all() and not found.gross_errors


def test_levelled_differences_on_the_inner_datum():
    """Differences of two geodetic heights would carry 1e-9 m of rounding, which no step ends below."""
    found = read("inner-dh", "RTL*3.0*47.0*0*EPSG:4326").adjust(datum=Datum("inner"))
    assert found.converged and len(found.solution.iterations) <= 3
    assert found.sigma0 == pytest.approx(0.937253, rel=1e-5)


def inner(network):
    found = network.adjust(quality=Quality(inner=True))
    return np.array([point.inner for point in found.record().points]) / found.sigma0


@pytest.mark.parametrize("name", ["with21", "with22"])
def test_an_equality_without_weight_changes_no_inner_precision(name):
    folder = OutsideData() / CASES / "inner21"
    found, plain = (inner(Network.read_project(folder / part / "n.comp")) for part in (name, "plain"))
    np.testing.assert_allclose(found, plain, rtol=1e-3)
    assert plain.max() < 3e-4


def test_a_chord_without_weight_changes_no_inner_precision():
    """The last line of o.csv has a sigma of half a metre; plain.csv has all the others."""
    folder = OutsideData() / CASES / "inner-chord"
    frame = "RTL*3.0*47.0*0*EPSG:4326"
    files = [[folder / "p.csv", folder / f"{name}.csv"] for name in ("o", "plain")]
    found, plain = (inner(Network.read_project(paths, frame=frame)) for paths in files)
    np.testing.assert_allclose(found, plain, rtol=1e-4)
    assert plain.max() < 3e-4


def test_a_coordinate_of_another_system_is_held_exactly(tmp_path):
    """A northing of UTM, 2 degrees beside its meridian: the axes of the frame are 1.5 degrees off it."""
    (tmp_path / "p.csv").write_text(
        "name,x,y,z,sx,sy,sz\nA,650000,5300000,100,0.01,0,0.01\nB,650080,5300010,102,0.01,0.01,0.01\n"
        "C,650050,5300070,99,,,\nD,649990,5300060,104,,,\n"
    )
    places = {"A": (0, 0, 0), "B": (80, 10, 2), "C": (50, 70, -1), "D": (-10, 60, 4)}
    rows = ["type,from,to,value,sigma"]
    for k, (a, b) in enumerate((a, b) for a in places for b in places if a < b):
        distance = float(np.linalg.norm(np.subtract(places[a], places[b])))
        rows.append(f"Dist,{a},{b},{distance + 0.02 * (-1) ** k},0.01")
        rows.append(f"DH,{a},{b},{places[b][2] - places[a][2]},0.001")
    (tmp_path / "o.csv").write_text("\n".join(rows) + "\n")
    frame = "RTL*650000*5300000*100*EPSG:32631"
    files = [tmp_path / "p.csv", tmp_path / "o.csv"]
    found = Network.read_project(files, frame=frame, points_crs="EPSG:32631").adjust(datum=Datum("inner"))
    assert found.converged
    assert found.points.crs_coordinates[0, 1] == pytest.approx(5300000.0, abs=1e-7)
    assert abs(found.points.crs_coordinates[1, 1] - 5300010.0) > 1e-3
    assert found.points.crs_precisions[0, 1] < 1e-9 < found.points.crs_precisions[0, 0]
