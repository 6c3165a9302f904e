"""What a user may give: arrays are copied, masks refused, attributes act, wrong types get our errors."""

import pickle
import threading

import numpy as np
import pytest
from interruptions import bundle, found, free_network

import obseq
from obseq import InputError, ObseqError
from obseq.leastsquares import Huber, LeastSquares, Point, reliability

CENTRES = np.array([[0, 0, 0], [100, 0, 5], [0, 100, 0], [90, 90, 20], [50, 0, 40.0]])
TARGET = np.array([30.0, 52.0, 14.0])


def distances(blunder=0.0, sigmas=0.005, **more):
    """Five known points, and distances to a new one; the first may be wrong."""
    system = LeastSquares()
    known = system.add_points(list("ABCDE"), CENTRES)
    target = system.add_points(["P"], [[50.0, 50.0, 0.0]])
    system.freeze(known)
    lengths = np.linalg.norm(CENTRES - TARGET, axis=1)
    lengths[0] += blunder
    return system, system.add("Dist3D", {"p1": known, "p2": target}, lengths, sigmas, **more), target


def test_arrays_given_may_be_used_again():
    sigmas, active = np.full(5, 0.005), np.ones(5, dtype=bool)
    labels = list("abcde")
    system, batch, target = distances(0.03, sigmas, active=active, labels=labels)
    sigmas[:], active[:], labels[0] = [0.5, 0.001, 3.0, 0.1, 1.0], False, "other"
    result = system.solve(covariance=True)
    expected = distances(0.03)
    assert np.array_equal(result.values(target), expected[0].solve().values(expected[2]))
    assert (batch.sigmas == 0.005).all()
    assert batch.label(0) == "Dist3D a"
    assert np.abs(reliability(system, result).of(batch).w).max() > 3.0


@pytest.mark.parametrize("argument", ["observations", "sigmas", "ids", "prior"])
def test_masks_are_refused(argument):
    system, _, target = distances()
    mask = lambda values: np.ma.masked_array(values, mask=[True, *([False] * 4)])  # noqa: E731
    given = {"observations": np.ones(5), "sigmas": np.full(5, 0.01), "ids": np.arange(5)}
    given |= {argument: mask(given[argument])} if argument in given else {}
    with pytest.raises(InputError, match="row 0 is masked"):
        if argument == "prior":
            system.add_prior(np.arange(5), np.zeros((5, 3)), mask(np.ones(5)))
        system.add("Dist3D", {"p1": given["ids"], "p2": target}, given["observations"], given["sigmas"])


def test_a_mask_that_hides_nothing_is_no_mask():
    system, batch, target = distances()
    batch.observations = np.ma.masked_array(batch.observations, mask=False)
    assert system.solve().values(target)[0] == pytest.approx(TARGET)


def test_activity_may_be_changed_in_place():
    system, batch, target = distances(5.0)
    assert system.solve().values(target)[0] != pytest.approx(TARGET)
    batch.active[0] = False
    result = system.solve()
    assert result.values(target)[0] == pytest.approx(TARGET)
    assert result.n_observations == 4
    batch.active = [False, True, True, True, True]
    assert system.solve().redundancy == 1


def test_sigmas_may_be_changed():
    system, batch, target = distances(0.01)
    before = system.solve()
    batch.sigmas = 0.05
    result = system.solve()
    assert result.sigma0 == pytest.approx(before.sigma0 / 10.0)
    batch.sigmas[0] = 100.0
    assert system.solve().values(target)[0] == pytest.approx(TARGET, abs=1e-5)
    batch.sigmas[0] = -1.0
    with pytest.raises(InputError, match="sigma must be positive"):
        system.solve()


def test_a_loss_taken_away_leaves_least_squares():
    system, batch, target = distances(0.03)
    expected = system.solve().values(target)
    batch.loss = Huber()
    assert system.solve(max_iterations=50).values(target) != pytest.approx(expected, abs=1e-6)
    batch.loss = None
    np.testing.assert_allclose(system.solve().values(target), expected, atol=1e-9)


def test_what_a_batch_does_not_have_cannot_be_set():
    _, batch, _ = distances()
    with pytest.raises(AttributeError):
        batch.sigma = 1.0


def test_groups_of_sigma0_must_exist():
    system, _, _ = distances(0.01)
    assert system.solve(sigma0_groups="Dist3D").sigma0 > 0.1
    for wrong in (["typo"], "Dist3Dxyz", [3], 3):
        with pytest.raises(InputError, match="sigma0_groups"):
            system.solve(sigma0_groups=wrong)


@pytest.mark.parametrize("components", [[0.9], [True], [3], [-1], ["w"], [None], [[0]], 0.5])
def test_components_are_whole_numbers_or_names(components):
    system, _, target = distances()
    with pytest.raises(InputError):
        system.freeze(target, components)
    assert not system.unknowns.frozen[-3:].any()


def test_one_id_stands_for_all_rows():
    system = LeastSquares()
    a, b = system.add_points(["A", "B"], [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    system.freeze([a])
    batch = system.add("Dist3D", {"p1": a, "p2": b}, [10.01, 10.02, 9.99, 10.0], 0.01)
    assert len(batch) == 4
    system.freeze([b], ["y", "z"])
    assert system.solve().values([b])[0, 0] == pytest.approx(10.005)
    slope = system.add_vectors(["line"], [[0.0, 1.0]])
    x, y = np.arange(5.0), 3.0 + 2.0 * np.arange(5.0)
    rows = system.add_linear([slope], [np.column_stack([np.ones(5), x])], y, 0.1)
    assert len(rows) == 5
    assert system.solve().values(slope)[0] == pytest.approx([3.0, 2.0])


def test_observations_by_name_in_their_natural_shapes():
    results = []
    for by_name in (False, True):
        system = LeastSquares()
        poses = system.add_points(["A", "B"], [[1.0, 2.0, 3.0], [2.0, 0.0, 1.0]])
        turns = system.add_rotations(["A", "B"], np.array([np.eye(3)] * 2))
        blocks = {"pose.centre": poses, "pose.rotation": turns}
        centre, matrix = np.array([[1.1, 2.0, 3.0], [2.0, 0.1, 1.0]]), np.eye(3)
        if by_name:
            observations = {"centre": centre, "matrix": matrix}
        else:
            observations = np.hstack([centre, np.tile(matrix.ravel(), (2, 1))])
        batch = system.add("BlocRigid_RE", blocks, observations, 0.01)
        results.append((batch.observations, system.solve().values(poses)))
    np.testing.assert_array_equal(results[0][0], results[1][0])
    np.testing.assert_array_equal(results[0][1], results[1][1])
    assert results[0][1][0, 0] == pytest.approx(1.1)


def test_one_named_observation_for_all_rows():
    system, _, target = distances()
    batch = system.add("Dist3D", {"p1": np.arange(3), "p2": target}, {"distance": 60.0}, 0.1)
    assert batch.observations.tolist() == [[60.0]] * 3
    again = system.add("Dist3D", {"p1": 0, "p2": target}, {"distance": [60.0, 61.0]}, 0.1)
    assert len(again) == 2
    for wrong in (
        {},
        {"distance": 1.0, "other": 2.0},
        {"distance": np.ones((3, 2))},
        {"distance": [1.0, 2.0]},
    ):
        with pytest.raises(InputError, match=r"Dist3D"):
            batch.observations = wrong


def test_two_threads_on_one_system():
    system = bundle(n=150)
    start, expected = system.unknowns.state(), found(bundle(n=150))
    outcomes = []

    def solve():
        try:
            outcomes.append(found(system))
        except InputError as error:
            outcomes.append(str(error))

    def freeze(_):
        other = threading.Thread(target=change)
        other.start()
        other.join()

    def change():
        with pytest.raises(InputError, match="another thread"):
            system.freeze([0])

    for _ in range(10):
        system.unknowns.restore(start)
        pair = [threading.Thread(target=solve) for _ in range(2)]
        [thread.start() for thread in pair]
        [thread.join() for thread in pair]
    right = [outcome for outcome in outcomes if not isinstance(outcome, str)]
    assert len(right) >= 10
    assert all("another thread" in outcome for outcome in outcomes if isinstance(outcome, str))
    assert all(np.allclose(outcome[:-3], expected[:-3], atol=1e-6) for outcome in right)
    system.solve(progress=freeze)


@pytest.mark.parametrize("make", [bundle, free_network])
def test_systems_and_results_can_be_pickled(make):
    system, expected = make(), found(make())
    copy = pickle.loads(pickle.dumps(system))
    np.testing.assert_array_equal(found(copy), expected)
    result = system.solve(covariance=True)
    again = pickle.loads(pickle.dumps(result))
    assert again.to_dict() == result.to_dict()
    ids = system.ids(["p0", "p1"])
    np.testing.assert_array_equal(again.covariance_between(ids, ids), result.covariance_between(ids, ids))


def test_a_pickled_robust_system_with_objects_and_constraints():
    system, batch, _ = distances(0.03, loss=Huber())
    system.attach(Point("object", [1.0, 2.0, 3.0]))
    system.constrain_linear([system.ids(["object"])], [[[1.0, 0.0, 0.0]]], [5.0])
    system.add_prior(system.ids(["object"]), [[1.0, 2.0, 3.0]], 1.0)
    system, batch = pickle.loads(pickle.dumps((system, batch)))
    result = system.solve(max_iterations=50)
    assert result.values(system.ids(["object"]))[0] == pytest.approx([5.0, 2.0, 3.0])
    assert batch.robust_weights().min() < 0.5


def test_calculators_can_be_pickled():
    calculator = pickle.loads(pickle.dumps(obseq.calculator("Dist3D")))
    assert calculator.values(np.zeros((1, 6)), [[1.0]]).tolist() == [[-1.0]]


def test_a_formula_in_memory_can_be_pickled():
    compiler = pytest.importorskip("obseq.codegen")
    from obseq.formulas import REGISTRY

    formula = next(formula for formula in REGISTRY if formula.name == "Dist3D")
    kernel = pickle.loads(pickle.dumps(compiler.compile_formula(formula)))
    assert obseq.Calculator(kernel).values(np.zeros((1, 6)), [[1.0]]).tolist() == [[-1.0]]


def test_errors_can_be_pickled():
    for error in (
        obseq.SingularMatrixError(np.array([1]), np.array([0.0])),
        obseq.SolverUnavailableError("pardiso", "pypardiso"),
        obseq.SingularSystemError("free", ("A.x",)),
        obseq.DivergenceError("not finite"),
    ):
        again = pickle.loads(pickle.dumps(error))
        assert (type(again), str(again)) == (type(error), str(error))


WRONG = (
    None,
    3,
    -1,
    0.5,
    1e400,
    np.nan,
    "text",
    b"x",
    [],
    [1, "a"],
    [[1], [1, 2]],
    {},
    object(),
    1j,
    len,
    True,
)
"""Values that may or may not be what an argument wants: none of them may end in an error of Python's."""


def probes():
    """(name, call): each argument of each method, to be given whatever there is."""
    system, batch, p = distances()
    blocks = {"p1": np.arange(5), "p2": p}
    one = np.ones((1, 3))
    return {
        "solver": lambda x: LeastSquares(solver=x),
        "threads": lambda x: LeastSquares(threads=x),
        "add_points, names": lambda x: system.add_points(x, one),
        "add_points": lambda x: system.add_points(["Q"], x),
        "add_rotations, names": lambda x: system.add_rotations(x, np.eye(3)[None]),
        "add_rotations": lambda x: system.add_rotations(["Q"], x),
        "add_directions, names": lambda x: system.add_directions(x, one),
        "add_directions": lambda x: system.add_directions(["Q"], x),
        "add_vectors, names": lambda x: system.add_vectors(x, one),
        "add_vectors": lambda x: system.add_vectors(["Q"], x),
        "add_vectors, components": lambda x: system.add_vectors(["v"], one, x),
        "add_scalars, names": lambda x: system.add_scalars(x, [1.0]),
        "add_scalars": lambda x: system.add_scalars(["Q"], x),
        "ids": lambda x: system.ids(x),
        "ids, kind": lambda x: system.ids(["P"], x),
        "values": lambda x: system.values(x),
        "set_values, ids": lambda x: system.set_values(x, one),
        "set_values": lambda x: system.set_values(p, x),
        "freeze": lambda x: system.freeze(x),
        "freeze, components": lambda x: system.freeze(p, x),
        "freeze_matching": lambda x: system.freeze_matching(x),
        "unfreeze": lambda x: system.unfreeze(p, x),
        "eliminate": lambda x: system.eliminate(x),
        "add, formula": lambda x: system.add(x, blocks, np.ones(5), 1.0),
        "add, blocks": lambda x: system.add("Dist3D", x, np.ones(5), 1.0),
        "add, ids": lambda x: system.add("Dist3D", {**blocks, "p1": x}, np.ones(5), 1.0),
        "add, observations": lambda x: system.add("Dist3D", blocks, x, 1.0),
        "add, by name": lambda x: system.add("Dist3D", blocks, {"distance": x}, 1.0),
        "add, sigmas": lambda x: system.add("Dist3D", blocks, np.ones(5), x),
        "add, labels": lambda x: system.add("Dist3D", blocks, np.ones(5), 1.0, labels=x),
        "add, group": lambda x: system.add("Dist3D", blocks, np.ones(5), 1.0, group=x),
        "add, active": lambda x: system.add("Dist3D", blocks, np.ones(5), 1.0, active=x),
        "add, loss": lambda x: system.add("Dist3D", blocks, np.ones(5), 1.0, loss=x),
        "add, covariances": lambda x: system.add("Dist3D", blocks, np.ones(5), covariances=x),
        "add_linear, columns": lambda x: system.add_linear(x, [one], [1.0], 1.0),
        "add_linear, coefficients": lambda x: system.add_linear([p], x, [1.0], 1.0),
        "add_linear, values": lambda x: system.add_linear([p], [one], x, 1.0),
        "add_linear, sigmas": lambda x: system.add_linear([p], [one], [1.0], x),
        "add_normal_equations": lambda x: system.add_normal_equations(p, x, np.zeros(3)),
        "add_normal_equations, vector": lambda x: system.add_normal_equations(p, np.eye(3), x),
        "add_prior": lambda x: system.add_prior(p, x, 1.0),
        "add_prior, ids": lambda x: system.add_prior(x, one, 1.0),
        "add_prior, sigmas": lambda x: system.add_prior(p, one, x),
        "add_prior, group": lambda x: system.add_prior(p, one, 1.0, x),
        "add_viscosity": lambda x: system.add_viscosity(p, x),
        "constrain": lambda x: LeastSquares().constrain(x, blocks, None),
        "share": lambda x: system.share(x),
        "share_matching": lambda x: system.share_matching(x),
        "remove_constraint": lambda x: system.remove_constraint(x),
        "set_datum": lambda x: system.set_datum(x),
        "set_datum, components": lambda x: system.set_datum(p, x),
        "attach": lambda x: system.attach(x),
        "residuals": lambda x: system.residuals(x),
        "solve, max_iterations": lambda x: system.solve(max_iterations=x),
        "solve, tolerance": lambda x: system.solve(tolerance=x),
        "solve, covariance": lambda x: system.solve(covariance=x),
        "solve, before_iteration": lambda x: system.solve(before_iteration=x),
        "solve, progress": lambda x: system.solve(progress=x),
        "solve, sigma0_groups": lambda x: system.solve(sigma0_groups=x),
        "solve, strategy": lambda x: system.solve(strategy=x),
        "result, residuals": lambda x: system.solve().residuals(x),
        "result, normalised_residuals": lambda x: system.solve().normalised_residuals(x),
        "result, prior_residuals": lambda x: system.solve().prior_residuals(x),
        "batch.observations": lambda x: setattr(batch, "observations", x),
        "batch.sigmas": lambda x: setattr(batch, "sigmas", x),
        "batch.active": lambda x: setattr(batch, "active", x),
        "batch.loss": lambda x: setattr(batch, "loss", x),
        "batch.group": lambda x: setattr(batch, "group", x),
    }


@pytest.mark.parametrize("name", probes())
def test_wrong_types_get_our_errors(name):
    for value in WRONG:
        call = probes()[name]
        if value is len and name in ("solve, before_iteration", "solve, progress"):
            continue  # a function is what they want
        try:
            call(value)
        except ObseqError as error:
            assert len(str(error)) > 10
