"""Wrong coordinates of known points: where observations give no height, only heights, or see two alike."""

import re
from dataclasses import replace

import numpy as np
import pytest
from set_ups import resection

from obseq.survey import Network, Quality, network_from_tables
from obseq.survey.screening.findings import Cause

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


@pytest.mark.parametrize("shift", [0.335, 10.0])
def test_a_known_point_of_a_plane_network_is_named(shift):
    (error,) = plane(shift).gross_errors()
    assert error.points == ("M11",)
    said = "one digit is wrong" if shift == 10.0 else "only the easting (x) differs, by "
    assert said in error.text


def test_of_two_slips_the_nearer_one_is_named():
    """1151.83 for 1151.33 is a wrong digit; exchanged ones would give 1151.38, which is 5 cm off."""
    (error,) = plane(0.5, x_of_m11=1151.33).gross_errors()
    assert error.points == ("M11",) and "one digit is wrong" in error.text


def test_a_plane_network_without_mistake_is_not_accused():
    assert plane(0.0).gross_errors() == ()


@pytest.mark.parametrize("height", [2347.04, 2347.1, 2349.0, 2357.0, 2447.0, 2347.0 / 0.3048])
def test_of_two_bench_marks_nothing_tells_which_is_wrong(height):
    """However large the error is, it is one, and nothing is blamed besides."""
    (error,) = levelling(height).gross_errors()
    assert error.what == "one of height of known point A (points:1), height of known point B (points:2)"
    assert error.points == ("A", "B") and "nothing tells them apart" in error.text
    assert "the others give 2347.00" in error.text or "likely: " in error.text


def test_one_bench_mark_that_is_suspected_is_not_told_as_several_observations():
    adjustment = levelling(2347.01).adjust()
    assert adjustment.suspicion is not None and adjustment.suspicion.may_be_known
    assert not any("gross errors" in text for text in adjustment.warnings)


def displaced(network, coordinates):
    return replace(network, points=replace(network.points, coordinates=coordinates))


def test_two_exchanged_points_of_two_axes_are_one_finding(shared_data):
    """Each is seen once, and bends its axis: others than these two look worse."""
    network = Network.read_project(shared_data / "comp3d-axe" / "project.comp")
    rows = [network.points.index[name] for name in ("A4", "B3")]
    places = network.points.coordinates.copy()
    places[rows] = places[rows[::-1]]
    (error,) = displaced(network, places).gross_errors()
    assert error.cause is Cause.SWAPPED_NAMES and set(error.points) == {"A4", "B3"}


def test_the_scale_of_all_distances_may_be_one_of_two_known_points(shared_data):
    network = Network.read_project(shared_data / "gama-local-small" / "gama-local.gkf")
    places = network.points.coordinates.copy()
    places[network.points.index["2"], 1] += 10.0
    (error,) = displaced(network, places).gross_errors()
    assert error.cause is Cause.DISTANCES
    assert re.search(r"nothing tells apart, the coordinates of 1 \(.*\) or 2 \(.*\)$", error.text)


def test_a_known_point_that_is_right_is_not_accused_where_initial_values_follow_a_wrong_direction():
    """From there iterations ended far off, and A, taken as unknown, came back to where it is; nor does
    snooping leave out a good direction there."""
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
    adjustment = network_from_tables(points, columns, angles="gon").adjust(quality=Quality(snooping="w"))
    assert [error.what for error in adjustment.gross_errors] == ["Hz A -> Q (observations:7)"]
    assert [item.row for item in adjustment.record().rejections] == [6]


def test_swapped_coordinates_that_one_direction_alone_contradicts(tmp_path):
    """From the origin of coordinates a point is as far, and as high, with easting and northing swapped."""
    site = resection()
    site.places["K2"] = (104.1, 32.1, 15.4)
    ((error, lines),) = site.errors(tmp_path)
    assert error.cause is Cause.SWAPPED_COORDINATES and error.points == ("K2",)
    assert {site.lines[line - 1].target for line in lines} == {"K2"} and len(lines) == 1


def test_a_direction_that_is_off_by_itself_blames_no_coordinates(tmp_path):
    site = resection()
    lines = site.change(lambda line: {"value": line.value + 43.21}, "5", target=("K2",))
    ((error, told),) = site.errors(tmp_path)
    assert error.cause is not Cause.SWAPPED_COORDINATES and lines <= told
