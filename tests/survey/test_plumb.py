"""Heights of instrument and target, relative sigmas, deflections, and frames that nobody named."""

import math

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.survey import Network, simulate

GON = math.pi / 200.0


def read(folder, observations, points, **options):
    (folder / "net.obs").write_text(observations)
    (folder / "net.cor").write_text(points)
    return Network.read(folder / "net.obs", folder / "net.cor", **options)


def sights(origin, target, rise):
    """Direction, zenith angle and slope distance in a plane, of a target `rise` above the instrument."""
    east, north = target[0] - origin[0], target[1] - origin[1]
    flat = math.hypot(east, north)
    return math.atan2(east, north) / GON, math.atan2(flat, rise) / GON, math.hypot(flat, rise)


def test_heights_of_instrument_and_target_are_used(tmp_path):
    # Instrument 1.6 m above S (0, 0, 0), prism 1.9 m above A (0, 100, 5) and 0.2 m above P (30, 40, 2).
    lines = []
    for name, target, height in (("A", (0, 100, 5), 1.9), ("P", (30, 40, 2), 0.2)):
        hz, zen, dist = sights((0, 0), target, target[2] + height - 1.6)
        for code, value in ((5, hz), (6, zen), (3, dist)):
            lines.append(f"{code} S {name} {value:.12f} 0.001 0 1.6 {height}")
    lines += ["4 S P 0.6 0.001 0 1.6 0.2", "4 S A 5.3 0.001 0 1.6 1.9"]
    points = "1 S 0 0 0 0.001\n1 A 0 100 5 0.001\n0 P 20 30 3\n"
    result = read(tmp_path, "\n".join(lines), points, refraction=1.0).adjust()
    np.testing.assert_allclose(result.points.coordinates[2], (30, 40, 2), rtol=0, atol=1e-8)
    assert result.sigma0 < 1e-6
    ignored = read(tmp_path, "\n".join(lines), points, refraction=1.0, ignore=["heights"]).adjust()
    assert ignored.sigma0 > 20.0


def test_relative_sigmas_grow_with_the_distance(tmp_path):
    observations = "3 S P 100 0.001 1e-5\n7 S A 0 0.001 0.002\n5 S P 100 0.001 0.002\n4 S P 0 0.001 2e-5\n"
    points = "1 S 0 0 0 0.001\n1 A 0 50 0 0.001\n0 P 100 0 0\n"
    result = read(tmp_path, observations, points).adjust()
    # 1 mm + 10 ppm of 100 m; 1 mgon + 2 mm at 50 and at 100 m; 1 mm + 20 ppm of 100 m.
    mgon = 1e-3 * GON
    expected = (2e-3, mgon + 4e-5, mgon + 2e-5, 3e-3)
    assert result.sigmas == pytest.approx(expected, rel=1e-6)
    assert [row["sigma"] for row in result.to_dict()["observations"]] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("options", [{}, {"ignore": ["deflections"]}])
def test_a_deflection_tilts_the_instrument(shared_data, options):
    folder = shared_data / "field-cases" / "deflection-ignored"
    result = Network.read(folder / "d.obs", folder / "d.cor", refraction=1.0, **options).adjust()
    # East 10", north -20": towards P, north-east, the plumb line leans by (10 - 20)/sqrt 2 = -7.07".
    # A horizontal sight of 70.71 m then rises by 2.424 mm.
    tilt = -(10 - 20) / math.sqrt(2) / 3600 * math.pi / 180
    expected = 0.0 if options else 70.71 * tilt
    assert result.points.coordinates[2, 2] == pytest.approx(expected, abs=1e-6)


def test_levelling_follows_the_slope_of_level_surfaces(tmp_path):
    # Plumb lines lean by 20" to the east at both ends: over 1000 m eastwards, 97 mm.
    points = "1 A 0 0 0 0.001 0.001 0.001 20 0\n3 B 1000 0 0 0.001 0.001 -1 20 0\n"
    points = points.replace("3 B 1000 0 0 0.001 0.001 -1", "1 B 1000 0 0 0.001 0.001 -1")
    result = read(tmp_path, "4 A B 1 0.001\n", points).adjust()
    assert result.points.coordinates[1, 2] == pytest.approx(1 - 1000 * math.radians(20 / 3600), abs=1e-6)


def test_a_missing_deflection_is_named(tmp_path):
    points = "1 A 0 0 0 0.001 0.001 0.001 20 0\n1 B 1000 0 0 0.001\n0 C 0 0 0\n"
    with pytest.raises(InputError, match=r"these have none where one is needed: B, C.*--ignore deflections"):
        read(
            tmp_path,
            "4 B C 1 0.001\n3 A C 10 0.1\n3 B C 10 0.1\n",
            points.replace("0 C 0 0 0", "0 C 500 0 0"),
        ).adjust()


def test_heights_need_a_vertical(tmp_path):
    points = "1 A 700000 6600000 0 0.001\n0 B 700010 6600000 0\n1 C 700000 6600010 0 0.001\n"
    points += "1 D 700000 6600000 10 0.001\n"
    observations = "3 A B 10 0.001\n3 C B 14.1 0.001\n3 D B 14 0.001 0 1.5 0\n"
    with pytest.raises(InputError, match=r"Dist D -> B .*height of instrument or target"):
        read(tmp_path, observations, points, frame="IGNF:LAMB93").adjust()


def test_an_azimuth_needs_a_horizon(tmp_path):
    (tmp_path / "n.obs").write_text("8 A P 100 0.001\n3 A P 100 0.001\n4 A P 0 0.001\n")
    (tmp_path / "n.cor").write_text("1 A 4680890 1254240 4133148 0 0 0\n0 P 4680990 1254240 4133148\n")
    network = Network.read(tmp_path / "n.obs", tmp_path / "n.cor", frame="GeoC")
    with pytest.raises(
        InputError, match=r"Azim A -> P \(.*n\.obs:1\): an azimuth is .* in the horizon"
    ) as told:
        network.adjust()
    with pytest.raises(InputError) as again:
        simulate(network, 1)
    assert str(again.value) == str(told.value)


PLAIN = "1 A 0 0 10 0.001\n1 B 100 0 12 0.001\n0 P 20 30 3\n"


def test_without_a_frame_every_kind_of_observation_works(tmp_path):
    # P at (40, 30, 15): curvature and refraction lift the line of sight by (1 - 0.12) D^2 / 2R.
    observations = []
    for name, origin in (("A", (0, 0, 10)), ("B", (100, 0, 12))):
        hz, zen, dist = sights(origin, (40, 30), 15 - origin[2])
        flat = math.hypot(40 - origin[0], 30 - origin[1])
        zen += 0.88 * flat / (2 * 6371008.8) / GON
        observations += [
            f"7 {name} P {hz:.12f} 0.001",
            f"6 {name} P {zen:.12f} 0.001",
            f"3 {name} P {dist:.12f} 0.001",
        ]
        observations += [f"4 {name} P {15 - origin[2]} 0.001", f"8 {name} P {hz:.12f} 0.001"]
    result = read(tmp_path, "\n".join(observations), PLAIN).adjust()
    np.testing.assert_allclose(result.points.coordinates[2], (40, 30, 15), rtol=0, atol=1e-8)
    assert result.sigma0 < 1e-6
    assert result.frame == "Local"
    refraction, plane = result.notes
    assert (
        "refraction coefficient 0.12: zenith angles are corrected for refraction and the curvature"
        in refraction
    )
    assert "plane frame with parallel verticals: over this network, 104.4 m across and 5 m of height" in plane


def test_a_plane_agrees_with_the_ellipsoid_over_a_small_site(shared_data):
    # comp3d-minimal lies within 15 m; both frames must say the same to a micrometre.
    folder = shared_data / "field-cases" / "trilateration"
    one = Network.read(folder / "t.obs", folder / "t.cor").adjust()
    other = Network.read(folder / "t.obs", folder / "t.cor", frame="RTL*2.4*48.8*0*EPSG:4326").adjust()
    np.testing.assert_allclose(one.points.coordinates, other.points.coordinates, rtol=0, atol=1e-6)


def test_the_points_choose_the_frame_when_only_their_system_is_given(shared_data):
    folder = shared_data / "field-cases" / "height-constraint"
    network = Network.read(folder / "p.obs", folder / "p50.cor", points_crs="IGNF:LAMB93")
    assert network.frame.system.definition.startswith("RTL*667800.00000000*6860700.00000000*")
    np.testing.assert_allclose(network.adjust().points.crs_coordinates[2, 2], 120.0, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", ["triangle", "levelling"])
@pytest.mark.parametrize("frame", [None, "RTL*2.4*48.8*0*EPSG:4326"])
def test_levelling_converges_in_four_iterations(shared_data, name, frame):
    folder = shared_data / "field-cases" / "not-converged-levelling"
    result = Network.read(folder / f"{name}.obs", folder / f"{name}.cor", frame=frame).adjust()
    assert result.converged
    assert len(result.solution.iterations) <= 4


def test_the_refraction_coefficient_is_an_option_and_is_told(tmp_path):
    observations = "#FIX\n5 A P 50 0.001\n6 A P 100 0.001\n3 A P 1000 0.001\n5 B P 350 0.001\n"
    rises = []
    for coefficient in (0.0, 0.12, 1.0):
        result = read(
            tmp_path, observations, PLAIN.replace("B 100", "B 1414.2136"), refraction=coefficient
        ).adjust()
        rises.append(result.points.coordinates[2, 2] - 10)
        assert any(f"refraction coefficient {coefficient:g}" in note for note in result.notes)
    # D^2 (1 - k) / 2R with D = 1000 m.
    assert rises == pytest.approx([1e6 * (1 - k) / (2 * 6371008.8) for k in (0.0, 0.12, 1.0)], abs=1e-4)
