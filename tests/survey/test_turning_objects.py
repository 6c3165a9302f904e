"""Axes of rotation from sights of turning targets: neither axis nor targets have coordinates."""

import math

import numpy as np
import pytest

from obseq.survey import Network

STATIONS = {"S1": np.zeros(3), "S2": np.array([30.0, -5.0, 0.5])}
CENTRE = np.array([15.0, 20.0, 3.0])
GON = 200.0 / math.pi


def turning(folder, seed, origin=""):
    """Two targets in five positions each on one axis, seen by plumb total stations; the axis."""
    chance = np.random.default_rng(seed)
    axis = chance.normal(size=3)
    axis /= np.linalg.norm(axis)
    right = np.cross(axis, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    front = np.cross(axis, right)
    targets = {
        f"{name}{k}": CENTRE + height * axis + radius * (math.cos(turn) * right + math.sin(turn) * front)
        for name, radius, height in (("P", 3.0, 0.4), ("Q", 4.0, -0.6))
        for k, turn in enumerate(np.radians([0, 50, 110, 170, 230]))
    }
    rows = []
    for station, place in STATIONS.items():
        zero = chance.uniform(0.0, 6.0)
        for target, there in (STATIONS | targets).items():
            if target == station:
                continue
            east, north, up = there - place
            code = 5 if any(row.split()[1] == station for row in rows) else 7
            flat = math.hypot(east, north)
            circle = (math.atan2(east, north) - zero) % (2.0 * math.pi)
            rows.append(f"{code} {station} {target} {circle * GON:.7f} 0.0003")
            rows.append(f"6 {station} {target} {math.atan2(flat, up) * GON:.7f} 0.0003")
            rows.append(f"3 {station} {target} {math.hypot(flat, up):.6f} 0.0003")
    circles = [f"{name} {k} {name}{k} 0.0003 0.0003" for name in "PQ" for k in range(5)]
    (folder / "axis.axe").write_text("\n".join([*circles, ""]))
    (folder / "o.obs").write_text("\n".join([*rows, "18 AXIS @axis.axe", ""]))
    known = [f"1 {name} {x} {y} {z} 0.001 0.001 0.001" for name, (x, y, z) in STATIONS.items()]
    (folder / "p.cor").write_text("\n".join([*known, origin, ""]))
    project = (
        '{"config": {"name": "axis", "root_COR_file": "p.cor", "root_OBS_file": "o.obs", "files_unit": 1, '
    )
    project += '"center_latitude": 48.8, "use_proj": false, "local_center": [0, 0, 0], "refraction": 0}}'
    (folder / "p.comp").write_text(f"data={project}")
    return Network.read_project(folder / "p.comp"), axis


@pytest.mark.parametrize("seed", range(4))
def test_an_origin_far_off_its_axis_starts_on_it(tmp_path, seed):
    """Twelve metres off an axis of 3 m radius, known to 100 m: the iterations did not converge from there."""
    adjusted = turning(tmp_path, seed, "1 AXIS 3 3 3 100 100 0.001")[0].adjust()
    _, axis = turning(tmp_path, seed)
    assert adjusted.converged
    points = adjusted.points
    off = points.coordinates[points.names.index("AXIS")] - CENTRE
    assert np.linalg.norm(np.cross(off, axis)) < 1e-3


def test_an_axis_that_nothing_holds_along_itself_is_told_so(tmp_path):
    network, axis = turning(tmp_path, 3)
    (left,) = network.adjust().record().left_out
    assert left.name == "AXIS"
    told = "nothing holds it along ("
    assert told in left.reason
    along = [float(part) for part in left.reason.split(told)[1].split(")")[0].split(",")]
    assert abs(np.dot(along, axis)) > 0.99
