"""How much arithmetic kernels do: never more than recorded, never more than sympy's own sharing."""

from pathlib import Path

import pytest
import sympy
from unchanged import Seen

from obseq import generated
from obseq.codegen.compiler import derive
from obseq.codegen.modules import REPORT, recorded_operations
from obseq.formulas import REGISTRY, functions
from obseq.formulas.base import Formula
from obseq.kernels import formula_names, load

FOLDER = Path(generated.__file__).parent
FORMULAS = {formula.name: formula for formula in REGISTRY}

SHARED = ["Dist3D", "TopoHz", "TopoZen", "TopoSubFrame", "SumSquare_8", "EqDist_Dist_Base_Rad3_Dec1_XY5"]
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


def test_the_report_records_the_operations_of_every_kernel() -> None:
    """The bound that gencode holds the next ones to (see `test_command`)."""
    recorded = recorded_operations((FOLDER / REPORT).read_text("utf-8"))
    assert recorded == {name: load(name).module.OPERATIONS for name in formula_names()}


def test_a_module_tells_its_operations() -> None:
    for name in SHARED:
        counts = derive(FORMULAS[name]).counts
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
def test_no_more_operations_than_sympy(name: str, seen: Seen) -> None:
    place = f"operations/{name}"
    assert place in seen or derive(FORMULAS[name]).counts[1] <= _with_sympy(FORMULAS[name])
    seen.add(place)
