"""Exact observations in national grids on old datums, simulated on their ellipsoids: nothing is left."""

import numpy as np
import pytest
from pyproj import CRS, Transformer

from obseq.errors import InputError
from obseq.formats.conversion import as_dynaml
from obseq.survey import Network

GON = np.pi / 200.0


def geocentric(definition, points):
    """Longitude, latitude (rad) and geocentric coordinates along the axes of the datum of a grid."""
    geodetic = CRS(definition).geodetic_crs
    unit = geodetic.axis_info[0].unit_conversion_factor
    convert = Transformer.from_crs(definition, geodetic, always_xy=True)
    lon, lat = np.array(convert.transform(points[:, 0], points[:, 1])) * unit
    a, f = geodetic.ellipsoid.semi_major_metre, 1.0 / geodetic.ellipsoid.inverse_flattening
    squared = f * (2.0 - f)
    normal = a / np.sqrt(1.0 - squared * np.sin(lat) ** 2)
    flat = (normal + points[:, 2]) * np.cos(lat)
    z = (normal * (1.0 - squared) + points[:, 2]) * np.sin(lat)
    return lon, lat, np.column_stack([flat * np.cos(lon), flat * np.sin(lon), z])


def write(folder, definition, x, y):
    """A network of five points with directions, zenith angles, distances and height differences."""
    steps = [[0, 0, 0], [1800, 100, 90], [-300, 1900, -40], [900, 800, 20], [-700, 600, 150]]
    points = np.array([x, y, 400.0]) + np.array(steps, np.float64)
    lon, lat, xyz = geocentric(definition, points)
    lines = []
    for i in range(5):
        east = np.array([-np.sin(lon[i]), np.cos(lon[i]), 0.0])
        up = np.array([np.cos(lat[i]) * np.cos(lon[i]), np.cos(lat[i]) * np.sin(lon[i]), np.sin(lat[i])])
        others = [j for j in range(5) if j != i]
        for j in others:
            sight = xyz[j] - xyz[i]
            size = np.linalg.norm(sight)
            hz = np.arctan2(sight @ east, sight @ np.cross(up, east)) / GON
            lines.append(f"{7 if j == others[0] else 5} P{i} P{j} {hz % 400.0:.8f} 0.0003")
            lines.append(f"6 P{i} P{j} {np.arccos(sight @ up / size) / GON:.8f} 0.0003")
            lines.append(f"3 P{i} P{j} {size:.6f} 0.001")
        lines.append(f"4 P{i} P{others[0]} {points[others[0], 2] - points[i, 2]:.6f} 0.0003")
    (folder / "n.obs").write_text("\n".join(lines) + "\n")
    cor = [
        f"{int(k < 3)} P{k} {e} {n} {h}{' 0.001' if k < 3 else ''}\n" for k, (e, n, h) in enumerate(points)
    ]
    (folder / "n.cor").write_text("".join(cor))
    return points


CASES = [
    ("EPSG:2056", 2600000.0, 1200000.0),
    ("EPSG:2100", 500000.0, 4200000.0),
    ("EPSG:5514", -700000.0, -1050000.0),
    ("EPSG:23700", 650000.0, 185000.0),
    ("EPSG:27572", 600000.0, 2200000.0),
    ("EPSG:2154", 700000.0, 6600000.0),
]


@pytest.mark.parametrize(("definition", "x", "y"), CASES)
def test_exact_observations_leave_nothing(tmp_path, definition, x, y):
    points = write(tmp_path, definition, x, y)
    files = tmp_path / "n.obs", tmp_path / "n.cor"
    network = Network.read(*files, points_crs=definition, refraction=0.0)
    assert network.gross_errors() == ()
    adjustment = network.adjust()
    assert adjustment.sigma0 < 0.01
    found = network.point_system.coordinates(adjustment.points.coordinates)
    np.testing.assert_allclose(found, points, rtol=0, atol=3e-5)


def test_a_frame_in_another_system_has_the_heights_of_the_points(tmp_path):
    points = write(tmp_path, *CASES[0])
    files = tmp_path / "n.obs", tmp_path / "n.cor"
    frame = "RTL*7.44*46.95*0*EPSG:4326"
    network = Network.read(*files, frame=frame, points_crs="EPSG:2056", refraction=0.0)
    adjustment = network.adjust()
    assert adjustment.sigma0 < 0.01
    found = network.point_system.coordinates(adjustment.points.coordinates)
    np.testing.assert_allclose(found, points, rtol=0, atol=3e-5)


def test_three_bench_marks_and_exact_levelling(tmp_path):
    (tmp_path / "l.cor").write_text(
        "1 A 2600000 1200000 500 0.001\n1 B 2602000 1200000 510 0.001\n1 C 2600000 1202000 505 0.001\n"
        "2 P 2601300 1200900 500 0.001\n"
    )
    (tmp_path / "l.obs").write_text(
        "4 A B 10 0.001\n4 A C 5 0.001\n4 A P 2 0.001\n4 B P -8 0.001\n4 C P -3 0.001\n"
    )
    network = Network.read(tmp_path / "l.obs", tmp_path / "l.cor", points_crs="EPSG:2056")
    adjustment = network.adjust()
    assert not adjustment.gross_errors
    assert max(abs(adjustment.residuals)) < 1e-6
    assert network.point_system.coordinates(adjustment.points.coordinates)[3, 2] == pytest.approx(
        502.0, abs=1e-6
    )


def test_dynaml_would_tilt_them(tmp_path):
    write(tmp_path, *CASES[0])
    network = Network.read(tmp_path / "n.obs", tmp_path / "n.cor", points_crs="EPSG:2056", refraction=0.0)
    with pytest.raises(InputError, match=r"tilted against it: .*`@h`"):
        as_dynaml(network, "ETRS89")
