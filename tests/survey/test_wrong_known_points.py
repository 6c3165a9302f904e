"""Wrong coordinates of known points: where observations give no height, only heights, or see two alike."""

import numpy as np
import pytest

from obseq.survey import network_from_tables

RISES = [("A", "P", 1.5004), ("P", "Q", 1.6993), ("Q", "B", -1.2002), ("B", "R", -2.7003), ("R", "A", 0.7003)]
RISES += [("P", "B", 0.5005), ("P", "R", -2.1995)]


def levelling(height: float):
    """Levels between two bench marks, of which B is 2,347.000 m high."""
    points = {
        "name": ["A", "B", "P", "Q", "R"],
        "x": [0.0, 150.0, 100.0, 200.0, 50.0],
        "y": [0.0, 150.0, 0.0, 50.0, 120.0],
        "z": [2345.0, height, None, None, None],
        "sx": [0.0] * 5,
        "sy": [0.0] * 5,
        "sz": [0.0, 0.001, None, None, None],
    }
    begin, end, values = zip(*RISES, strict=True)
    rows = {"type": ["DH"] * 7, "from": begin, "to": end, "value": values, "sigma": [0.001] * 7}
    return network_from_tables(points, rows)


def plane(shift: float, seed: int = 3, x_of_m11: float | None = None):
    """Nine points of a grid, seen from their neighbours; all heights are 0, the known M11 is off in x."""
    generator = np.random.default_rng(seed)
    places = {f"M{i}{j}": (1000.0 + 150.0 * i, 5000.0 + 140.0 * j) for i in range(3) for j in range(3)}
    places = {name: place + generator.uniform(-20.0, 20.0, 2) for name, place in places.items()}
    places["M11"] = places["M11"] if x_of_m11 is None else np.array([x_of_m11, places["M11"][1]])
    known = {"M00", "M02", "M11", "M20", "M22"}
    x, y = np.array(list(places.values())).T
    points = {
        "name": list(places),
        "x": x + shift * (np.array(list(places)) == "M11"),
        "y": y,
        "z": [0.0] * 9,
    }
    points |= {axis: [0.002 if name in known else None for name in places] for axis in ("sx", "sy")}
    points["sz"] = [0.0] * 9
    rows = []
    for station, here in places.items():
        zero = generator.uniform(0.0, 400.0)
        for target, there in places.items():
            dx, dy = there - here
            if 0.0 < np.hypot(dx, dy) < 230.0:
                reading = (np.degrees(np.arctan2(dx, dy)) / 0.9 + zero) % 400.0
                rows.append(("Hz", station, target, reading + generator.normal(0.0, 0.001), 0.001))
                length = np.hypot(dx, dy) + generator.normal(0.0, 0.002)
                rows.append(("DistHz", station, target, length, 0.002))
    names = ("type", "from", "to", "value", "sigma")
    return network_from_tables(points, dict(zip(names, zip(*rows, strict=True), strict=True)), angles="gon")


@pytest.mark.parametrize("shift", [0.05, 0.6, 30.0])
def test_a_coordinate_of_a_known_point_is_named_with_its_size(shift):
    (error,) = plane(shift).gross_errors()
    assert error.code == "S110" and [(p.name, p.coordinate) for p in error.points] == [("M11", "x")]
    assert error.size[0] == pytest.approx(shift, abs=0.02)


def test_a_network_of_the_plane_with_right_points_raises_no_alarm():
    assert plane(0.0).gross_errors() == ()


@pytest.mark.parametrize("height", [2347.04, 2347.1, 2349.0, 2357.0, 2447.0, 2347.0 / 0.3048])
def test_of_two_bench_marks_nothing_tells_which_is_wrong(height):
    """However large the error is, it is one, and nothing is blamed besides."""
    (error,) = levelling(height).gross_errors()
    told = [{point.name for point in one.points} for one in (error, *error.others)]
    assert {"A"} in told and {"B"} in told


def test_a_known_point_that_is_right_is_not_accused_where_initial_values_follow_a_wrong_direction():
    """From there iterations ended far off."""
    places = {"A": (1000, 2000, 50), "B": (1180, 2030, 58), "C": (1090, 2190, 45), "Q": (1140, 2110, 49)}
    xyz = np.array([*list(places.values())[:3], (0, 0, 0)], np.float64).T  # of Q, a placeholder
    points = {"name": list(places), **dict(zip("xyz", xyz, strict=True))}
    points |= {f"s{axis}": [0.001] * 3 + [None] for axis in "xyz"}
    rows = []
    for station, target in ((s, t) for s in "AB" for t in places if s != t):
        dx, dy, dz = np.subtract(places[target], places[station])
        azimuth, flat = np.arctan2(dx, dy) * 200.0 / np.pi, np.hypot(dx, dy)
        wrong = 40.0 if (station, target) == ("A", "Q") else 0.0
        rows.append(("Hz", station, target, (azimuth - wrong) % 400.0, 0.001))
        rows.append(("Zen", station, target, np.arctan2(flat, dz) * 200.0 / np.pi, 0.001))
        rows.append(("Dist", station, target, np.hypot(flat, dz), 0.002))
    columns = dict(zip(("type", "from", "to", "value", "sigma"), zip(*rows, strict=True), strict=True))
    (error,) = network_from_tables(points, columns, angles="gon").adjust().gross_errors
    assert {row.line for row in error.observations} == {7}
