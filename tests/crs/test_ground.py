"""Heights and verticals of old datums: above the ellipsoid of the system, along its normals."""

import numpy as np
import pytest

from obseq import crs
from obseq.crs import ground

GRIDS = {
    "EPSG:2056": (2600000.0, 1200000.0),
    "EPSG:21781": (600000.0, 200000.0),
    "EPSG:2100": (500000.0, 4200000.0),
    "EPSG:28992": (155000.0, 457000.0),
    "EPSG:31370": (158000.0, 132000.0),
    "EPSG:5514": (-700000.0, -1050000.0),
    "EPSG:23700": (650000.0, 185000.0),
    "EPSG:29902": (200000.0, 195000.0),
    "EPSG:27572": (600000.0, 2200000.0),
}


def around(definition):
    """A frame of a system of the plan, and points of one height and a second one, in it and in the system."""
    system = crs.parse(definition)
    x, y = GRIDS[definition]
    steps = np.array([[0, 0, 0], [2000, 0, 0], [0, 2000, 0], [-1500, -900, 0], [700, -1200, 300]], np.float64)
    points = np.array([x, y, 500.0]) + steps
    frame = crs.complete_rtl(points, system)
    return frame, points, crs.Transformer(system, frame)


@pytest.mark.parametrize("definition", GRIDS)
def test_what_is_level_in_a_national_grid_is_level_in_its_frame(definition):
    frame, points, to_frame = around(definition)
    assert not frame.ground.is_plain
    heights = frame.ground.geodetic(frame.to_geocentric(to_frame.forward(points)))[:, 2]
    np.testing.assert_allclose(heights, points[:, 2], rtol=0, atol=2e-6)
    plain = frame.geodetic(to_frame.forward(points))[:, 2]
    assert np.ptp(plain[:4]) > 0.01  # WGS 84 is tilted against it: that is what is avoided


@pytest.mark.parametrize("definition", GRIDS)
def test_up_is_where_heights_grow(definition):
    frame, points, to_frame = around(definition)
    here, higher = to_frame.forward(points), to_frame.forward(points + np.array([0.0, 0.0, 1000.0]))
    up = (higher - here) / np.linalg.norm(higher - here, axis=1)[:, None]
    np.testing.assert_allclose(frame.vertical_rotation(here)[:, 2], up, rtol=0, atol=1e-10)
    single = crs.Normals(frame).at(tuple(here[1].tolist()))
    np.testing.assert_allclose(single, frame.vertical_rotation(here)[1], rtol=0, atol=1e-12)


def test_the_vertical_turns_as_its_derivative_says():
    frame, points, to_frame = around("EPSG:2100")
    here = to_frame.forward(points)
    axes = frame.vertical_rotation(here)
    moved = frame.vertical_rotation(here + np.array([0.0, 100.0, 0.0]))
    turn = crs.turn_of_vertical(frame, here, axes)[:, :, 1] * 100.0
    expected = axes[:, 2] + np.cross(turn, axes[:, 2])
    np.testing.assert_allclose(moved[:, 2], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "definition",
    ["RTL*700000*6600000*0*EPSG:2154", "RTL*500000*5500000*0*EPSG:25832", "RTL*2.4*48.8*0*EPSG:4326"],
)
def test_where_no_datum_changes_heights_are_above_the_ellipsoid_of_wgs_84(definition):
    assert crs.parse(definition).ground is crs.WGS84


def test_heights_that_are_kept_are_above_that_of_wgs_84():
    assert crs.rtl_at([2600000.0, 1200000.0, 500.0], crs.parse("EPSG:2056@h")).ground is crs.WGS84


def test_a_frame_takes_over_the_heights_of_another_system():
    frame, points, _ = around("EPSG:2056")
    other = crs.parse("RTL*7.44*46.95*0*EPSG:4326")
    assert other.ground is crs.WGS84
    taken = other.with_heights_of(frame.base, points[0])
    heights = taken.ground.geodetic(frame.base.to_geocentric(points))[:, 2]
    np.testing.assert_allclose(heights, points[:, 2], rtol=0, atol=2e-6)
    assert taken == other


def test_a_change_of_datum_that_bends_the_ellipsoid_is_refused_where_verticals_are_asked_for(monkeypatch):
    monkeypatch.setattr(ground, "_RIGID", -1.0)
    frame, points, to_frame = around("EPSG:5514")
    moved = to_frame.forward(points)  # coordinates need none
    ground._ground_of.cache_clear()
    with pytest.raises(crs.CrsError, match=r"'EPSG:5514' bends the ellipsoid .* `@h`"):
        frame.vertical_rotation(moved)
