"""Networks of which nothing is known: placed in a frame of their own, adjusted with inner constraints."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from obseq.cli.main import main
from obseq.errors import ObseqError
from obseq.survey import Network, network_from_tables

PLACES = {"A": (0.0, 0.0), "B": (60.0, 10.0), "C": (20.0, 70.0), "D": (90.0, 80.0)}


def table(kinds, between):
    """Observations without errors, seen from A and B with circles of their own; nothing of the points."""
    rows = []
    for origin, turn in (("A", 0.3), ("B", 2.1)):
        for target in between:
            if target == origin:
                continue
            (x, y), (u, v) = PLACES[origin], PLACES[target]
            values = {"Hz": (np.arctan2(u - x, v - y) - turn) % (2 * np.pi), "DistHz": np.hypot(u - x, v - y)}
            rows += [(kind, origin, target, values[kind], 1e-5 if kind == "Hz" else 1e-3) for kind in kinds]
    return dict(
        zip(("type", "from", "to", "value", "sigma"), map(list, zip(*rows, strict=True)), strict=True)
    )


def shape(points):
    """Distances between all points."""
    xy = points.coordinates[[points.names.index(name) for name in PLACES], :2]
    return np.linalg.norm(xy[:, None] - xy[None], axis=2)


XY = np.array([*PLACES.values()])
TRUE = np.linalg.norm(XY[:, None] - XY[None], axis=2)


def free(kinds, between="ABCD"):
    known = {"name": list(PLACES), "x": [None] * 4, "y": [None] * 4, "z": [0.0] * 4, "sz": [0.0] * 4}
    return network_from_tables(known, table(kinds, between))


def test_a_free_network_keeps_its_shape():
    network = free(("Hz", "DistHz"))
    adjusted = network.adjust()
    np.testing.assert_allclose(shape(adjusted.points), TRUE, atol=1e-9)
    assert adjusted.solution.redundancy == 12 - (8 + 2 - 3)
    assert "placed in a frame of its own" in " ".join(network.book.warnings)


@pytest.mark.parametrize("name", ["A", "D"])
def test_one_approximate_point_says_where_a_free_network_is(name):
    """D is seen only, from A and B: the frame begins with one of its sights."""
    known = {"name": list(PLACES), "x": [None] * 4, "y": [None] * 4, "z": [0.0] * 4, "sz": [0.0] * 4}
    row = list(PLACES).index(name)
    known["x"][row], known["y"][row] = 5000.0, 7000.0
    network = network_from_tables(known, table(("Hz", "DistHz"), "ABCD"))
    adjusted = network.adjust()
    np.testing.assert_allclose(shape(adjusted.points), TRUE, atol=1e-9)
    assert adjusted.points.coordinates[row, :2] == pytest.approx([5000.0, 7000.0], abs=1e-6)
    assert f"only {name} has coordinates" in " ".join(network.book.warnings)
    assert adjusted.solution.redundancy == 12 - (8 + 2 - 3)


def test_a_known_point_without_a_direction_is_no_free_network():
    known = {"name": ["A"], "x": [5000.0], "y": [7000.0], "z": [0.0], "sx": [0.0], "sy": [0.0], "sz": [0.0]}
    with pytest.raises(ObseqError, match="A"):
        network_from_tables(known, table(("Hz", "DistHz"), "ABCD")).adjust()


def test_angles_alone_have_a_scale_of_their_own():
    network = free(("Hz",))
    adjusted = network.adjust()
    found = shape(adjusted.points)
    np.testing.assert_allclose(found / found[0, 1], TRUE / TRUE[0, 1], atol=1e-8)
    assert "No distance is measured" in " ".join(network.book.warnings)


def test_one_known_point_leaves_the_choice_to_it():
    known = {"name": ["A"], "x": [5.0], "y": [6.0], "z": [0.0], "sx": [0.0], "sy": [0.0], "sz": [0.0]}
    network = network_from_tables(known, table(("Hz", "DistHz"), "ABCD"))
    assert "a frame of its own" not in " ".join(network.book.warnings)


def test_the_case_of_three_stations_that_do_not_see_each_other(shared_data):
    """Own dense solution with a pseudo-inverse: 0.889742, redundancy 26."""
    network = Network.read_project(shared_data / "survey-cases/16-free-network-no-coordinates/net.gkf")
    adjusted = network.adjust()
    assert adjusted.sigma0 == pytest.approx(0.889742, abs=5e-7)
    assert adjusted.solution.redundancy == 26


def test_observations_that_place_nothing_are_still_refused():
    known = {"name": ["A", "B"], "x": [None] * 2, "y": [None] * 2, "z": [None] * 2}
    rows = {"type": ["Zen"], "from": ["A"], "to": ["B"], "value": [1.5], "sigma": [1e-5]}
    with pytest.raises(ObseqError, match="no point is known"):
        network_from_tables(known, rows).adjust()


def between(names, folder, seed, share=1.0):
    """Slope distances between points in space, of 2 mm, and where the points are."""
    chance = np.random.default_rng(seed)
    places = chance.uniform(0.0, 1000.0, (len(names), 3)) * [1.0, 1.0, 0.2]
    pairs = [pair for pair in itertools.combinations(range(len(names)), 2) if chance.random() < share]
    sets = "".join(
        f'<obs from="{names[a]}"><s-distance to="{names[b]}" stdev="2" '
        f'val="{np.linalg.norm(places[a] - places[b]) + chance.normal(0.0, 0.002):.5f}"/></obs>'
        for a, b in pairs
    )
    points = "".join(f'<point id="{name}" adj="XYZ"/>' for name in names)
    head = '<gama-local xmlns="http://www.gnu.org/software/gama/gama-local"><network><points-observations>'
    tail = "</points-observations></network></gama-local>"
    (folder / "space.gkf").write_text(f"{head}{points}{sets}{tail}")
    return Network.read_project(folder / "space.gkf"), places, len(pairs)


@pytest.mark.parametrize("seed", range(4))
def test_slope_distances_alone_make_a_network_in_space(tmp_path, seed):
    names = "ABCDEFGH"
    network, places, count = between(names, tmp_path, seed, share=0.9)
    adjusted = network.adjust()
    found = adjusted.points.coordinates[[adjusted.points.names.index(name) for name in names]]
    assert adjusted.record().redundancy == count - 3 * len(names) + 6
    for a, b in itertools.combinations(range(len(names)), 2):
        gap = np.linalg.norm(found[a] - found[b]) - np.linalg.norm(places[a] - places[b])
        assert abs(gap) < 0.03, (names[a], names[b])
    assert any("Nothing says what is vertical" in text for text in adjusted.record().warnings)


def sub_frames(keyword, tilt):
    """Three set-ups of nine points, of 1 mm in each axis, turned at random; as the text of an OBS file."""
    chance = np.random.default_rng(3)
    places, lines = chance.uniform(0.0, 30.0, (9, 3)), []
    for origin, seen in enumerate(([2, 3, 4, 5, 6], [3, 4, 5, 6, 7, 8], [0, 3, 4, 5, 7, 8])):
        turn = Rotation.from_euler("zxy", [*chance.uniform(-2.0, 2.0, 1), tilt, -tilt]).as_matrix()
        lines.append(keyword)
        for row in seen:
            xyz = turn @ (places[row] - places[origin]) + chance.normal(0.0, 1e-3, 3)
            lines += [f"{14 + axis} P{origin} P{row} {value:.5f} 0.001" for axis, value in enumerate(xyz)]
    return "\n".join(lines), places


@pytest.mark.parametrize(("keyword", "tilt", "defect"), [("#VERT", 0.0, 4), ("#BASC", 0.5, 6)])
def test_sub_frames_need_no_known_point_and_no_file_of_points(tmp_path, keyword, tilt, defect, capsys):
    text, places = sub_frames(keyword, tilt)
    (tmp_path / "o.obs").write_text(text)
    adjusted = Network.read(tmp_path / "o.obs").adjust()
    found = adjusted.points.coordinates[[adjusted.points.names.index(f"P{k}") for k in range(9)]]
    gaps = np.linalg.norm(found[:, None] - found, axis=2) - np.linalg.norm(places[:, None] - places, axis=2)
    assert np.abs(gaps).max() < 5e-3
    assert adjusted.solution.redundancy == 51 - (27 + (3 if tilt else 1) * 3 - defect)
    assert main(["adjust", str(tmp_path / "o.obs")]) == 0
    assert "no point has coordinates: the network is placed in" in capsys.readouterr().out
