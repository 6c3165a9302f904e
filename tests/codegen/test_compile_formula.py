"""A formula compiled in memory: the same object as a generated one, and no module on the disk."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest

import obseq
from obseq.codegen import compile_formula
from obseq.codegen.main import main
from obseq.formulas import Formula
from obseq.formulas.blocks import Length, Number, Point2, norm
from obseq.formulas.distortion import Degree, Distortion
from obseq.formulas.functions import Scalar, let
from obseq.formulas.topography import Dist3D
from obseq.kernels.loading import routine


class Dist2D(Formula):
    """Distance of two points of the plane."""

    def residual(self, p1: Point2, p2: Point2, *, distance: Annotated[Length, "D"]) -> Scalar:
        return norm(p2 - p1) - distance


def test_values_and_derivatives() -> None:
    calc = obseq.Calculator(compile_formula(Dist2D()))
    values, jacobian = calc.values_and_jacobian([[1.0, 2.0, 4.0, 6.0]], [[4.5]])
    np.testing.assert_allclose(values, [[0.5]], rtol=1e-15)
    np.testing.assert_allclose(jacobian, [[[-0.6, -0.8, 0.6, 0.8]]], rtol=1e-15)


def test_machine_code_is_kept_for_other_processes_and_no_module_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OBSEQ_CACHE", str(tmp_path / "cache"))

    class Halved(Dist2D):
        def residual(self, p1: Point2, p2: Point2, *, distance: Annotated[Length, "D"]) -> Scalar:
            return norm(p2 - p1) - distance / 2

    symbols = []
    for formula in (Dist2D(), Halved()):
        symbols.append(routine(compile_formula(formula).module, "value").symbol)
        assert compile_formula(formula).value_address
    assert len(set(symbols)) == 2
    files = [path.name for path in tmp_path.rglob("*") if path.is_file()]
    assert sorted(files) == sorted(f"{symbol}.nbc" for symbol in symbols)


def test_formulas_of_one_name_have_nothing_of_each_other() -> None:
    """Made one after the other, and first used then: each keeps its own text, by which code is filed."""
    kernels = [compile_formula(multiple(factor)) for factor in (2.0, 3.0, 2.0)]
    found = [obseq.Calculator(kernel).values_and_jacobian([[1.0]], [[0.5]]) for kernel in kernels]
    assert [(float(values[0, 0]), float(jacobian[0, 0, 0])) for values, jacobian in found] == [
        (1.5, 2.0),
        (2.5, 3.0),
        (1.5, 2.0),
    ]


def multiple(factor: float) -> Formula:
    class Times(Formula):
        """Some multiple of x."""

        def residual(self, x: Number, *, a: Number) -> Scalar:
            return factor * x - a

    return Times()


def failing(how: Callable[[Scalar], object]) -> Formula:
    class Failing(Formula):
        """A residual that is written wrongly."""

        def residual(self, x: Number, *, a: Number) -> object:
            return how(x - a)

    return Failing()


@pytest.mark.parametrize(
    ("how", "message"),
    [
        (
            lambda x: x.yy,
            r"Failing: its residual fails: .*no attribute 'yy' \(.*test_compile_formula.py, line",
        ),
        (lambda x: (x,)[1], r"Failing: its residual fails: tuple index out of range"),
        (lambda x: None, "Failing: its `residual` gives nothing: does it end without `return`"),
        (lambda x: let("my name", x), "the name is not an identifier"),
        (lambda x: let("lambda", x), "the name is not an identifier"),
        (lambda x: x * 10**400, r"Failing: a number is too large for double precision: 1000"),
    ],
)
def test_a_residual_that_is_written_wrongly_is_told_with_its_place(how, message: str) -> None:
    with pytest.raises(obseq.FormulaError, match=message):
        compile_formula(failing(how))


def test_what_is_no_formula_is_refused() -> None:
    with pytest.raises(obseq.InputError, match="an object of a class derived from Formula, not"):
        compile_formula(Dist2D)  # type: ignore[arg-type]
    with pytest.raises(obseq.FormulaError, match="Formula: the class has no method `residual`"):
        compile_formula(Formula())


def test_it_is_the_kernel_of_the_generated_module() -> None:
    made, generated = compile_formula(Dist3D()), obseq.calculator("Dist3D").kernel
    for field in ("unknowns", "observations", "residuals", "blocks", "measured", "rows", "constant_jacobian"):
        assert getattr(made, field) == getattr(generated, field)


def test_it_serves_in_an_adjustment() -> None:
    """A at the origin, B at (x, 1, 0) and 3 m away: x is the square root of 8."""
    system = obseq.LeastSquares()
    points = system.add_points(["A", "B"], np.array([[0.0, 0.0, 0.0], [2.0, 1.0, 0.0]]))
    system.freeze(points[0])
    system.freeze(points[1], components=(1, 2))
    system.add(compile_formula(Dist3D()), {"p1": points[0], "p2": points[1]}, np.array([[3.0]]), 0.01)
    result = system.solve()
    assert result.values(points)[1, 0] == pytest.approx(np.sqrt(8.0), abs=1e-9)


def test_gencode_of_a_member_that_is_not_registered_keeps_it_for_the_user(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("OBSEQ_CACHE", str(tmp_path))
    assert main(["RadiomVignetLin_1"]) == 0
    (path,) = tmp_path.glob("*/RadiomVignetLin_1.py")
    assert f"wrote {path}" in capsys.readouterr().out
    assert 'NAME = "RadiomVignetLin_1"' in path.read_text("utf-8")


def test_expressions_nested_too_deeply_are_refused() -> None:
    with pytest.raises(obseq.FormulaError, match=r"EqDist_Dist_Rad200_Dec0_XY0: .*nested too deeply"):
        compile_formula(Distortion(Degree(200, 0, 0)))
