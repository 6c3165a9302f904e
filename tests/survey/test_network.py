"""Whole networks, against the numbers of MMVII and of Comp3D."""

import json
import math
import pickle
from importlib.resources import files

import numpy as np
import pytest

from obseq.errors import InputError, SingularSystemError
from obseq.survey import Network, Orientation, PointFileOptions

LAMBERT = "IGNF:LAMB93"
DEMO_FRAME = f"RTL*657700*6860700*0*{LAMBERT}"
BENCH_FRAME = "RTL*45*0*0*+proj=latlong +datum=WGS84"


def demo_network(frame=DEMO_FRAME):
    data = files("obseq.survey") / "data"
    return Network.read(str(data / "demo.obs"), str(data / "demo.cor"), frame=frame, points_crs=LAMBERT)


@pytest.fixture(scope="module")
def demo():
    return demo_network().adjust()


def read(folder, observations, points, **options):
    """A network from the texts of an OBS and of a COR file."""
    (folder / "net.obs").write_text(observations)
    (folder / "net.cor").write_text(points)
    return Network.read(folder / "net.obs", folder / "net.cor", **options)


def test_demo_counts_and_sigma0_are_those_of_mmvii(demo):
    solution = demo.solution
    assert (solution.n_unknowns, solution.n_observations + solution.n_constraints) == (14, 18)
    expected = [5443.8677, 113.0359, 1.796185, 1.7655199]
    assert [step.sigma0 for step in solution.iterations[:4]] == pytest.approx(expected, rel=1e-6)
    assert demo.sigma0 == pytest.approx(1.76552, abs=5e-6)
    assert math.sqrt(solution.variance_factor) == pytest.approx(1.76565, abs=5e-6)
    assert demo.converged


def test_demo_coordinates_are_those_of_comp3d(demo, shared_data):
    expected = json.loads((shared_data / "mmvii-topomini" / "expected.json").read_text())
    assert expected
    # README of mmvii-topomini, E N h.
    known = {
        "PtA": (657700.000000, 6860699.999970, 10.000006),
        "PtB": (657710.001929, 6860701.001980, 10.000012),
        "PtC": (657711.001208, 6860710.002860, 10.000024),
        "PtD": (657700.000000, 6860690.000030, 9.999994),
    }
    for name, xyz in zip(demo.points.names, demo.points.crs_coordinates, strict=True):
        np.testing.assert_allclose(xyz, known[name], rtol=0, atol=1e-5, err_msg=name)


def test_demo_residuals_belong_to_the_final_solution(demo):
    # topo-adjustment.md 15.5: Dist AB, AC, DB, DC in metres; Hz AB in gon.
    book = demo.book
    distances = demo.residuals[book.observations.types == 3]
    np.testing.assert_allclose(distances, [0.003175, -0.009350, -0.009442, 0.011165], atol=5e-7)
    hz = demo.residuals[book.observations.types == 5] * 200 / np.pi
    np.testing.assert_allclose(hz, [-6.686e-5, 6.686e-5, 5.363e-5, -5.363e-5], atol=5e-9)
    np.testing.assert_allclose(demo.stations.g0 * 200 / np.pi, [93.178806, 46.506503], atol=1e-6)


def test_sigma0_follows_from_the_residuals_listed(demo):
    squares = np.sum(demo.normalised_residuals**2)
    assert demo.sigma0 == pytest.approx(math.sqrt(squares / demo.solution.redundancy), rel=1e-12)


def test_the_origin_of_the_frame_changes_nothing(demo):
    mean = demo_network("RTL").adjust()
    np.testing.assert_allclose(mean.points.crs_coordinates, demo.points.crs_coordinates, rtol=0, atol=1e-7)
    assert mean.sigma0 == pytest.approx(demo.sigma0, rel=1e-8)


def test_only_pta_known_with_a_bearing(tmp_path, demo):
    # topo-adjustment.md 15.5, the variant with minimal constraints.
    data = files("obseq.survey") / "data"
    observations = "#FIX\n5 PtA PtB 100 0.001\n#VERT\n" + (data / "demo.obs").read_text()
    points = (data / "demo.cor").read_text().replace("1 PtD", "0 PtD")
    solution = read(tmp_path, observations, points, frame="RTL", points_crs=LAMBERT).adjust()
    first = [step.sigma0 for step in solution.solution.iterations[:4]]
    assert first[::3] == pytest.approx([7705.80, 2.494299], rel=2e-6)
    # On the way MMVII holds the plumb lines while it differentiates; ours turn with their stations.
    assert first[1:3] == pytest.approx([446.181, 5.47922], rel=3e-5)
    rows = dict(zip(solution.points.names, solution.points.crs_coordinates, strict=True))
    np.testing.assert_allclose(rows["PtC"], (657712.008, 6860708.77, 10.0), rtol=0, atol=6e-3)


@pytest.mark.parametrize(("case", "sigma0"), [("ex1", 0.70711), ("ex3", 1.00918)])
def test_bench_of_mmvii(shared_data, case, sigma0):
    folder = shared_data / "mmvii-topo-bench"
    network = Network.read(folder / f"{case}.obs", folder / f"{case}.cor", frame=BENCH_FRAME)
    assert network.adjust().sigma0 == pytest.approx(sigma0, abs=1e-5)


def test_bench_of_mmvii_with_a_free_rotation(shared_data):
    folder = shared_data / "mmvii-topo-bench"
    adjusted = Network.read(folder / "ex4.obs", folder / "ex4.cor", frame=BENCH_FRAME).adjust()
    assert adjusted.sigma0 < 1e-8
    rows = dict(zip(adjusted.points.names, adjusted.points.coordinates, strict=True))
    np.testing.assert_allclose(rows["St"], (250.190933, 794.427602, 551.37138), atol=1e-8)


def test_bench_residuals_of_example_3(shared_data):
    folder = shared_data / "mmvii-topo-bench"
    adjusted = Network.read(folder / "ex3.obs", folder / "ex3.cor", frame=BENCH_FRAME).adjust()
    rows = {(kind, k): value for k, (kind, value) in enumerate(_residuals(adjusted))}
    by_type = {}
    for (kind, _), value in rows.items():
        by_type.setdefault(kind, []).append(value)
    np.testing.assert_allclose(by_type["Dist"], [1e-3, -1e-3], atol=1e-7)
    np.testing.assert_allclose(by_type["DH"], [-1.910e-6], atol=5e-9)
    np.testing.assert_allclose(by_type["Zen"], [-1.9115e-5], atol=2e-9)


def _residuals(adjusted):
    record = adjusted.to_dict()
    return [(row["type"], row["residual"]) for row in record["observations"]]


def figure_observations(shared_data):
    """The OBS file of comp3d-figure with its azimuth (code 8) written for MMVII."""
    text = (shared_data / "comp3d-figure" / "figure.obs").read_text("latin-1")
    azimuth, rest = text.split("\n", 1)
    assert azimuth.startswith("8 HLLST0001  HLLPI0005")
    return "#FIX\n5 HLLST0001 HLLPI0005 100 0.001\n#VERT\n" + rest


@pytest.mark.parametrize(
    ("frame", "sigma0"),
    [
        # MMVII's own figure: it reads EPSG:4326 latitude first, so its RTL*0*44.40 lies on the equator.
        ("RTL*44.40*0*0*EPSG:4326", 0.896159),
        # The same network where it is meant to be, at latitude 44.40: the curvature there is another one.
        ("RTL*0*44.40*0*EPSG:4326", 0.896176),
    ],
)
def test_figure_starts_from_one_point_and_agrees_with_mmvii(shared_data, tmp_path, frame, sigma0):
    points = "1 HLLST0001 100 100 10 0.001 0.001 0.001\n"
    adjusted = read(tmp_path, figure_observations(shared_data), points, frame=frame).adjust()
    assert adjusted.solution.n_observations == 533
    assert adjusted.sigma0 == pytest.approx(sigma0, abs=1e-6)
    assert adjusted.converged


def test_an_adjustment_and_its_network_can_be_pickled(demo):
    again, network = pickle.loads(pickle.dumps((demo, demo_network())))
    assert again.record() == demo.record()
    np.testing.assert_array_equal(again.points.covariances, demo.points.covariances)
    assert network.adjust().sigma0 == demo.sigma0


def test_record_has_the_fields_of_the_contract(demo):
    record = demo.to_dict()
    assert (record["format"], record["version"]) == ("obseq-adjustment", 1)
    assert (
        record["n_observations"] + record["n_constraints"] - record["n_unknowns"] == record["redundancy"] == 4
    )
    assert record["stations"][0] == {
        "origin": "PtA",
        "orientation": "#VERT",
        "g0": pytest.approx(93.178806 * np.pi / 200, abs=1e-7),
    }
    first = record["observations"][0]
    assert (first["type"], first["from"], first["to"], first["active"]) == ("Hz", "PtA", "PtB", True)
    assert first["sigma"] == pytest.approx(1.5707963267948967e-05, rel=1e-15)
    assert first["file"].endswith("demo.obs")
    assert record["frame"] == DEMO_FRAME
    json.dumps(record)


def test_inactive_observations_are_reported_and_do_not_count(tmp_path, demo):
    data = files("obseq.survey") / "data"
    observations = (data / "demo.obs").read_text() + "3 PtA PtB 99 -0.005\n"
    adjusted = read(
        tmp_path, observations, (data / "demo.cor").read_text(), frame=DEMO_FRAME, points_crs=LAMBERT
    )
    adjusted = adjusted.adjust()
    assert adjusted.solution.n_observations == 12
    last = adjusted.to_dict()["observations"][-1]
    places = dict(zip(adjusted.points.names, adjusted.points.coordinates, strict=True))
    length = float(np.linalg.norm(places["PtB"] - places["PtA"]))
    assert (last["active"], last["residual"]) == (False, pytest.approx(length - 99.0, abs=1e-4))
    np.testing.assert_allclose(adjusted.points.coordinates, demo.points.coordinates, atol=1e-9)


def test_held_coordinates_do_not_move(tmp_path, demo):
    data = files("obseq.survey") / "data"
    points = (data / "demo.cor").read_text().replace("0.001", "0")
    adjusted = read(
        tmp_path, (data / "demo.obs").read_text(), points, frame=DEMO_FRAME, points_crs=LAMBERT
    ).adjust()
    rows = dict(zip(adjusted.points.names, adjusted.points.crs_coordinates, strict=True))
    np.testing.assert_allclose(rows["PtA"], (657700, 6860700, 10), rtol=0, atol=1e-8)
    assert (adjusted.solution.n_unknowns, adjusted.solution.n_constraints) == (8, 0)
    assert demo.solution.redundancy == adjusted.solution.redundancy


def test_no_redundancy_gives_a_priori_precisions(tmp_path):
    points = "1 A 0 0 0 0.001\n1 B 10 0 0 0.001\n1 C 0 10 0 0.001\n0 P 3 4 5\n"
    observations = "3 P A 7.0711 0.01\n3 P B 9.4868 0.01\n3 P C 8.3666 0.01\n"
    adjusted = read(tmp_path, observations, points).adjust()
    assert adjusted.solution.redundancy == 0
    assert (adjusted.sigma0, adjusted.precision) == (None, "a priori")
    assert (adjusted.points.precisions[3] > 0.005).all()


def test_plumb_station_needs_a_vertical(tmp_path):
    points = "1 A 0 0 0 0.001\n1 B 10 0 0 0.001\n"
    with pytest.raises(InputError, match=r"Hz A -> B \(.*net.obs:1\): a #VERT station needs a frame"):
        read(tmp_path, "7 A B 0 0.001\n", points, frame=LAMBERT).adjust()


def test_points_with_too_few_observations_are_named(tmp_path):
    points = "1 A 0 0 0 0.001\n0 B 10 0 0\n"
    network = read(tmp_path, "3 A B 10 0.001\n", points)
    with pytest.raises(InputError, match=r"B \(1\)"):
        network.adjust(strict=True)
    with pytest.raises(InputError, match="point B: it has 1 usable observation for 3 unknown coordinates"):
        network.adjust()


def test_undetermined_unknowns_are_named(tmp_path):
    # Three distances to two points: the free point can turn around the line that joins them.
    points = "1 A 0 0 0 0.001\n1 B 10 0 0 0.001\n0 P 5 5 0\n"
    observations = "3 A P 7.0711 0.01\n3 B P 7.0711 0.01\n3 A P 7.0712 0.01\n"
    with pytest.raises(SingularSystemError, match="nothing fixes the position along z of P"):
        read(tmp_path, observations, points).adjust()


def test_station_orientations_after_automatic_fix(tmp_path):
    points = "1 A 0 0 0 0.001\n0 B 10 1 1\n"
    observations = "6 A B 95 0.001\n3 A B 10.1 0.01\n#FIX\n5 A B 94 0.001\n"
    adjusted = read(tmp_path, observations, points, frame="RTL*2*48*0*EPSG:4326").adjust()
    assert [Orientation(status) for status in adjusted.stations.orientations] == [Orientation.FIX] * 2


def test_a_network_without_known_point_is_refused(tmp_path):
    with pytest.raises(InputError, match="no point is known"):
        read(tmp_path, "3 A B 10 0.001\n", "0 A 0 0 0\n0 B 10 0 0\n").adjust()


@pytest.mark.parametrize("line", ["5 A V 20 0.001", "6 A V 0 0.001"])
def test_a_target_on_the_vertical_is_named_with_its_line(tmp_path, line):
    points = "1 A 0 0 0 0.001\n1 B 10 0 0 0.001\n1 V 0 0 5 0.001\n"
    with pytest.raises(InputError, match=r"A -> V \(.*net.obs:2\): the target is on the vertical"):
        read(tmp_path, f"7 A B 0 0.001\n{line}\n", points, frame="RTL*2*48*0*EPSG:4326").adjust()


def test_a_target_in_the_place_of_its_station_is_said_to_be_there(tmp_path):
    points = "1 A 0 0 0 0.001\n1 B 10 0 0 0.001\n1 V 0 0 0 0.001\n"
    with pytest.raises(InputError, match=r"the target has the coordinates of the station.*coordinates of V"):
        read(tmp_path, "7 A B 0 0.001\n5 A V 20 0.001\n", points).adjust()


def test_metres_are_no_degrees(tmp_path):
    points = "1 A 652000 6860700 0 0.001\n0 B 652010 6860700 0\n"
    wanted = (
        r"^point A \(.*net.cor:1\): 652000, 6860700 are no longitude and latitude in degree, which EPSG:4326"
    )
    with pytest.raises(InputError, match=wanted):
        read(tmp_path, "3 A B 10 0.001\n", points, points_crs="EPSG:4326")


def test_disconnected_points_are_listed_with_the_reason(tmp_path):
    points = "1 A 0 0 0 0.001\n1 B 10 0 0 0.001\n"
    observations = "3 A B 10 0.01\n3 P Q 5 0.01\n"
    with pytest.raises(InputError, match=r"point P: not connected[\s\S]*point Q: not connected"):
        read(tmp_path, observations, points).adjust()


def test_points_in_another_format_give_the_same_network(tmp_path, demo):
    # MMVII's own import: ImportGCP ANXYZ, AddInfoFree=0, Sigma=0.001.
    lines = ["1 PtA 657700 6860700 10", "0 PtB 657710 6860700 10"]
    lines += ["0 PtC 657710 6860710 10", "1 PtD 657700 6860690 10"]
    (tmp_path / "points.txt").write_text("\n".join(lines))
    network = Network.read(
        str(files("obseq.survey") / "data" / "demo.obs"),
        tmp_path / "points.txt",
        frame=DEMO_FRAME,
        points_crs=LAMBERT,
        point_sigma=0.001,
        point_format="ANXYZ",
        point_options=PointFileOptions(free_pattern="0"),
    )
    adjusted = network.adjust()
    np.testing.assert_allclose(adjusted.points.coordinates, demo.points.coordinates, atol=1e-9)
    assert adjusted.sigma0 == pytest.approx(demo.sigma0)


def test_a_refraction_that_is_no_number_is_refused_in_words(tmp_path):
    with pytest.raises(InputError, match="refraction must be a finite number, not None"):
        Network.read(tmp_path / "a.obs", tmp_path / "a.cor", refraction=None)
