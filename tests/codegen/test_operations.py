"""How much arithmetic kernels do: never more than recorded, never more than sympy's own sharing."""

import json
from pathlib import Path

import pytest
import sympy

from obseq.codegen.compiler import derive, operation_counts
from obseq.formulas import REGISTRY, functions
from obseq.formulas.base import Formula
from obseq.kernels import formula_names, load

BOUNDS = Path(__file__).with_name("operation_bounds.json")
FORMULAS = {formula.name: formula for formula in REGISTRY}

SHARED = ["Dist3D", "TopoHz", "TopoZen", "TopoSubFrame", "SumSquare_8", "RadiomStabilized_DRad5_WCste_DegIm2"]
SLOW = ["RatioDist2DCons", "Clino_0_3", "EqLidarImPonct", "VNormOrthog", "RadiomEqualisation_DRad5_DegIm3"]


class _Wrap(sympy.Function):
    """An angle brought back by whole turns; its derivative is 1."""

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        return sympy.S.One


STANDARD = {
    functions.Named: lambda _, value: value,
    functions.Sqrt: lambda x: sympy.sqrt(x),
    functions.WrapAngle: lambda angle: _Wrap(angle),
}


def test_no_kernel_does_more_than_recorded() -> None:
    """After a new formula, or a change that costs operations on purpose: tools/record_operations.py."""
    bounds = json.loads(BOUNDS.read_text("utf-8"))["operations"]
    assert sorted(bounds) == sorted(formula_names())
    over = {
        name: (load(name).module.OPERATIONS, tuple(bound))
        for name, bound in bounds.items()
        if any(count > most for count, most in zip(load(name).module.OPERATIONS, bound, strict=True))
    }
    assert not over, f"(value, value and Jacobian) above the bound: {over}"


def test_a_module_tells_its_operations() -> None:
    for name in SHARED:
        counts = operation_counts(derive(FORMULAS[name]))
        assert counts == load(name).module.OPERATIONS


def test_colinearity() -> None:
    """The bound set for a camera with distortion (3, 1, 1)."""
    assert load("EqColinearityCamPPC_Stenope_Dist_Rad3_Dec1_XY1").module.OPERATIONS[1] <= 246


def _with_sympy(formula: Formula) -> int:
    """Operations of value and Jacobian by sympy.diff and one joint sympy.cse."""
    memory: dict[int, sympy.Basic] = {}

    def visit(expression: sympy.Basic) -> sympy.Basic:
        if id(expression) not in memory:
            rebuild = STANDARD.get(type(expression), expression.func)
            arguments = [visit(argument) for argument in expression.args]
            memory[id(expression)] = rebuild(*arguments) if arguments else expression
        return memory[id(expression)]

    residuals = [visit(expression) for expression in formula.expressions()]
    unknowns = [sympy.Symbol(name, real=True) for name in formula.unknowns]
    outputs = [entry for r in residuals for entry in (r, *(r.diff(unknown) for unknown in unknowns))]
    shared, reduced = sympy.cse(outputs)
    return int(sum(sympy.count_ops(e) for e in (*(value for _, value in shared), *reduced)))


@pytest.mark.parametrize("name", [*SHARED, *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)])
def test_no_more_operations_than_sympy(name: str) -> None:
    assert operation_counts(derive(FORMULAS[name]))[1] <= _with_sympy(FORMULAS[name])
