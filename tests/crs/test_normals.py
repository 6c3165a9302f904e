import numpy as np
import pytest

from obseq import crs


@pytest.mark.parametrize("origin", ["2.4*48.8*0", "0*0*0", "-70*-45*3000", "10*89.9*0", "179.9*12*-400"])
def test_the_vertical_of_one_point_is_that_of_arrays(origin):
    system = crs.parse(f"RTL*{origin}*EPSG:4326")
    points = np.random.default_rng(1).uniform(-2e5, 2e5, (50, 3)) * (1.0, 1.0, 0.02)
    expected = system.vertical_rotation(points)
    normals = crs.Normals(system)
    found = np.array([normals.at(tuple(point)) for point in points.tolist()])
    np.testing.assert_allclose(found, expected, rtol=0, atol=5e-15)
    np.testing.assert_array_equal(normals(points), expected)


def test_absurd_places_have_some_vertical():
    system = crs.parse("RTL*0*0*0*EPSG:4326")
    found = np.array(crs.Normals(system).at((0.0, 0.0, -6378137.0)))
    assert np.isfinite(found).all()
