"""The calculator: plain arrays in and out, and errors that name the argument and the formula."""

import pickle

import numpy as np
import pytest

import obseq
from obseq.errors import FormulaError, InputError
from obseq.kernels import derivatives
from obseq.kernels.layout import LANES

POINTS = [[0.0, 0.0, 0.0, 3.0, 4.0, 0.0], [1.0, 1.0, 1.0, 1.0, 1.0, 4.0]]


@pytest.fixture(scope="module")
def distance() -> obseq.Calculator:
    return obseq.calculator("Dist3D")


def test_values_and_derivatives(distance: obseq.Calculator) -> None:
    """A 3-4-5 triangle, and two points 3 m apart on a vertical."""
    values, jacobian = distance.values_and_jacobian(POINTS, [[4.0], [3.5]])
    np.testing.assert_allclose(values, [[1.0], [-0.5]], rtol=1e-15)
    np.testing.assert_allclose(jacobian[0, 0], [-0.6, -0.8, 0.0, 0.6, 0.8, 0.0], rtol=1e-15)
    np.testing.assert_allclose(jacobian[1, 0], [0.0, 0.0, -1.0, 0.0, 0.0, 1.0], rtol=1e-15)
    np.testing.assert_array_equal(distance.values(POINTS, [[4.0], [3.5]]), values)


def test_structural_zeros_and_constants_are_there() -> None:
    """Entries that kernels do not write, such as the derivative of each component by its own rotation."""
    formula = obseq.calculator("TopoSubFrame")
    constants = formula.kernel.constant_jacobian
    assert constants
    u = np.random.default_rng(1).normal(size=(40, 9))
    _, jacobian = formula.values_and_jacobian(u, np.random.default_rng(2).normal(size=(40, 12)))
    for residual, unknown, value in constants:
        assert (jacobian[:, residual, unknown] == value).all()


def test_along_a_direction(distance: obseq.Calculator) -> None:
    """Moving the second point along x by 1 and along y by 2: 0.6 + 2 0.8."""
    direction = [[0.0, 0.0, 0.0, 1.0, 2.0, 5.0], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]
    values, along = distance.directional_derivative(POINTS, [[4.0], [3.5]], direction)
    np.testing.assert_allclose(values, [[1.0], [-0.5]], rtol=1e-15)
    np.testing.assert_allclose(along, [[2.2], [-1.0]], rtol=1e-15)


@pytest.mark.parametrize("name", ["TopoHz", "TopoZen", "TopoSubFrame", "BlocRigid_RE", "Clino_0_3"])
def test_along_a_direction_is_the_jacobian_times_the_direction(name: str) -> None:
    formula = obseq.calculator(name)
    random = np.random.default_rng(5)
    u, d = random.uniform(0.1, 1.0, (2, 70, len(formula.unknowns)))
    o = random.uniform(0.1, 1.0, (70, len(formula.observations)))
    values, along = formula.directional_derivative(u, o, d)
    expected, jacobian = formula.values_and_jacobian(u, o)
    np.testing.assert_allclose(values, expected, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(along, np.einsum("nij,nj->ni", jacobian, d), rtol=1e-11, atol=1e-12)


def test_no_rows(distance: obseq.Calculator) -> None:
    values, jacobian = distance.values_and_jacobian(np.empty((0, 6)), np.empty((0, 1)))
    assert values.shape == (0, 1) and jacobian.shape == (0, 1, 6)


def test_other_types_and_layouts(distance: obseq.Calculator) -> None:
    expected = distance.values(POINTS, [[4.0], [3.5]])
    whole = np.array(POINTS, dtype=np.int32)
    np.testing.assert_array_equal(distance.values(whole, [[4.0], [3.5]]), expected)
    columns = np.asfortranarray(POINTS, dtype=np.float32)
    np.testing.assert_array_equal(distance.values(columns, [[4.0], [3.5]]), expected)


def test_arguments_are_left_alone(distance: obseq.Calculator) -> None:
    u, o = np.array(POINTS), np.array([[4.0], [3.5]])
    copies = u.copy(), o.copy()
    distance.values_and_jacobian(u, o)
    np.testing.assert_array_equal(u, copies[0])
    np.testing.assert_array_equal(o, copies[1])


def test_only_the_undefined_row_is_not_finite(distance: obseq.Calculator) -> None:
    rows = [POINTS[0], [1.0, 2.0, 3.0, 1.0, 2.0, 3.0], POINTS[1]]
    values, jacobian = distance.values_and_jacobian(rows, np.zeros((3, 1)))
    np.testing.assert_allclose(values[:, 0], [5.0, 0.0, 3.0])
    assert np.isfinite(jacobian[[0, 2]]).all() and not np.isfinite(jacobian[1]).any()
    with pytest.raises(InputError, match=r"Dist3D: not finite in 1 of 3 rows: 1$"):
        distance.check_finite(jacobian)
    distance.check_finite(values)


def test_long_lists_of_bad_rows_are_cut(distance: obseq.Calculator) -> None:
    with pytest.raises(InputError, match=r"in 9 of 9 rows: 0, 1, 2, 3, 4, \.\.\."):
        distance.check_finite(np.full((9, 1), np.nan))


@pytest.mark.parametrize(
    ("u", "o", "message"),
    [
        (np.zeros((2, 5)), np.zeros((2, 1)), r"Dist3D: unknowns .*\(n, 6\).*p1_x.*it has \(2, 5\)"),
        (np.zeros((2, 6)), np.zeros((2, 2)), r"Dist3D: observations must have the shape \(n, 1\).*of D;"),
        (np.zeros(6), np.zeros((1, 1)), r"Dist3D: unknowns must have the shape .* it has \(6,\)"),
        (np.zeros((2, 6)), np.zeros((3, 1)), r"Dist3D: 2 rows of unknowns but 3 rows of observations"),
        ([["a"] * 6], np.zeros((1, 1)), r"Dist3D: unknowns must be real numbers, not <U1"),
        (np.zeros((1, 6)), np.zeros((1, 1), complex), r"Dist3D: observations must be real numbers, not"),
    ],
)  # fmt: skip
def test_wrong_arguments(distance: obseq.Calculator, u, o, message: str) -> None:
    for function in (distance.values, distance.values_and_jacobian):
        with pytest.raises(FormulaError, match=message):
            function(u, o)


def test_wrong_directions(distance: obseq.Calculator) -> None:
    with pytest.raises(FormulaError, match=r"Dist3D: direction must have the shape \(n, 6\)"):
        distance.directional_derivative(POINTS, [[4.0], [3.5]], np.zeros((2, 1)))
    with pytest.raises(FormulaError, match="Dist3D: 2 rows of unknowns but 1 rows of direction"):
        distance.directional_derivative(POINTS, [[4.0], [3.5]], np.zeros((1, 6)))


def test_an_unknown_name_gets_the_nearest_ones() -> None:
    with pytest.raises(FormulaError, match=r"no formula is named 'Dist3d'; nearest names: Dist3D"):
        obseq.calculator("Dist3d")


def test_its_description(distance: obseq.Calculator) -> None:
    assert repr(distance) == "<Calculator Dist3D: 6 unknowns, 1 observations, 1 residuals>"
    assert distance.unknowns == ("p1_x", "p1_y", "p1_z", "p2_x", "p2_y", "p2_z")
    assert (distance.observations, distance.residuals) == (("D",), ("D",))


def test_results_are_written_where_wanted(distance: obseq.Calculator) -> None:
    expected = distance.values_and_jacobian(POINTS, [[4.0], [3.5]])
    out = np.full((2, 1), 7.0), np.full((2, 1, 6), 7.0)
    found = distance.values_and_jacobian(POINTS, [[4.0], [3.5]], out=out)
    assert found[0] is out[0] and found[1] is out[1]
    np.testing.assert_array_equal(out[0], expected[0])
    np.testing.assert_array_equal(out[1], expected[1])
    assert distance.values(POINTS, [[4.0], [3.5]], out=out[0]) is out[0]


def test_directional_derivatives_are_written_where_wanted(distance: obseq.Calculator) -> None:
    direction = np.arange(12.0).reshape(2, 6)
    expected = distance.directional_derivative(POINTS, [[4.0], [3.5]], direction)
    out = np.full((2, 1), 7.0), np.full((2, 1), 7.0)
    found = distance.directional_derivative(POINTS, [[4.0], [3.5]], direction, out=out)
    assert found[0] is out[0] and found[1] is out[1]
    np.testing.assert_array_equal(out, expected)


@pytest.mark.parametrize(
    "out", [np.zeros((2, 2)), np.zeros((2, 1), np.float32), np.zeros((2, 2))[:, :1], [[0.0], [0.0]]]
)
def test_places_that_cannot_take_the_results_are_refused(distance: obseq.Calculator, out) -> None:
    with pytest.raises(FormulaError, match=r"out must be a writeable C-contiguous .* of shape \(2, 1\)"):
        distance.values(POINTS, [[4.0], [3.5]], out=out)


@pytest.mark.parametrize("name", ["Dist2DCons", "TopoHz", "BlocRigid_RE"])
@pytest.mark.parametrize("n", [LANES - 1, 5 * LANES + 7, 1500])
def test_several_threads_give_what_one_gives(name: str, n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    formula = obseq.calculator(name)
    u, o = derivatives.draw(formula.kernel, n, np.random.default_rng(n))
    expected = formula.values_and_jacobian(u, o)
    several = obseq.calculator(name)
    limits = several.values.__func__.__globals__
    monkeypatch.setitem(limits, "QUICK_ROWS", 0)
    monkeypatch.setitem(limits, "SHARE", 10)
    monkeypatch.setitem(limits, "processors", lambda: 3)
    found = several.values_and_jacobian(u, o)
    np.testing.assert_array_equal(found[0], expected[0])
    np.testing.assert_array_equal(found[1], expected[1])


@pytest.mark.parametrize("name", ["Dist3D", "TopoSubFrame", "EqDist_Dist_Base_Rad3_Dec1_XY1", "BlocRigid"])
def test_few_rows_give_what_many_give(name: str) -> None:
    """Up to a thousand rows are evaluated in another way than more."""
    formula, random = obseq.calculator(name), np.random.default_rng(8)
    u = random.uniform(0.1, 1.0, (1100, len(formula.unknowns)))
    o = random.uniform(0.1, 1.0, (1100, len(formula.observations)))
    values, jacobian = formula.values_and_jacobian(u, o)
    only_values = formula.values(u, o)
    for n in (0, 1, 3, 4, 31, 33, 100, 1024):
        found = formula.values_and_jacobian(u[:n], o[:n])
        np.testing.assert_array_equal(found[0], values[:n])
        np.testing.assert_array_equal(found[1], jacobian[:n])
        np.testing.assert_array_equal(formula.values(u[:n], o[:n]), only_values[:n])


def test_arguments_may_be_read_only(distance: obseq.Calculator) -> None:
    u, o = np.array(POINTS), np.array([[4.0], [3.5]])
    u.flags.writeable = o.flags.writeable = False
    np.testing.assert_allclose(distance.values(u, o), [[1.0], [-0.5]], rtol=1e-15)


def test_places_that_cannot_take_few_results_are_refused(distance: obseq.Calculator) -> None:
    u, o = np.array(POINTS), np.array([[4.0], [3.5]])
    for jacobian in (
        np.zeros((2, 6)),
        np.zeros((2, 6, 1)),
        np.zeros((1, 1, 6)),
        np.zeros((2, 1, 6), np.float32),
    ):
        with pytest.raises(FormulaError, match=r"out must be .* of shape \(2, 1, 6\)"):
            distance.values_and_jacobian(u, o, out=(np.zeros((2, 1)), jacobian))


def test_a_copy_carries_no_addresses_of_this_process() -> None:
    one = obseq.calculator("Dist3D")
    rows = np.arange(12.0).reshape(2, 6), np.ones((2, 1))
    values, jacobian = one.values_and_jacobian(*rows)
    other = pickle.loads(pickle.dumps(one))
    assert set(vars(other)) == {"kernel", "name", "unknowns", "observations", "residuals"}
    again = other.values_and_jacobian(*rows)
    np.testing.assert_array_equal(again[0], values)
    np.testing.assert_array_equal(again[1], jacobian)
