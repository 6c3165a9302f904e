"""The rival of the kernel bench is a fair one: the original's operations, and the right derivatives."""

import importlib
import math
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from obseq.formulas import REGISTRY
from obseq.kernels import calculator, derivatives

TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"
FORMULAS = {formula.name: formula for formula in REGISTRY}

FUNCTIONS = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "neg": lambda a: -a,
    "square": lambda a: a**2,
    "cube": lambda a: a**3,
    "sqrt": math.sqrt,
    "ATan2": math.atan2,
    "DerX_ATan2": lambda x, y: y / (x * x + y * y),
    "DerY_ATan2": lambda x, y: -x / (x * x + y * y),
    "DiffAngMod": lambda a, b: math.remainder(a - b, 2 * math.pi),
    "DerA_DiffAngMod": lambda a, b: 1.0,
}


@pytest.fixture(scope="module")
def rival() -> Any:
    """The tool, imported from its folder as it imports its own parts."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(TOOLS))
        yield importlib.import_module("rival")


def _evaluate(built: Any, inputs: dict[str, float]) -> list[float]:
    values: dict[int, float] = {}
    for f in built.inventory.reached(built.outputs):
        operator, operands, name, value = built.inventory.nodes[f]
        if operator == "atom":
            values[f] = inputs[name]
        else:
            values[f] = FUNCTIONS[operator](*(values[k] for k in operands)) if value is None else value
    return [values[f] for f in built.outputs]


@pytest.mark.parametrize(("name", "operations"), [("Dist3D", 26), ("TopoHz", 144)])
def test_its_operations_are_those_of_the_original(rival: ModuleType, name: str, operations: int) -> None:
    assert sum(rival.build(FORMULAS[name]).operations.values()) == operations


def test_its_divisions_are_those_of_the_original(rival: ModuleType) -> None:
    assert rival.build(FORMULAS["Dist3D"]).operations["/"] == 6


@pytest.mark.parametrize(
    "name", ["Dist3D", "TopoHz", "TopoZen", "BlocRigid", "EqColinearityCamPPC_Stenope_Dist_Rad3_Dec1_XY1"]
)
def test_it_computes_the_same(rival: ModuleType, name: str) -> None:
    ours = calculator(name)
    u, o = derivatives.draw(ours.kernel, 5, np.random.default_rng(8))
    values, jacobian = ours.values_and_jacobian(u, o)
    built = rival.build(FORMULAS[name])
    names = (*ours.unknowns, *ours.observations)
    for k in range(len(u)):
        found = _evaluate(built, dict(zip(names, (*u[k], *o[k]), strict=True)))
        lines = np.array(found).reshape(len(ours.residuals), -1)
        np.testing.assert_allclose(lines[:, 0], values[k], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(
            lines[:, 1:], jacobian[k], rtol=1e-8, atol=1e-9 * np.abs(jacobian[k]).max()
        )


def test_its_sums_are_without_the_original_defect(rival: ModuleType) -> None:
    """A + A C, with A = a/b = 2/3 and C = 5: the original gives A (1 + 2 C) = 7.33 where it is 4."""
    inventory = rival.Inventory(("a", "b", "c"), ())
    quotient = inventory.div(inventory.atom("a"), inventory.atom("b"))
    total = inventory.add(quotient, inventory.mul(quotient, inventory.atom("c")))
    built = rival.Rival("Sum", inventory, [inventory.regrouped(total)])
    (found,) = _evaluate(built, {"a": 2.0, "b": 3.0, "c": 5.0})
    assert found == pytest.approx(4.0)
    assert sum(built.operations.values()) == 3
