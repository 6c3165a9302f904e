"""Points of which only the plan is observed: adjusted in plan, their height empty in every output."""

import csv
import json
import math

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.formats import write_sinex
from obseq.report.adjusted import outcome
from obseq.report.compared import comparison_csv
from obseq.report.result_file import read_json
from obseq.report.summary import listing
from obseq.survey import Network, compare
from obseq.survey.planning.design import plan

GON = 200.0 / math.pi
KNOWN = {"A": (0.0, 0.0, 100.0), "B": (500.0, 30.0, 112.0), "C": (260.0, 420.0, 95.0)}
PLACES = KNOWN | {"P": (210.0, 180.0, 140.0), "Q": (330.0, 260.0, 80.0), "R": (380.0, 100.0, 105.0)}
LAMBERT = (700000.0, 6600000.0, 0.0)
SIGHTS = {"A": "BCPQ", "B": "ACP", "C": "ABQP"}


def _azimuth(start, end):
    east, north, _ = np.subtract(PLACES[end], PLACES[start])
    return math.atan2(east, north) * GON


def _set_up(station, targets, zero):
    random = np.random.default_rng(len(targets) + ord(station))
    noisy = ((_azimuth(station, end) - zero + random.normal(0.0, 5e-4)) % 400.0 for end in targets)
    return ["#NEW", *(f"5 {station} {end} {hz:.5f} 0.0005" for end, hz in zip(targets, noisy, strict=True))]


def _network(folder, *more, shift=(0.0, 0.0, 0.0), given=(), raised=0.0, **options):
    lines = [line for k, (name, seen) in enumerate(SIGHTS.items()) for line in _set_up(name, seen, 30.0 * k)]
    (folder / "a.obs").write_text("\n".join([*lines, *more]) + "\n")
    points = [f"1 {name} {x} {y} {z} 0.002" for name, (x, y, z) in _shifted(KNOWN, shift).items()]
    points += [f"0 {n} {x + 3} {y - 2} {z + raised}" for n, (x, y, z) in _shifted(given, shift).items()]
    (folder / "a.cor").write_text("\n".join(points) + "\n")
    return Network.read(folder / "a.obs", folder / "a.cor", **options)


def _shifted(names, shift):
    return {name: tuple(np.add(PLACES[name], shift).tolist()) for name in names}


def _plan(adjustment, name):
    return adjustment.points.crs_coordinates[adjustment.points.names.index(name), :2]


@pytest.mark.parametrize("given", ["", "PQ"], ids=["no approximations", "approximations"])
@pytest.mark.parametrize("on_earth", [False, True], ids=["plane", "on the Earth"])
def test_a_point_observed_in_plan_only_is_adjusted_in_plan(tmp_path, given, on_earth):
    options = {"shift": LAMBERT, "points_crs": "EPSG:2154"} if on_earth else {}
    found = _network(tmp_path, given=given, **options).adjust()
    assert found.converged and not found.left_out
    assert found.solution.redundancy == 4  # 11 directions, 3 zeros, 4 coordinates: heights are no unknowns
    for name in "PQ":
        place = np.add(PLACES[name], options.get("shift", 0.0))[:2]
        assert _plan(found, name) == pytest.approx(place, abs=0.01)
    (note,) = (note for note in found.notes if "no height" in note)
    assert note.startswith("2 points have no height, which nothing observes: P, Q.")


def test_its_height_is_empty_in_every_output(tmp_path):
    network = _network(tmp_path, shift=LAMBERT, points_crs="EPSG:2154", given="P")
    found = network.adjust()
    row = found.points.names.index("P")
    for part in ("coordinates", "precisions", "crs_coordinates", "crs_precisions"):
        assert np.isfinite(getattr(found.points, part)[row]).tolist() == [True, True, False]
    record = next(point for point in found.record().points if point.name == "P")
    assert (record.z, record.sz, record.crs_z, record.crs_sz) == (None,) * 4
    assert record.plan is not None and record.known == "" and record.ellipse is not None
    assert record.moved[2] is None and record.moved[0] == pytest.approx(-3.0, abs=0.01)
    lines = (line.split() for line in listing(outcome(found.record())).splitlines())
    cells = next(cells for cells in lines if cells[:2] == ["P", "point"])
    assert [cells[k] == "-" for k in range(2, 11)] == [False, False, True] * 3  # places, frame, precisions
    with pytest.raises(InputError, match="nothing observes the height of point P"):
        write_sinex(tmp_path / "r.snx", found)


def test_files_of_results_leave_it_empty_and_are_read_again(tmp_path, capsys):
    _network(tmp_path, shift=LAMBERT)
    read, result = (
        [str(tmp_path / "a.obs"), str(tmp_path / "a.cor"), "--points-crs", "EPSG:2154"],
        tmp_path / "r.json",
    )
    assert main(["adjust", *read, "--json", str(result), "--html", str(tmp_path / "r.html")]) == 0
    plain = {point["name"]: point for point in json.loads(result.read_text())["points"]}
    assert plain["P"]["z"] is None and "crs_sz" not in plain["P"] and plain["A"]["z"] is not None
    assert main(["convert", str(result), "--to", str(tmp_path / "r.csv"), str(tmp_path / "r.geojson")]) == 0
    rows = {row["name"]: row for row in csv.DictReader((tmp_path / "r.csv").read_text().splitlines())}
    assert (rows["P"]["z"], rows["P"]["sz"]) == ("", "") and float(rows["P"]["x"]) > 7e5
    features = json.loads((tmp_path / "r.geojson").read_text())["features"]
    places = {
        f["properties"]["name"]: f["geometry"]["coordinates"]
        for f in features
        if f["properties"]["layer"] == "points"
    }
    assert (len(places["A"]), len(places["P"])) == (3, 2)
    assert main(["convert", str(result), "--to", str(tmp_path / "r.cor")]) == 2
    assert "point P has x and y only" in capsys.readouterr().err
    assert read_json(result).points[3].crs_z is None


@pytest.mark.parametrize(
    "line", ["6 A P 90.23 1e-3", "3 P A 279.46 2e-3\n3 P B 327.69 2e-3", "4 A P 40.0 2e-3"]
)
def test_one_observation_that_sees_the_height_makes_it_an_unknown(tmp_path, line):
    """A zenith angle, slope distances or a height difference give it."""
    found = _network(tmp_path, *line.split("\n")).adjust()
    row = found.points.names.index("P")
    assert not found.points.points.is_invented[row, 2]
    assert np.isfinite(found.points.coordinates[row]).all()


@pytest.mark.parametrize("on_earth", [False, True], ids=["plane", "on the Earth"])
def test_what_sees_the_height_of_a_point_to_a_lost_one_does_not_lose_its_plan(tmp_path, on_earth):
    options = {"shift": LAMBERT, "points_crs": "EPSG:2154"} if on_earth else {}
    plain = _network(tmp_path, **options).adjust()
    found = _network(tmp_path, "5 P R 1.0 0.001", "6 P R 100 0.001", **options).adjust()
    assert [item.name for item in found.left_out] == ["R"]
    assert (found.solution.redundancy, found.sigma0) == (4, pytest.approx(plain.sigma0, rel=1e-4))
    for name in "PQ":  # at other heights that nobody knows
        assert _plan(found, name) == pytest.approx(_plan(plain, name), abs=1e-3)
    row = found.points.names.index("P")
    assert np.isnan(found.points.coordinates[row, 2])


def test_a_slope_distance_between_two_points_without_height_is_told(tmp_path):
    """It depends on both heights: with invented ones it would bend the plan in silence."""
    with pytest.raises(InputError, match="not its height"):
        _network(tmp_path, "3 P Q 156.2 0.002").adjust()


def test_what_another_height_would_do_is_told(tmp_path):
    """On the Earth, along z of a frame whose origin is far away, plumb lines lean."""
    frame = {"frame": "RTL*2.4*48.8*0*EPSG:4326", "shift": (30000.0, 0.0, 0.0)}
    low, high = (_network(tmp_path, given="PQ", raised=raised, **frame).adjust() for raised in (0.0, 100.0))
    moved = max(np.hypot(*(_plan(high, name) - _plan(low, name))) for name in "PQ")
    (note,) = (note for note in low.notes if "no height" in note)
    told = float(note.split("by up to ")[1].split(" mm")[0]) / 1e3
    assert told == pytest.approx(moved, rel=0.1) and moved > 0.1


def test_a_traverse_in_plan_goes_on_from_points_without_height(tmp_path):
    """R hangs on P, which has no height: both are placed by directions and horizontal distances."""
    length = math.dist(PLACES["P"][:2], PLACES["R"][:2])
    more = [*_set_up("P", "ABR", 77.0), f"2 P R {length:.4f} 0.002"]
    found = _network(tmp_path, *more, frame="RTL*2.4*48.8*0*EPSG:4326").adjust()
    assert found.converged and not found.left_out
    assert _plan(found, "R") == pytest.approx(PLACES["R"][:2], abs=0.02)
    assert np.isnan(found.points.coordinates[found.points.names.index("R"), 2])


@pytest.mark.parametrize("system", [None, "EPSG:2154"])
def test_a_network_of_plans_needs_no_heights(tmp_path, system):
    """Known points of a table whose column z is empty."""
    shift = LAMBERT if system else (0.0, 0.0, 0.0)
    rows = [f"{name},{x},{y},,0.002,0.002," for name, (x, y, _) in _shifted(KNOWN, shift).items()]
    (tmp_path / "p.csv").write_text("\n".join(["name,x,y,z,sx,sy,sz", *rows]) + "\n")
    lines = [line.split() for station, seen in SIGHTS.items() for line in _set_up(station, seen, 10.0)[1:]]
    table = [f"Hz,{start},{end},{value},{sigma}" for _, start, end, value, sigma in lines]
    (tmp_path / "o.csv").write_text("\n".join(["type,from,to,value,sigma", *table]) + "\n")
    read = [str(tmp_path / "p.csv"), str(tmp_path / "o.csv"), *(["--points-crs", system] if system else [])]
    assert main(["adjust", *read, "--json", str(tmp_path / "r.json")]) == 0
    points = read_json(tmp_path / "r.json").points
    assert all(point.z is None and point.crs_z is None for point in points)
    found = {point.name: (point.crs_x, point.crs_y) for point in points}
    assert found["Q"] == pytest.approx(np.add(PLACES["Q"], shift)[:2], abs=0.02)


def test_observations_that_are_switched_off_give_no_height(tmp_path):
    found = _network(tmp_path, "-6 A P 90.23 0.001").adjust()
    assert np.isnan(found.points.coordinates[found.points.names.index("P"), 2])


@pytest.mark.parametrize("lines", [[], ["6 A P 90.2 0.001"]], ids=["in neither epoch", "in one"])
def test_epochs_say_nothing_of_a_height_that_one_does_not_observe(tmp_path, lines):
    first = _network(tmp_path).adjust()
    second = _network(tmp_path, *lines).adjust()
    rows = {row.point: row for row in compare(first, second).record().displacements}
    assert (rows["P"].z, rows["P"].up, rows["P"].s_up) == (None,) * 3
    assert rows["P"].length == pytest.approx(np.hypot(rows["P"].east, rows["P"].north), abs=1e-12)
    assert not rows["P"].is_significant and rows["P"].test.freedom == 2
    assert rows["A"].up is not None
    text = comparison_csv(compare(first, second).record())
    (row,) = (row for row in csv.DictReader(text.splitlines()) if row["point"] == "P")
    assert row["up (mm)"] == row["s up (mm)"] == "" != row["east (mm)"]


def test_a_plan_reckons_with_no_height_that_nothing_observes(tmp_path):
    planned = plan(_network(tmp_path, given="PQ"), draws=40, seed=3)
    assert planned.draws.agrees and planned.draws.failed == 0
    assert max(gain.before for gain in planned.gains) < 0.1  # m: no height of the curvature of the Earth
