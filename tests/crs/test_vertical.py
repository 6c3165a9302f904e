"""The vertical at points (reference, sections 7, 14.3 and 15.3)."""

import numpy as np
import pytest

from obseq.crs import CrsError, east_north_up, parse, turn_of_vertical

ORIGINS = [(0, 0), (55, 0), (0, 55), (55, 55), (-55, 0), (0, -55), (-55, -55)]
POINTS = np.array(
    [[0, 0, 0], [100, 10, 1], [-30, 80, -20], [1000, 0, 0], [0, 1000, 0], [0, 0, 1000], [-1000, 1000, 1000]],
    dtype=float,
)
SYSTEMS = [f"RTL*{lon}*{lat}*0*EPSG:4326" for lon, lat in ORIGINS]
SYSTEMS.append("LEuc*4201661*177860*4779236*0.1*-0.2*2.5")


@pytest.mark.parametrize("definition", SYSTEMS)
def test_up_leads_to_the_point_a_kilometre_higher(definition) -> None:
    system = parse(definition)
    up = np.swapaxes(system.vertical_rotation(POINTS), 1, 2) @ [0.0, 0.0, 1000.0]
    below, above = system.geodetic(POINTS), system.geodetic(POINTS + up)
    assert above[:, 2] - below[:, 2] == pytest.approx(np.full(len(POINTS), 1000.0), abs=1e-7)
    assert above[:, :2] == pytest.approx(below[:, :2], abs=1e-14)


@pytest.mark.parametrize("definition", SYSTEMS)
def test_east_raises_the_longitude_and_north_the_latitude(definition) -> None:
    system = parse(definition)
    axes = system.vertical_rotation(POINTS)
    start = system.geodetic(POINTS)
    eastwards, northwards = (system.geodetic(POINTS + axes[:, k]) - start for k in (0, 1))
    assert (eastwards[:, 0] > 1.5e-7).all()
    assert np.abs(eastwards[:, 1]).max() < 1e-12
    assert (northwards[:, 1] > 1.5e-7).all()
    assert np.abs(northwards[:, 0]).max() < 1e-14


@pytest.mark.parametrize("definition", SYSTEMS)
def test_it_is_a_rotation(definition) -> None:
    axes = parse(definition).vertical_rotation(POINTS)
    assert axes @ np.swapaxes(axes, 1, 2) == pytest.approx(np.tile(np.eye(3), (len(POINTS), 1, 1)), abs=1e-14)
    assert np.linalg.det(axes) == pytest.approx(np.ones(len(POINTS)))


def test_it_is_the_identity_at_the_origin() -> None:
    assert parse(SYSTEMS[3]).vertical_rotation([0.0, 0.0, 0.0]) == pytest.approx(np.eye(3), abs=1e-14)


def test_tilt_of_the_bench_example_3() -> None:
    """Reference, section 15.1: R[0][2], R[1][2] and R[1][0] at (100, 100, 100)."""
    rotation = parse("RTL*45*0*0*+proj=latlong").vertical_rotation([[100.0, 100.0, 100.0]])[0]
    assert rotation[0, 2] == pytest.approx(-1.56783e-5, abs=5e-11)
    assert rotation[1, 2] == pytest.approx(-1.57840e-5, abs=5e-11)
    assert rotation[1, 0] == pytest.approx(-2.5e-10, abs=5e-12)


def test_exchanged_longitude_and_latitude_would_show() -> None:
    """At (longitude 45, latitude 0) the tilts east and north differ by the flattening, 0.7 percent.

    East, the radius is the equatorial one; north, the meridian's a (1 - e2) at the equator. Exchanged, both
    radii would be those of latitude 45.
    """
    rotation = parse("RTL*45*0*0*EPSG:4326").vertical_rotation([[1000.0, 1000.0, 0.0]])[0]
    a, e2 = 6378137.0, 0.0066943799901413165
    assert rotation[0, 2] == pytest.approx(-1000.0 / a, rel=1e-6)
    assert rotation[1, 2] == pytest.approx(-1000.0 / (a * (1.0 - e2)), rel=1e-6)


def test_geocentric_vertical_is_east_north_up() -> None:
    system = parse("GeoC")
    point = parse("Geog").to_geocentric([[30.0, 60.0, 200.0]])
    # rows east, north, up at longitude 30, latitude 60: cos 60 cos 30 = sqrt(3)/4
    half, root = 0.5, np.sqrt(3.0) / 2.0
    expected = [[-half, root, 0.0], [-root * root, -root * half, half], [half * root, half * half, root]]
    assert system.vertical_rotation(point)[0] == pytest.approx(np.array(expected), abs=1e-14)
    turned_back = east_north_up(np.pi / 6, np.pi / 3).transpose()
    assert turned_back == pytest.approx(np.array(expected), abs=1e-15)


@pytest.mark.parametrize("definition", ["IGNF:LAMB93", "EPSG:4326", "EPSG:4978"])
def test_proj_definitions_have_no_such_rotation(definition) -> None:
    with pytest.raises(CrsError, match=f"'{definition}' to the vertical.*local tangent frame"):
        parse(definition).vertical_rotation([[657700.0, 6860700.0, 0.0]])


@pytest.mark.parametrize("definition", SYSTEMS)
def test_it_turns_with_its_point(definition) -> None:
    """By differences over 200 m: a turn t of the axes V moves each of them by t x axis."""
    system = parse(definition)
    axes = system.vertical_rotation(POINTS)
    turns = turn_of_vertical(system, POINTS, axes)
    for k, step in enumerate(100.0 * np.eye(3)):
        change = (system.vertical_rotation(POINTS + step) - system.vertical_rotation(POINTS - step)) / 200.0
        expected = np.cross(turns[:, None, :, k], axes)
        np.testing.assert_allclose(change, expected, rtol=0, atol=5e-16)
    assert 1.5e-7 < np.abs(turns).max() < 5e-7  # 1 / 6.4e6 m, and the convergence of the meridians
