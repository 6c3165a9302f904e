"""Which reference points have moved: the smallest set that explains it, several where nothing tells which."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from obseq.diagnosis.columns import Columns
from obseq.diagnosis.hypotheses import Family, Hypotheses
from obseq.diagnosis.linear import Linear
from obseq.diagnosis.linear_tests import LinearTests
from obseq.diagnosis.policy import POLICY
from obseq.errors import InputError
from obseq.leastsquares.sparse import Sparse
from obseq.report.compared import outcome
from obseq.report.summary import listing
from obseq.survey import Datum, Network, compare
from obseq.survey.epochs import congruence
from obseq.survey.epochs.congruence import motions_of, relative_to, similarities
from obseq.survey.epochs.displacements import Displacements
from obseq.survey.epochs.localisation import _Pulls, moved_references
from obseq.survey.planning.simulation import Simulation

PLACES = {
    "R0": (0.0, 0.0), "R1": (550.0, 0.0), "R2": (550.0, 550.0), "R3": (0.0, 540.0), "R4": (270.0, 640.0),
    "A": (300.0, -20.0), "B": (10.0, 230.0), "C": (260.0, 240.0), "D": (580.0, 240.0), "E": (300.0, 500.0),
}  # fmt: skip
THREE = ("R0", "R1", "R2", "A", "B", "C", "D", "E")


def epochs(folder, names, moved, codes=(5, 3), seed=1, datum=None, common=None):
    """Two epochs in the plane of points seen from each other, some of which have moved (name: metres).

    Of all that are not common, the second epoch has others beside them.
    """
    lines = [f"7 {n} {PLACES[n][0]} {PLACES[n][1]} 0 0.002" for n in names if n.startswith("R")]
    lines += [f"6 {n} {PLACES[n][0]} {PLACES[n][1]} 0" for n in names if not n.startswith("R")]
    (folder / "n.cor").write_text("\n".join(lines) + "\n")
    seen = {5: "0 0.001", 3: "1 0.003"}
    near = [
        (a, b) for a in names for b in names if a != b and np.hypot(*np.subtract(PLACES[a], PLACES[b])) < 450
    ]
    sights = []
    for origin in names:
        sights += [
            "#NEW",
            *(f"{code} {a} {b} {seen[code]}" for a, b in near if a == origin for code in codes),
        ]
    (folder / "n.obs").write_text("\n".join(sights) + "\n")
    network, rng = Network.read(folder / "n.obs", folder / "n.cor"), np.random.default_rng(seed)
    first, places = Simulation(network).drawn(rng), network.points.coordinates.copy()
    for name, shift in moved.items():
        places[network.points.index[name], :2] += shift
    there = replace(network, points=replace(network.points, coordinates=places))
    second = replace(Simulation(there).drawn(rng), points=first.points)
    others = tuple(name if name in (common or names) else f"{name} new" for name in second.points.names)
    second = replace(
        second,
        points=replace(second.points, names=others),
        book=replace(second.book, point_names=others),
    )
    return first.adjust(datum=datum), second.adjust(datum=datum)


def test_of_three_in_a_plane_the_one_that_moved_across_is_told_by_the_other_points(tmp_path):
    """R1 moved along x hardly changes its distance from R2, so that R0 may as well have moved."""
    for given in (None, THREE[:3]):
        datum = given and Datum("inner", points=given)
        found = compare(*epochs(tmp_path, THREE, {"R1": (0.03, 0.0)}, datum=datum), 0.01, reference=given)
        assert (found.moved, found.undecided, found.significant) == (("R1",), (), ("R1",))
        (told,) = found.record().reservations
        assert (
            "do not tell whether R1 or R0 has moved; that R1 has is told by the other points: 5 of 5" in told
        )


def test_without_other_points_nothing_tells_which_of_the_three(tmp_path):
    three = THREE[:3]
    pair = epochs(tmp_path, THREE, {"R1": (0.03, 0.0)}, datum=Datum("inner", points=three), common=three)
    found = compare(*pair, 0.01, reference=three)
    assert (found.moved, found.significant) == ((), ())
    assert set(found.undecided) == {"R0", "R1"}
    (obstacle,) = found.obstacles
    assert "R1 has moved, and nothing tells which" in obstacle


def test_of_three_the_one_that_moved_along_is_told_by_the_distance_of_the_others(tmp_path):
    three = THREE[:3]
    pair = epochs(tmp_path, THREE, {"R1": (0.03, 0.04)}, datum=Datum("inner", points=three))
    found = compare(*pair, 0.01, points=three, reference=three)
    assert (found.moved, found.undecided, found.obstacles) == (("R1",), (), ())


@pytest.mark.parametrize("datum", [None, Datum("inner", points=("R0", "R1", "R2", "R3", "R4"))])
def test_angles_alone_leave_the_scale_free_and_name_one_point(tmp_path, datum):
    """With a scale that is taken for measured, a second point had to move with the first."""
    five = ("R0", "R1", "R2", "R3", "R4", "A", "B", "C", "D", "E")
    pair = epochs(tmp_path, five, {"R4": (0.03, -0.05)}, codes=(5,), datum=datum)
    found = compare(*pair, 0.01, reference=None if datum is None else datum.points)
    assert (found.moved, found.undecided, found.obstacles) == (("R4",), (), ())
    assert set(found.significant) == {"R4"}


def plane(places, vectors, sigma=0.001):
    """Displacements in a plane, each coordinate of a point known as well as any."""
    n = len(places)
    flat = np.diag(np.tile([sigma**2, sigma**2, 0.0], n))
    names = tuple(f"P{k}" for k in range(n))
    lifted = [np.column_stack([one, np.zeros(n)]) for one in (places, vectors)]
    return Displacements(names, lifted[0], lifted[1], flat, np.ones(n, np.bool_))


def located(places, moved, level=0.001):
    vectors = np.zeros((len(places), 2))
    for row, shift in moved.items():
        vectors[row] = shift
    given = plane(np.asarray(places, np.float64), vectors)
    motions = similarities(given.places)[:, [0, 1, 3]]
    return moved_references(given, np.ones(len(places), np.bool_), congruence.Tester(level), motions)


RING = [(100.0 * np.sin(k), 100.0 * np.cos(k)) for k in np.pi / 3.0 * np.arange(6)]


def test_points_that_moved_alike_do_not_hide_each_other():
    """Taken out one after the other, 4, 1 and 5 went first: their removal lowers the statistic most."""
    found = located(RING, {2: (0.02, 0.01), 3: (0.02, 0.0)})
    assert [set(one) for one in found.sets] == [{2, 3}]
    assert located(RING, {}).sets == ()


def test_half_of_the_points_against_the_other_half_is_undecided():
    """Of four, two that moved alike have stayed as well as the other two: each pair agrees."""
    found = located(
        [(0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0)], {0: (0.05, 0.0), 1: (0.05, 0.0)}
    )
    assert {frozenset(one) for one in found.sets} >= {frozenset((0, 1)), frozenset((2, 3))}
    assert found.certain == ()


def test_three_that_all_moved_are_said_to_be_too_many():
    with pytest.raises(InputError, match="more than half have moved"):
        located(
            [(0.0, 0.0), (100.0, 0.0), (50.0, 80.0)], {0: (-0.05, -0.02), 1: (0.05, -0.02), 2: (0.0, 0.09)}
        )


def test_what_vectors_orient_is_fitted_by_no_rotation(tmp_path):
    """What the observations leave free is what constraints on the reference points know exactly."""
    given = plane(np.array(RING), np.zeros((6, 2)))
    every = np.ones(6, np.bool_)
    shifts = similarities(given.places)[:, :2]
    free = relative_to(given, every, shifts)

    class Epoch:
        undetermined = tuple(type("Motion", (), {"text": f"the position along {axis}"}) for axis in "xy")

    found = motions_of((Epoch, Epoch), free, every, is_spatial=True)
    assert found.shape[1] == 2
    np.testing.assert_allclose(shifts @ np.linalg.lstsq(shifts, found)[0], found, atol=1e-12)


def test_the_summary_says_that_nothing_tells_which(tmp_path):
    """The others agree without R0, and without another, by about as much; R2 and R3 are left."""
    four = ("R0", "R1", "R2", "R3", "C")
    pair = epochs(tmp_path, four, {"R0": (0.012, 0.0)}, datum=Datum("inner", points=four[:4]))
    found = compare(*pair, 0.05, reference=four[:4])
    assert found.moved == () and "R0" in found.undecided and len(found.undecided) == 2
    assert "moved, and nothing tells which" in listing(outcome(found.record()))
    assert found.record().to_dict()["undecided"] == list(found.undecided)


def test_what_sets_of_points_take_is_the_test_of_the_diagnosis():
    """T of the engine with displacements as observations, motions as unknowns, and each point a block."""
    random = np.random.default_rng(3)
    points, motions = 6, np.kron(np.ones((6, 1)), np.eye(3))
    root = random.normal(size=(18, 18)) + 4.0 * np.eye(18)
    vectors = random.normal(size=(points, 3))
    vectors[[2, 4]] += [[9.0], [-4.0]]
    moved = Displacements(
        tuple("ABCDEF"), np.zeros((points, 3)), vectors, root @ root.T, np.ones(points, np.bool_)
    )
    everywhere = np.ones(points, np.bool_)
    own = _Pulls.of(relative_to(moved, everywhere, motions), tuple(range(points)), 1.0)
    whiten = np.linalg.inv(root)
    rows, inverse = whiten @ motions, np.linalg.inv(motions.T @ whiten.T @ whiten @ motions)
    linear = Linear(
        whiten @ vectors.ravel(),
        Sparse.of_dense(rows),
        Sparse.of_dense(whiten),
        lambda: Sparse.of_dense(inverse),
        Sparse.of_diagonal(np.einsum("ij,jk,ik->i", rows, inverse, rows)),
        lambda right: inverse @ right,
        15,
    )
    blocks = Hypotheses([Family("S110", 3 * np.arange(points + 1), np.arange(18), is_block=True)])
    tests = LinearTests(linear, Columns(Sparse.of_dense(whiten.T), np.zeros(18, np.bool_)), blocks, POLICY)
    assert tests.cost == pytest.approx(own.squares) and own.freedom == 15
    for size in (1, 2):
        for chosen in combinations(range(points), size):
            left, freedom = own.without(chosen)
            assert left == pytest.approx(tests.cost - tests.took(chosen), rel=1e-9)
            assert freedom == 15 - 3 * size
