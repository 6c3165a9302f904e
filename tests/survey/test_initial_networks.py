"""Initial values of whole networks: real ones, large ones, and frames with a curved vertical."""

import json
import math
import runpy
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import obseq.crs
from obseq.survey import initial_values, join, read_cor, read_obs

ROOT = Path(__file__).resolve().parents[2]
TOOL = ROOT / "tools" / "benchmarks" / "make_network.py"
FRAME = "RTL*657700*6860700*0*IGNF:LAMB93"


def flat(points):
    return np.tile(np.eye(3), (len(points), 1, 1))


def solved(obs, cor, vertical=flat, **options):
    points, book = join(read_cor(cor), read_obs(obs))
    return points, initial_values(points, book, vertical, **options)


def test_bench_3(shared_data):
    folder = shared_data / "mmvii-topo-bench"
    points, values = solved(folder / "ex3.obs", folder / "ex3.cor")
    assert values.g0[0] == pytest.approx(2.2, abs=1e-12)
    expected = [100 + 10 * math.sin(math.pi / 4), 100 + 10 * math.cos(math.pi / 4), 100]
    np.testing.assert_allclose(values.coordinates[points.index["Tr1"]], expected, atol=1e-9)


def test_bench_3_in_its_frame_begins_where_mmvii_does(shared_data):
    # the reference gives (107.07106781, 107.07106781, 99.99977753) with the vertical of the RTL at (45, 0)
    folder = shared_data / "mmvii-topo-bench"
    vertical = obseq.crs.parse("RTL*45*0*0*+proj=latlong").vertical_rotation
    points, values = solved(folder / "ex3.obs", folder / "ex3.cor", vertical)
    expected = [107.07106781, 107.07106781, 99.99977753]
    np.testing.assert_allclose(values.coordinates[points.index["Tr1"]], expected, atol=2e-8)


def test_bench_4_finds_the_free_rotation(shared_data):
    folder = shared_data / "mmvii-topo-bench"
    vertical = obseq.crs.parse("RTL*45*0*0*+proj=latlong").vertical_rotation
    points, values = solved(folder / "ex4.obs", folder / "ex4.cor", vertical)
    np.testing.assert_allclose(
        values.coordinates[points.index["St"]], [250.190933, 794.427602, 551.37138], atol=1e-8
    )
    # DX, DY, DZ of Pt1, which is 10 m west of St
    np.testing.assert_allclose(
        values.rotations[0].T @ [-10, 0, 0], [-2.059307976935, 3.961620515792, -8.947894363759], atol=1e-8
    )


def test_bench_1_decides_between_two_solutions_by_the_approximate_height(shared_data):
    folder = shared_data / "mmvii-topo-bench"
    points, values = solved(folder / "ex1.obs", folder / "ex1.cor", recompute_free=True)
    found = values.coordinates[points.index["ptD"]]
    np.testing.assert_allclose(found, [15, 13.75, 10 + math.sqrt(75 - 3.75**2)], atol=1e-9)


def test_angles_only_network_is_placed_completely(shared_data):
    # Comp3D gives up c1 (resection) and 3 (in the vertical plane of both stations)
    folder = shared_data / "comp3d-init-cap"
    points, values = solved(folder / "obs.obs", folder / "coord.cor")
    assert values.unplaced == ()
    found = dict(zip(points.names, values.coordinates, strict=True))
    expected = json.loads((folder / "expected.json").read_text())["points"]
    for name in ("1", "2", "4", "5", "c2"):
        np.testing.assert_allclose(found[name], expected[name]["xyz"], atol=0.003, err_msg=name)
    np.testing.assert_allclose(found["c1"], [150, 150, 100], atol=0.003)
    np.testing.assert_allclose(found["3"], [220, 100, 140], atol=0.003)


def figure(shared_data, tmp_path):
    """The 85-point network with its azimuth written as MMVII's training does."""
    folder = shared_data / "comp3d-figure"
    text = (folder / "figure.obs").read_text().split("\n", 1)[1]
    path = tmp_path / "figure.obs"
    path.write_text(f"#FIX\n5 HLLST0001 HLLPI0005 100 0.001\n#VERT\n{text}")
    return path, folder / "figure.cor", json.loads((folder / "expected.json").read_text())["points"]


def test_85_points_from_one_point_and_one_azimuth(shared_data, tmp_path):
    obs, cor, expected = figure(shared_data, tmp_path)
    points, values = solved(obs, cor, flat, recompute_free=True)
    assert values.unplaced == ()
    assert len(points) == 85
    for name, xyz in zip(points.names, values.coordinates, strict=True):
        np.testing.assert_allclose(xyz, expected[name]["cartesian"], atol=0.02, err_msg=name)


def test_85_points_in_the_frame_of_the_training(shared_data, tmp_path):
    obs, cor, expected = figure(shared_data, tmp_path)
    vertical = obseq.crs.parse("RTL*0*44.40*0*EPSG:4326").vertical_rotation
    points, values = solved(obs, cor, vertical, recompute_free=True)
    assert values.unplaced == ()
    for name, xyz in zip(points.names, values.coordinates, strict=True):
        np.testing.assert_allclose(xyz, expected[name]["cartesian"], atol=0.03, err_msg=name)


def make_network(tmp_path, *options, in_a_process=False):
    command = [str(TOOL), "--out", str(tmp_path), *map(str, options)]
    if in_a_process:
        subprocess.run([sys.executable, *command], check=True, capture_output=True, cwd=ROOT)
    else:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sys, "argv", command)
            runpy.run_path(command[0], run_name="__main__")
    return tmp_path / "network.obs", tmp_path / "network.cor", read_cor(tmp_path / "true.cor")


def errors(points, values, true):
    rows = [true.index[name] for name in points.names]
    return np.abs(values.coordinates - true.coordinates[rows])


@pytest.mark.slow
def test_large_network_does_not_drift(tmp_path):
    obs, cor, true = make_network(tmp_path)
    points, book = join(read_cor(cor), read_obs(obs))
    assert (len(true), len(book.observations)) == (10_000, 59_103)
    vertical = obseq.crs.parse(FRAME).vertical_rotation
    values = initial_values(points, book, vertical)
    assert values.unplaced == ()
    assert errors(points, values, true).max() < 5.0
    # what the adjustment starts with: hardly any sight is wrong by more than a few centimetres
    distances = book.observations.types == 3
    ends = book.observations.from_points[distances], book.observations.to_points[distances]
    computed = np.linalg.norm(values.coordinates[ends[1]] - values.coordinates[ends[0]], axis=1)
    misfits = np.abs(computed - book.observations.values[distances])
    assert np.median(misfits) < 0.02
    assert misfits.max() < 5.0


@pytest.mark.slow
def test_large_network_with_few_isolated_known_points_is_tied_by_a_local_frame(tmp_path):
    obs, cor, true = make_network(tmp_path, "--points", 2500, "--observations", 15000, "--known", 500)
    points, values = solved(obs, cor, obseq.crs.parse(FRAME).vertical_rotation)
    assert values.unplaced == ()
    methods = Counter(step.method.split(" of ")[0] for step in values.point_steps)
    assert methods["local frame"] > 2000
    assert errors(points, values, true).max() < 2.0


@pytest.mark.slow
def test_made_network_is_the_same_for_the_same_seed(tmp_path):
    options = ("--points", 60, "--observations", 300)
    first, _, true = make_network(tmp_path / "a", *options, "--seed", 7)
    second, _, _ = make_network(tmp_path / "b", *options, "--seed", 7, in_a_process=True)
    third, _, _ = make_network(tmp_path / "c", *options, "--seed", 8)
    assert first.read_bytes() == second.read_bytes() != third.read_bytes()
    assert len(true) == 60


@pytest.mark.slow
def test_made_network_in_lambert_93(tmp_path):
    _, _, true = make_network(tmp_path, "--points", 60, "--observations", 300, "--frame", "l93")
    np.testing.assert_allclose(true.coordinates[:, :2].mean(axis=0), [657700, 6860700], atol=60)


def test_points_far_apart_on_a_curved_earth(tmp_path):
    # 10 km sights: the vertical turns by 1.6 mrad; heights and azimuths must follow it
    frame = obseq.crs.parse(FRAME)
    truth = {"A": (0, 0, 100), "B": (8000, 500, 150), "P": (3000, 9000, 400), "Q": (-5000, 6000, 20)}
    rotations = dict(zip(truth, frame.vertical_rotation(np.array(list(truth.values()), float)), strict=True))
    lines = ["1 A 0 0 100 0.001", "1 B 8000 500 150 0.001"]
    (tmp_path / "n.cor").write_text("\n".join(lines))

    def sight(station, target, *codes):
        east, north, up = rotations[station] @ (np.array(truth[target], float) - truth[station])
        values = {5: math.atan2(east, north), 6: math.atan2(math.hypot(east, north), up)}
        distance = math.hypot(east, north, up)
        return [
            f"{c} {station} {target} {values[c] * 200 / math.pi if c != 3 else distance!r} 0.001"
            for c in codes
        ]

    obs = sight("A", "B", 5) + sight("A", "P", 5, 6, 3) + sight("P", "A", 5, 6, 3) + sight("P", "Q", 5)
    obs += sight("B", "A", 5) + sight("B", "Q", 5, 6) + sight("Q", "A", 6)
    (tmp_path / "n.obs").write_text("\n".join(obs))
    points, values = solved(tmp_path / "n.obs", tmp_path / "n.cor", frame.vertical_rotation)
    assert values.unplaced == ()
    for name, xyz in zip(points.names, values.coordinates, strict=True):
        np.testing.assert_allclose(xyz, truth[name], atol=1e-4, err_msg=name)
    np.testing.assert_allclose(values.g0, 0.0, atol=1e-8)


def test_demo_files():
    folder = ROOT / "src" / "obseq" / "survey" / "data"
    points, book = join(read_cor(folder / "demo.cor"), read_obs(folder / "demo.obs"))
    values = initial_values(points, book, flat)
    assert points.names == ("PtA", "PtB", "PtC", "PtD")
    assert (len(book.observations), len(book.stations)) == (12, 2)
    # MMVII takes G0 from the first direction: PtA -> PtB is due east
    np.testing.assert_allclose(values.g0, [math.pi / 2, math.pi / 4], atol=1e-12)
    np.testing.assert_array_equal(points.sigmas[[0, 3]], 0.001)


def grid(folder, size, rng, kinds):
    """Stations of a grid that see their neighbours; three corners are known, the others at 0 0 0."""
    places = {
        (i, j): np.array([100.0 * i, 100.0 * j, 0.0]) + rng.normal(0.0, 5.0, 3)
        for i in range(size)
        for j in range(size)
    }
    corners = (0, 0), (0, size - 1), (size - 1, size - 1)
    cor = [f"1 P{i}_{j} {' '.join(map(repr, map(float, places[i, j])))} 0.001" for i, j in corners]
    cor += [f"0 P{i}_{j} 0 0 0" for i, j in places if (i, j) not in corners]
    lines = []
    for (i, j), here in places.items():
        zero, code = rng.uniform(0.0, 400.0), 7
        for there in ((i + 1, j), (i, j + 1), (i - 1, j), (i, j - 1), (i + 1, j + 1), (i - 1, j - 1)):
            if there in places:
                arm, ends = places[there] - here, f"P{i}_{j} P{there[0]}_{there[1]}"
                azimuth = math.atan2(arm[0], arm[1]) * 200.0 / math.pi
                reading = (azimuth - zero + rng.normal(0.0, 0.001)) % 400.0
                values = {
                    "7": reading,
                    "3": np.linalg.norm(arm) + rng.normal(0.0, 0.002),
                    "4": arm[2] + rng.normal(0.0, 0.001),
                }
                lines += [
                    f"{code if kind == '7' else kind} {ends} {values[kind]:.6f} 0.002" for kind in kinds
                ]
                code = 5
    (folder / "grid.obs").write_text("\n".join(lines))
    (folder / "grid.cor").write_text("\n".join(cor))
    return folder / "grid.obs", folder / "grid.cor", places


@pytest.mark.slow
def test_sights_without_zenith_angles_do_not_drift(tmp_path):
    # readings there and back carry the azimuth where no sight is a vector
    obs, cor, places = grid(tmp_path, 25, np.random.default_rng(3), "734")
    points, values = solved(obs, cor)
    true = np.array([places[tuple(map(int, name[1:].split("_")))] for name in points.names])
    assert np.linalg.norm(values.coordinates - true, axis=1).max() < 1.0
