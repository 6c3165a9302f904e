"""Known coordinates hold in the system of the points, and are reported like observations."""

import json

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.survey import Network

LAMBERT = "IGNF:LAMB93"
FEET = (
    "+proj=lcc +lat_1=49 +lat_2=44 +lat_0=46.5 +lon_0=3 +x_0=700000 +y_0=6600000 +ellps=GRS80 "
    "+towgs84=0,0,0 +units=us-ft"
)


def adjusted(shared_data, observations, points, **options):
    folder = shared_data / "field-cases" / "height-constraint"
    frame = f"RTL*657700*6860700*0*{LAMBERT}"
    network = Network.read(folder / observations, folder / points, frame=frame, points_crs=LAMBERT, **options)
    return network.adjust()


@pytest.mark.parametrize("approximate", ["h0", "h1", "h50"])
def test_a_known_height_is_a_height_ten_kilometres_from_the_origin(shared_data, approximate):
    result = adjusted(shared_data, "h.obs", f"{approximate}.cor")
    np.testing.assert_allclose(result.points.crs_coordinates[2, 2], 120.0, rtol=0, atol=1e-7)
    # The height takes its sigma; the two distances fix the plan.
    np.testing.assert_allclose(result.points.crs_precisions[2, 2], 1e-3, rtol=1e-6)
    assert result.converged


@pytest.mark.parametrize("points", ["p0", "p50", "q0", "q50"])
def test_a_known_plan_is_a_plan_whatever_the_approximate_height(shared_data, points):
    result = adjusted(shared_data, "p.obs", f"{points}.cor")
    np.testing.assert_allclose(
        result.points.crs_coordinates[2], (667800.0, 6860500.0, 120.0), rtol=0, atol=1e-6
    )
    if points.startswith("q"):  # held: no precision in plan, all of the levelling in height
        sx, sy, _ = result.points.crs_precisions[2]
        assert max(sx, sy) < 1e-9


def test_residuals_of_known_coordinates_are_in_the_record(tmp_path):
    # A known 10.004 apart from B at 10.000, sigmas 1 and 1 mm and 2 mm of the distance: 4 mm split 1 : 4 : 1.
    (tmp_path / "n.cor").write_text("1 A 0 0 0 0.001 0 0\n1 B 10 0 0 0.001 0 0\n")
    (tmp_path / "n.obs").write_text("3 A B 10.006 0.002\n")
    record = Network.read(tmp_path / "n.obs", tmp_path / "n.cor").adjust().to_dict()
    first, second = record["constraints"]
    assert (first["point"], first["coordinate"], first["line"]) == ("A", "x", 1)
    assert (first["residual"], second["residual"]) == pytest.approx((-1e-3, 1e-3), rel=1e-9)
    assert second["normalised_residual"] == pytest.approx(1.0, rel=1e-9)
    assert record["observations"][0]["residual"] == pytest.approx(-4e-3, rel=1e-9)
    assert (record["n_observations"], record["n_constraints"], record["redundancy"]) == (1, 2, 1)
    json.dumps(record)


def test_sigmas_are_metres_in_systems_of_other_units(shared_data):
    folder = shared_data / "field-cases" / "units"
    metric = Network.read(folder / "net.obs", folder / "NTFgr.cor", frame="RTL", points_crs="EPSG:4807")
    feet = Network.read(folder / "net.obs", folder / "usft.cor", frame="RTL", points_crs=FEET)
    one, other = metric.adjust(), feet.adjust()
    # Heights are above the ellipsoid of NTF; the angles were made with normals of WGS 84: 8 mm per km.
    assert one.sigma0 == pytest.approx(other.sigma0, rel=1e-3)
    assert one.to_dict()["points_crs_unit"] == "grad"
    assert other.to_dict()["points_crs_unit"] == "US survey foot"
    assert other.to_dict()["points_crs_height_unit"] == "m"
    np.testing.assert_allclose(one.points.crs_precisions, other.points.crs_precisions, rtol=0.02)
    for result in (one, other):
        names = [row["coordinate"] for row in result.to_dict()["constraints"]]
        assert names == ["x", "y", "z"] * 3
        assert max(abs(row["residual"]) for row in result.to_dict()["constraints"]) < 0.01


def test_a_constraint_works_across_the_date_line(tmp_path):
    (tmp_path / "n.cor").write_text("1 A 179.99999 10 0 0.001\n1 B -179.99999 10 0 0.001\n")
    (tmp_path / "n.obs").write_text("3 A B 2.193 0.002\n")
    result = Network.read(
        tmp_path / "n.obs", tmp_path / "n.cor", points_crs="EPSG:4326", frame="RTL*180*10*0*EPSG:4326"
    )
    assert max(abs(row["residual"]) for row in result.adjust().to_dict()["constraints"]) < 0.01


def test_the_frame_of_a_network_across_the_date_line_is_there(tmp_path):
    (tmp_path / "n.obs").write_text("3 A P 80.070 0.002\n3 B P 80.136 0.003\n4 A P 1.0 0.01\n")
    found = []
    for longitude in (-179.9995, 180.0005):
        (tmp_path / "n.cor").write_text(
            f"1 A 179.9995 -17 10 0.001\n1 B {longitude} -17 10 0.001\n0 P 180 -17.0005 9\n"
        )
        network = Network.read(tmp_path / "n.obs", tmp_path / "n.cor", points_crs="EPSG:4326")
        found.append(network.adjust())
    assert found[0].frame == found[1].frame
    np.testing.assert_allclose(
        found[0].points.covariances, found[1].points.covariances, rtol=1e-6, atol=1e-12
    )


def test_a_point_known_at_a_pole_is_refused_by_name(tmp_path):
    (tmp_path / "n.cor").write_text("1 A 0 90 0 0.001\n1 B 0 89.999 0 0.001\n0 P 90 89.999 9\n")
    (tmp_path / "n.obs").write_text("3 A P 80.070 0.002\n3 B P 80.136 0.003\n4 A P 1.0 0.01\n")
    with pytest.raises(InputError, match=r"point A \(.*n.cor:1\) is known at a pole"):
        Network.read(tmp_path / "n.obs", tmp_path / "n.cor", points_crs="EPSG:4326").adjust()
