"""Derivatives by points whose instruments turn with their plumb lines, beside differences of everything."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from obseq.errors import SingularSystemError
from obseq.leastsquares.assembly.evaluation import jacobian_rows
from obseq.survey import Datum, Network, Quality, estimating, network_from_tables
from obseq.survey.equations.equations import Equations
from obseq.survey.equations.point_system import PointSystem
from obseq.survey.initial.initial_values import InitialValues
from obseq.survey.model import Orientation
from obseq.survey.planning.simulation import Simulation

FRAME = "RTL*2.4*58.8*0*EPSG:4326"
COR = "1 A 3000 2000 700 1 1 1\n1 B 11000 2500 900 1 1 1\n0 P 6000 9000 1200\n0 Q 10000 12500 300\n"
OBS = """#FIX
8 A B 0 0.001
8 Q P 0 0.001
#VERT
5 A B 0 0.001
5 A P 0 0.001
6 A P 100 0.001
3 A P 7000 0.01
5 P A 0 0.001
5 P B 0 0.001
6 P B 0 0.001
14 P B 0 0.01
15 P B 0 0.01
16 P B 0 0.01
#BASC
5 B A 0 0.001
6 B A 0 0.001
5 B P 0 0.001
5 B Q 0 0.001
6 B Q 0 0.001
#FIX
14 B P 0 0.01
15 B P 0 0.01
"""
ANGLES = {("Hz", False), ("Azim", False), ("Zen", False), ("ZenK", False)}
STEP = 20.0  # m
ORDERS = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}


def network(folder):
    (folder / "o.obs").write_text(OBS)
    (folder / "p.cor").write_text(COR)
    return Network.read(folder / "o.obs", folder / "p.cor", frame=FRAME)


def equations(of, orientations):
    """The equations at the coordinates of the file, with stations turned anyhow, without refraction."""
    frame, points = replace(of.frame, refraction_coefficient=0.0), of.points
    book = replace(of.book, stations=replace(of.book.stations, orientations=orientations))
    n, m = len(points), len(orientations)
    vectors = np.outer(orientations != Orientation.FIX, (0.0, 0.0, 0.8))
    vectors[orientations == Orientation.BASC] = 0.4, -0.3, 0.5
    turned = Rotation.from_rotvec(vectors).as_matrix()
    rotations = frame.vertical(points.coordinates[book.stations.origins]).transpose(0, 2, 1) @ turned
    steps = (None,) * n, (None,) * m
    start = InitialValues(points.coordinates, rotations, np.zeros(m), orientations, *steps, (), np.ones(n))
    return Equations(frame, PointSystem(frame.system, frame.system), points, book, start)


def by_points(of):
    """(n, n_points, 3) derivatives of each family by the coordinates of all points."""
    found = {}
    for family, (_, batch) in of.batches.items():
        rows = jacobian_rows(of.system.unknowns, batch)[1:]
        found[family] = np.zeros((batch.n, len(of.points), 3))
        for role, ids in zip(batch.shape.roles, batch.blocks, strict=True):
            if role.kind == "Point3":
                np.add.at(found[family], (np.arange(batch.n), ids), rows[role.row : role.row + 3].T)
    return found


def differences(of):
    """The same by differences of residuals, everything made anew at moved points."""
    places = of.system.values(of.points)
    found = {family: np.zeros((batch.n, *places.shape)) for family, (_, batch) in of.batches.items()}
    for at in np.ndindex(places.shape):
        step = STEP * np.eye(1, places.size, np.ravel_multi_index(at, places.shape)).reshape(places.shape)
        for count, share in ORDERS.items():
            ends = [residuals(of, places + count * step), residuals(of, places - count * step)]
            for family in found:
                gap = ends[0][family] - ends[1][family]
                whole = 2.0 * np.pi * np.round(gap / (2.0 * np.pi)) if family in ANGLES else 0.0
                found[family][(slice(None), *at)] += share / STEP * (gap - whole)
    return found


def residuals(of, places):
    """Of each family, with all points at places (n, 3)."""
    of.system.set_values(of.points, places)
    of.follow(of.system, 0)
    return {family: of.system.residuals(batch)[:, 0] for family, (_, batch) in of.batches.items()}


@pytest.mark.parametrize("unknowns", [[], ["refraction", "frame-scale"]])
def test_derivatives_are_those_of_residuals_whose_plumb_lines_turn(tmp_path, unknowns):
    """Sights of some kilometres: plumb lines that did not turn would make 1e-3 of a derivative."""
    given = network(tmp_path)
    given = replace(given, book=estimating(given.book, unknowns)) if unknowns else given
    orientations = given.book.stations.orientations.copy()
    orientations[-1] = Orientation.GRID
    assert set(orientations) == set(Orientation) - {Orientation.CAM}  # cameras turn with no plumb line
    made = equations(given, orientations)
    derivatives = by_points(made)
    expected = differences(made)
    assert len(derivatives) == (6 if unknowns else 7)
    for family, rows in derivatives.items():
        largest = np.abs(rows).max(axis=(1, 2))[:, None, None]
        np.testing.assert_allclose(rows / largest, expected[family] / largest, rtol=0, atol=1e-9)


def test_stations_along_the_grid_stay_along_it_wherever_their_point_goes(tmp_path):
    given = network(tmp_path)
    orientations = given.book.stations.orientations.copy()
    orientations[-1] = Orientation.GRID
    made = equations(given, orientations)
    residuals(made, made.system.values(made.points) + np.array([50_000.0, 20_000.0, 0.0]))
    right = made.instruments.rotations(made.system)[-1][:, 0]
    assert abs(right[1]) < 1e-12  # the convergence of the meridians is 1e-2 there


@pytest.mark.parametrize("size", [100.0, 1000.0, 50_000.0])
def test_one_known_point_leaves_the_rotation(size):
    """Plumb lines that were held would determine it to 15 m whatever the size."""
    with pytest.raises(SingularSystemError, match="nothing fixes the rotation about z of B, C, D"):
        surveyed(size, known={"A": (0.001, 0.001, 0.001)}).adjust()


def test_known_heights_leave_the_position_of_a_small_network():
    """Curvature alone shows where it is: to half of its size, which is not determined."""
    size, heights = 100.0, dict.fromkeys("ABC", (None, None, 0.001))
    loose = "nothing fixes the position along x, y and the rotation about z of A, B, C, D"
    with pytest.raises(SingularSystemError, match=loose):
        surveyed(size, heights).adjust()
    known = heights | {"D": (0.001, 0.001, None), "A": (0.001, 0.001, None)}
    assert surveyed(size, known).adjust().sigma0 < 1e-4


def test_known_heights_show_the_position_of_a_large_network():
    """A plane through three heights of 1 mm leans by s / D, and the position is R s / D off."""
    size, heights = 50_000.0, dict.fromkeys("ABC", (None, None, 0.001))
    found = surveyed(size, heights, azimuth=True).adjust(quality=Quality(a_priori=True))
    assert found.solution.converged
    expected = 6.4e6 * 0.001 / size
    precisions = found.points.precisions[:, :2]
    assert 0.3 * expected < precisions.min() and precisions.max() < 100.0 * expected


@pytest.mark.parametrize(("size", "free"), [(10.0, 4), (1000.0, 4), (10_000.0, 4), (200_000.0, 3)])
def test_free_networks_move_over_the_earth_and_turn(size, free):
    """Redundancies are those of one point and one direction held; the height of the largest is seen."""
    network = surveyed(size, {"A": (1e-3,) * 3, "B": (1e-3,) * 3})
    found = network.adjust(datum=Datum("inner"))
    assert found.solution.redundancy == 20 + free  # 36 observations, 12 coordinates and 4 orientations
    redundancies = [row.redundancy for row in found.record().observations]
    assert sum(redundancies) == pytest.approx(20 + free, abs=1e-7 if free == 4 else 1e-4)
    if free == 4:
        held = surveyed(size, {"A": (1e-3, 1e-3, 1e-3), "B": (1e3 * size, 1e-3, None)}).adjust()
        expected = [row.redundancy for row in held.record().observations]
        np.testing.assert_allclose(redundancies, expected, rtol=0, atol=2e-9 + 1e-14 * size**2)


def surveyed(size, known, azimuth=False):
    """All sights between four points, without errors."""
    places = {"A": (0.0, 0.0, 0.01), "B": (0.9, 0.1, 0.02), "C": (0.3, 0.8, 0.04), "D": (0.7, 0.7, 0.06)}
    points = {"name": list(places)}
    for k, axis in enumerate("xyz"):
        points[axis] = [size * place[k] for place in places.values()]
        points[f"s{axis}"] = [known.get(name, (None,) * 3)[k] for name in places]
    rows = [
        {"type": kind, "from": a, "to": b, "value": 1.0, "sigma": sigma}
        for kind, sigma in (("Hz", 3e-6), ("Zen", 3e-6), ("Dist", 0.002))
        for a, b in permutations(places, 2)
    ]
    rows += [{"type": "Azim", "from": "A", "to": "B", "value": 1.0, "sigma": 3e-6}] * azimuth
    table = {column: [row[column] for row in rows] for column in rows[0]}
    return Simulation(network_from_tables(points, table, frame=FRAME)).without_errors()
