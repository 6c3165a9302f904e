"""First values of short sights, of long ones, and of groups that an azimuth turns."""

from dataclasses import replace

import numpy as np
import pytest
from sketch import A, B, C, P, Q, Sketch

from obseq.geometry import closest_rotation
from obseq.survey import network_from_tables, simulate

NEAR = {"A": (0.0, 0.0, 1.0), "B": (2.0, 0.0, 0.0), "C": (0.5, 1.5, 2.0), "P": (1.2, 0.7, 0.4)}
TILTED = closest_rotation(np.eye(3) + 0.6 * np.array([[0, -1, 0.5], [1, 0, -0.8], [-0.5, 0.8, 0]]))


def raised(tmp_path):
    """Sights of two metres, from 1.5 m above the ground to targets on it."""
    return Sketch(tmp_path, **NEAR).raised(1.5, 0.1)


@pytest.mark.parametrize(
    ("name", "draw", "known"),
    [
        ("polar point", lambda s: s.hz("A", "B").full("A", "P"), "AB"),
        ("components", lambda s: s.hz("A", "B").dxyz("A", "P"), "AB"),
        ("resection", lambda s: s.hz("P", "A", "B", "C", g0=0.7).zen("P", "C"), "ABC"),
        ("intersection", lambda s: s.hz("A", "B", "P").hz("B", "A", "P").zen("A", "P"), "AB"),
        ("back sight", lambda s: s.hz("A", "B", "P").hz("B", "A", "P").zen("P", "A"), "AB"),
        ("rise", lambda s: s.hz("A", "B", "P").hz("B", "A", "P").dxyz("A", "P", codes=(16,)), "AB"),
        ("tilted vectors", lambda s: s.write("#BASC").dxyz("P", "A", "B", "C", rotation=TILTED), "ABC"),
        ("tilted", lambda s: s.write("#BASC").dxyz("A", "B", "C", "P", rotation=TILTED), "ABC"),
    ],
)
def test_heights_of_instrument_and_target_are_part_of_short_sights(tmp_path, name, draw, known):
    draw(raised(tmp_path)).solve(*known).assert_true()


def test_a_short_sight_from_a_tripod_contradicts_no_coordinates(tmp_path):
    near = {"P": np.add(NEAR["P"], 0.01)}
    found = raised(tmp_path).hz("P", "A", "B", "C").zen("P", "A", "B", "C").solve("A", "B", "C", hints=near)
    assert found.values.replaced == ()
    assert found.method("P") == "given"


def test_an_azimuth_elsewhere_turns_a_group_about_its_one_known_point(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, C=C, P=P, Q=Q).full("A", "P", "Q", g0=1.2).full("P", "B", "A", g0=0.4)
    sketch.write("#FIX").hz("Q", "B").write("#VERT").full("Q", "C", "A", g0=-2.0)
    sketch.solve("A").assert_true()


def test_without_an_azimuth_a_group_with_one_known_point_turns(tmp_path):
    sketch = Sketch(tmp_path, A=A, B=B, P=P, Q=Q).full("A", "P", "Q", g0=1.2).full("P", "B", "A", g0=0.4)
    assert {item.what for item in sketch.solve("A").values.unplaced} >= {"point P", "point Q", "point B"}


def test_long_sights_are_straightened_where_their_distance_is_known():
    """Over 20 km in a plane: 27.6 m of curvature and refraction."""
    sights = [("A", "B"), ("A", "P")]
    rows = [(kind, *ends) for ends in sights for kind in ("Hz", "Zen", "Dist")]
    table = {
        "type": [kind for kind, _, _ in rows],
        "from": [a for _, a, _ in rows],
        "to": [b for _, _, b in rows],
        "value": [1.0] * len(rows),
        "sigma": [1e-3 if kind == "Dist" else 1e-6 for kind, _, _ in rows],
    }
    places = {"A": (0, 0, 100), "B": (100, 0, 100), "P": (12000, 16000, 300)}
    points = {"name": list(places)} | {
        axis: [xyz[k] for xyz in places.values()] for k, axis in enumerate("xyz")
    }
    for axis in "xyz":
        points[f"s{axis}"] = [0.001, 0.001, None]
    network = simulate(network_from_tables(points, table, frame="Local", points_crs="Local"), seed=1)
    known = replace(
        network.points, coordinates=np.where(network.points.is_free, np.nan, network.points.coordinates)
    )
    found = replace(network.fieldwork, points=known).initial_values()
    np.testing.assert_allclose(found.coordinates[2], places["P"], atol=0.2)
