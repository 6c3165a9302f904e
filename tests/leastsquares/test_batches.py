"""What does not fit is refused with the names of formula, argument and row."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
import pytest

from obseq import FormulaError, InputError
from obseq.leastsquares import LeastSquares
from obseq.leastsquares.assembly.evaluation import jacobian_rows
from obseq.leastsquares.problem.manifolds import PLUMB
from obseq.leastsquares.problem.shapes import Move


@pytest.fixture
def system():
    made = LeastSquares()
    made.add_points(["A", "B", "C"], [[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [1.0, 1.0, 5.0]])
    made.add_rotations(["A"], [np.eye(3)])
    return made


PAIRS = {"p1": np.array([0, 1]), "p2": np.array([1, 2])}


@pytest.mark.parametrize(
    ("blocks", "message"),
    [
        ({"p1": [0, 1]}, r"Dist3D: block arguments missing: p2; not in the formula: none"),
        ({**PAIRS, "p3": [0, 1]}, r"missing: none; not in the formula: p3"),
        ({"p1": [0, 3], "p2": [1, 2]}, r"Dist3D, p1: row 1 gives 'A', a Rotation of 3; .* wants a Point3"),
        ({"p1": [0, 9], "p2": [1, 2]}, r"Dist3D, p1: row 1 has block id 9; ids go from 0 to 3"),
        ({"p1": [0, -1], "p2": [1, 2]}, r"row 1 has block id -1"),
        ({"p1": [0.0, 1.0], "p2": [1, 2]}, r"Dist3D, p1: block ids must be a 1-D array of integers"),
        ({"p1": [0, 1, 2], "p2": [1, 2]}, r"Dist3D, p2: 2 ids; other arguments have 3"),
    ],
)
def test_blocks_that_do_not_fit(system, blocks, message):
    with pytest.raises(InputError, match=message):
        system.add("Dist3D", blocks, [5.0, 5.0], 0.001)


@pytest.mark.parametrize(
    ("observations", "message"),
    [
        ([5.0], r"Dist3D: observations have shape \(1,\); expected \(2, 1\)"),
        ([[5.0, 1.0], [5.0, 1.0]], r"shape \(2, 2\); expected \(2, 1\)"),
        ([5.0, np.nan], r"Dist3D B -> C \(row 1\): the observation is not finite"),
    ],
)
def test_observations_that_do_not_fit(system, observations, message):
    with pytest.raises(InputError, match=message):
        system.add("Dist3D", PAIRS, observations, 0.001)


@pytest.mark.parametrize("sigma", [0.0, -1.0, np.nan, np.inf])
def test_sigmas_are_positive_and_finite(system, sigma):
    labels = ["A B (f.obs:3)", "B C (f.obs:4)"]
    with pytest.raises(InputError, match=r"Dist3D B C \(f.obs:4\): sigma must be positive and finite"):
        system.add("Dist3D", PAIRS, [5.0, 5.0], [0.001, sigma], labels=labels)


def test_sigmas_of_a_wrong_shape(system):
    with pytest.raises(InputError, match=r"Dist3D: sigmas have shape \(3,\); expected a number, \(2,\)"):
        system.add("Dist3D", PAIRS, [5.0, 5.0], [0.001, 0.001, 0.001])


def test_labels_and_activity_have_one_entry_per_observation(system):
    with pytest.raises(InputError, match="Dist3D: 1 labels for 2 observations"):
        system.add("Dist3D", PAIRS, [5.0, 5.0], 0.001, labels=["one"])
    with pytest.raises(InputError, match=r"Dist3D: active has shape \(1,\)"):
        system.add("Dist3D", PAIRS, [5.0, 5.0], 0.001, active=[True])


def test_an_unknown_formula(system):
    with pytest.raises(FormulaError, match="Dist3D"):
        system.add("Dist3E", PAIRS, [5.0, 5.0], 0.001)


def test_one_id_stands_for_all_rows(system):
    batch = system.add("Dist3D", {"p1": [0], "p2": [1, 2]}, [5.0, 5.0], 0.001)
    assert batch.blocks.tolist() == [[0, 0], [1, 2]]
    assert len(batch) == 2


def test_observations_are_replaced_not_written_to(system):
    batch = system.add("Dist3D", PAIRS, [5.0, 6.0], 0.001)
    for given in (batch.observations, batch.observations[:1]):
        with pytest.raises(InputError, match=r"batch.observations.copy\(\).*batch.observations = values"):
            given[0] = 7.0
    batch.observations += 1.0
    assert batch.observations.tolist() == [[6.0], [7.0]]
    assert type(batch.observations + 1.0) is np.ndarray


def test_linear_rows_take_new_right_hand_sides():
    system = LeastSquares()
    x = system.add_scalars(["x"], [0.0])
    batch = system.add_linear([x[[0, 0]]], [[[1.0], [2.0]]], [0.0, 0.0], 1.0)
    batch.observations = [3.0, 6.0]
    assert batch.observations.tolist() == [[1.0, 3.0], [2.0, 6.0]]
    assert system.solve().values(x)[0, 0] == pytest.approx(3.0)
    message = r"expected \(2, 2\), coefficients and right-hand side, or \(2,\), right-hand sides"
    with pytest.raises(InputError, match=message):
        batch.observations = [1.0, 2.0, 3.0]


def test_observations_can_be_replaced_and_are_checked_again(system):
    batch = system.add("Dist3D", PAIRS, [5.0, 6.0], 0.001)
    given = batch.observations.copy()
    given[0, 0] = 7.0
    assert batch.observations.ravel().tolist() == [5.0, 6.0]
    batch.observations = given
    assert system.residuals(batch).ravel() == pytest.approx([-2.0, np.sqrt(4 + 9 + 25) - 6.0])
    with pytest.raises(InputError, match="not finite"):
        batch.observations = [np.inf, 1.0]


def test_names_are_given_once(system):
    with pytest.raises(InputError, match="the Point3 'B' is there twice"):
        system.add_points(["D", "B"], np.zeros((2, 3)))
    with pytest.raises(InputError, match="the Point3 'E' is there twice"):
        system.add_points(["E", "E"], np.zeros((2, 3)))
    with pytest.raises(InputError, match="add_points: row 1 has an empty name"):
        system.add_points(["E", ""], np.zeros((2, 3)))
    assert system.add_scalars(["B"], [0.0]).tolist() == [4]


def test_blocks_are_found_by_name(system):
    assert system.ids(["C", "A"]).tolist() == [2, 0]
    assert system.ids(["A"], "Rotation").tolist() == [3]
    with pytest.raises(InputError, match="no Point3 is called 'Z'"):
        system.ids(["Z"])


def test_component_names(system):
    system.add_vectors(["camera"], [[1.0, 2.0]], ["focal", "ppx"])
    system.add_scalars(["scale"], [1.0])
    names = system.unknowns.component_names(np.arange(system.unknowns.n_scalars))
    assert names[:3] == ("A.x", "A.y", "A.z")
    assert names[9:] == (
        "A.rotation.x",
        "A.rotation.y",
        "A.rotation.z",
        "camera.focal",
        "camera.ppx",
        "scale",
    )


def test_components_to_freeze_by_name_or_number(system):
    system.freeze([0, 1], ("z", 0))
    assert system.unknowns.frozen[:6].tolist() == [True, False, True] * 2
    system.unfreeze([1], ("x",))
    assert system.unknowns.frozen[3:6].tolist() == [False, False, True]
    with pytest.raises(InputError, match="freeze: no component 'w'; there are x, y, z"):
        system.freeze([0], ("w",))
    with pytest.raises(InputError, match="freeze: no component 3; they go from 0 to 2"):
        system.freeze([0], (3,))
    with pytest.raises(InputError, match=r"'A' \(Point3, 3\) and 'A' \(Rotation, 3\) are not alike"):
        system.freeze([0, 3])


def test_values_that_are_not_what_they_must_be(system):
    with pytest.raises(InputError, match="add_points: row 1 is not finite"):
        system.add_points(["D", "E"], [[0.0, 0.0, 0.0], [0.0, np.nan, 0.0]])
    with pytest.raises(InputError, match="add_rotations: row 0 is not a rotation matrix"):
        system.add_rotations(["D"], [np.diag([1.0, 1.0, -1.0])])
    with pytest.raises(InputError, match="set_values: row 0 is not a rotation matrix"):
        system.set_values([3], [1.1 * np.eye(3)])
    with pytest.raises(InputError, match="the vector of 'D' is zero"):
        system.add_directions(["D"], [[0.0, 0.0, 0.0]])
    with pytest.raises(InputError, match=r"add_points: values have shape \(1, 3\); expected 2 rows"):
        system.add_points(["D", "E"], [[0.0, 0.0, 0.0]])


def test_priors_that_do_not_fit(system):
    with pytest.raises(InputError, match="prior of B: sigma must be positive"):
        system.add_prior([0, 1], np.zeros((2, 3)), [[1.0, 1.0, 1.0], [1.0, 0.0, 1.0]])
    with pytest.raises(InputError, match="prior: a Rotation takes no prior"):
        system.add_prior([3], np.zeros((1, 3)), 1.0)
    with pytest.raises(InputError, match=r"prior: sigmas have shape \(2,\); expected \(1, 3\)"):
        system.add_prior([0], np.zeros((1, 3)), [1.0, 1.0])


def test_priors_take_new_numbers_in_the_form_of_the_old_ones(system):
    prior = system.add_prior([0, 1], np.zeros((2, 3)), [[1.0, np.inf, 2.0], [1.0, 1.0, np.inf]])
    prior.values = np.arange(6.0).reshape(2, 3)
    assert prior.values.tolist() == [0.0, 2.0, 3.0, 4.0]
    prior.values = [5.0, 6.0, 7.0, 8.0]
    assert prior.values.tolist() == [5.0, 6.0, 7.0, 8.0]
    prior.sigmas = np.arange(1.0, 7.0).reshape(2, 3)
    assert prior.sigmas.ravel().tolist() == [1.0, 3.0, 4.0, 5.0]
    message = r"prior: values have shape \(3,\); expected \(2, 3\), a row for each block, or \(4,\), without"
    with pytest.raises(InputError, match=message):
        prior.values = [1.0, 2.0, 3.0]


def test_linear_rows_that_do_not_fit(system):
    with pytest.raises(InputError, match="linear rows: 'A' is a Rotation, not a linear unknown"):
        system.add_linear([[3]], [np.ones((1, 3))], [0.0], 1.0)
    with pytest.raises(InputError, match=r"linear rows, coefficients 0: values have shape \(1, 2\)"):
        system.add_linear([[0]], [np.ones((1, 2))], [0.0], 1.0)
    with pytest.raises(InputError, match="2 sets of coefficients for 1 blocks"):
        system.add_linear([[0]], [np.ones((1, 3)), np.ones((1, 3))], [0.0], 1.0)


def test_a_result_does_not_answer_for_what_was_added_later():
    system = LeastSquares()
    x = system.add_scalars(["x"], [0.0])
    system.add_linear([x], [[[1.0]]], [1.0], 1.0)
    result = system.solve(covariance="all")
    later = system.add_scalars(["y"], [0.0])
    for question in (result.values, result.precisions, lambda ids: result.covariance_between(x, ids)):
        with pytest.raises(InputError, match="'y' was added after this solution"):
            question(later)


def test_a_result_answers_for_its_own_batches_and_what_was_asked():
    system = LeastSquares()
    x = system.add_scalars(["x"], [0.0])
    system.add_linear([x], [[[1.0]]], [1.0], 1.0)
    result = system.solve()
    later = system.add_linear([x], [[[1.0]]], [2.0], 1.0)
    with pytest.raises(InputError, match="this linear batch was not part of the solved system"):
        result.residuals(later)
    with pytest.raises(InputError, match="covariances were not asked for"):
        result.covariance(x)


def test_labels_that_are_made_when_asked_are_not_made_before() -> None:
    class Lazy(Sequence):
        asked: ClassVar[list[int]] = []

        def __len__(self) -> int:
            return 2

        def __getitem__(self, row: int) -> str:
            self.asked.append(row)
            return ["line 0", "line 1"][row]

    system = LeastSquares()
    heights = system.add_scalars(["a", "b"], [0.0, 1.0])
    batch = system.add_linear([heights], [np.ones((2, 1))], [1.0, 2.0], 0.1, labels=Lazy())
    assert Lazy.asked == []
    assert batch.label(1).endswith("line 1") and Lazy.asked == [1]


def test_what_a_block_moves_adds_to_its_derivatives():
    """The centre moves what it sees by M d; derivatives by that are those by the target."""
    how, slope = np.array([[0.1, 0.2, 0.3], [-0.4, 0.5, 0.6], [0.7, -0.8, 0.9]]), np.array([1.0, -2.0, 4.0])
    axes, target = np.roll(np.eye(3), 1, axis=0), np.array([1.0, 2.0, 3.0])
    made = LeastSquares()
    ids = made.add_points(["C", "P"], [np.zeros(3), target])
    (station,) = made.add_rotations(["C"], [axes])
    blocks = {"station.centre": ids[:1], "station.rotation": [station], "target": ids[1:]}
    batch = made.add("TopoDX", blocks, [0.0], 0.001)
    places = {role.name: place for place, role in enumerate(batch.shape.roles)}
    centre, seen = places["station.centre"], places["target"]
    before = jacobian_rows(made.unknowns, batch)[1:, 0]
    moves = [Move(seen, None, slope[None]), Move(seen, seen, how[None]), Move(centre, seen, how[None])]
    batch.carry(moves)
    added = jacobian_rows(made.unknowns, batch)[1:, 0] - before
    rows = [batch.shape.roles[place].row + np.arange(3) for place in (centre, seen)]
    by_target = before[rows[1]]
    np.testing.assert_allclose(added[rows[0]], by_target @ how, atol=1e-15)
    np.testing.assert_allclose(added[rows[1]], by_target @ how + slope, atol=1e-15)
    assert np.count_nonzero(added) == 6


def test_plumb_rotations_keep_their_plumb_line_when_they_are_moved():
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    value = np.hstack([turned, np.arange(9.0).reshape(3, 3)])[None]
    moved = PLUMB.values(PLUMB.moved(PLUMB.context(value), np.array([[0.1, -0.2, 0.3]])))
    np.testing.assert_array_equal(moved[0, :, 3:], value[0, :, 3:])
    assert np.abs(moved - value).max() > 0.1


@pytest.mark.parametrize("strategy", ["gauss-newton", "qr"])
def test_a_batch_without_rows_changes_nothing(strategy):
    known = np.array([[0.0, 0.0, 0.0], [9.0, 1.0, 0.0], [1.0, 9.0, 1.0], [2.0, 3.0, 9.0]])
    wanted = np.array([4.0, 5.0, 3.0])
    system = LeastSquares()
    ends, point = system.add_points(list("ABCD"), known), system.add_points(["P"], [[3.0, 4.0, 2.0]])
    system.freeze(ends)
    empty = system.add("Dist3D", {"p1": ends[:0], "p2": point[:0]}, [], 0.1)
    system.add("Dist3D", {"p1": ends, "p2": point}, np.linalg.norm(known - wanted, axis=1), 0.1)
    result = system.solve(strategy=strategy)
    assert result.residuals(empty).shape == (0, 1)
    np.testing.assert_allclose(system.values(point), [wanted], atol=1e-6)
