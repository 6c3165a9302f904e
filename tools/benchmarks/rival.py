"""The rival of our kernels: C++ as MMVII's generator writes it, rebuilt from our formulas.

Nodes are shared by name at construction; derivatives are symbolic and forward, one unknown at a time; the
reductions are MMVII's, without the defect of its sum reduction; the text has one operation per line. The
structure is that of the formulas, because sympy keeps what it is given unevaluated: `a + (-1) b` is a
difference, `a b^-1` a quotient. Where our blocks or our operators say the same thing with fewer operations,
the original's way is restored.

Whether it is a fair rival, its operations show: 26 for Dist3D and 144 for TopoHz, as the original; 601 for
the colinearity (3, 1, 1) and 761 for BlocRigid, where the original has about 640 and 950, because our
formulas say it in fewer words. That favours the rival.
"""

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from unittest import mock

import sympy
from rival_inventory import Inventory

from obseq.formulas import blocks, functions
from obseq.formulas.base import Formula

FUNCTIONS = {
    sympy.exp: "exp",
    sympy.log: "log",
    sympy.sin: "sin",
    sympy.cos: "cos",
    sympy.tan: "tan",
    sympy.atan: "atan",
    sympy.acos: "acos",
    sympy.atan2: "ATan2",
    sympy.asin: "ASin",
    functions.Sqrt: "sqrt",
    functions.NormalisedRatio: "NormalisedRatioPos",
}
"""What a sympy function is called by the rival."""

REWRITTEN: dict[type[sympy.Basic], Callable[..., int]] = {
    functions.SincSqrt: lambda m, s: m.call("sinC", m.call("sqrt", s)),
    functions.CosSqrt: lambda m, s: m.call("cos", m.call("sqrt", s)),
    functions.AngleRatio: lambda m, s, z: m.call("AtanXsY_sX", m.call("sqrt", s), z),
    functions.AxialSum: lambda m, s, z: m.add(m.call("sqrt", m.add(s, m.power(z, 2))), z),
}
"""Operators of ours that the original writes with its own."""


@dataclass(frozen=True)
class Rival:
    """A formula in the rival's hands: its inventory, and its outputs, value then derivatives per residual."""

    name: str
    inventory: Inventory
    outputs: list[int]

    @property
    def operations(self) -> dict[str, int]:
        """Number of operations of each kind."""
        counts: dict[str, int] = {}
        for node in self.inventory.reached(self.outputs):
            operator = self.inventory.nodes[node].operator
            if operator not in ("atom", "constant"):
                counts[operator] = counts.get(operator, 0) + 1
        return counts


def build(formula: Formula) -> Rival:
    """The rival's graph of the values and derivatives of a formula."""
    inventory = Inventory(formula.unknowns, formula.observations)
    reader = _Reader(inventory)
    outputs = []
    is_survey = type(formula).__module__ == "obseq.formulas.topography"
    with original_stations() if is_survey else contextlib.nullcontext():
        expressions = formula.expressions()
    for expression in expressions:
        value = reader.read(expression)
        columns = [inventory.derivative(value, unknown) for unknown in formula.unknowns]
        outputs += [inventory.regrouped(f) for f in (value, *columns)]
    return Rival(formula.name, inventory, outputs)


@contextlib.contextmanager
def original_stations() -> Iterator[None]:
    """The original's survey stations: the inverse of the pose (C, R) is (-R^T C, R^T), by its matrix."""

    def moved_back(inverse: blocks.InversePose, point: blocks.Point3) -> blocks.Point3:
        matrix = inverse.pose.rotation.inverse().matrix()
        return matrix @ (-1 * inverse.pose.centre) + matrix @ point

    with mock.patch.object(blocks.InversePose, "__matmul__", moved_back):
        yield


class _Reader:
    """Reads unevaluated sympy expressions as the operators that their author wrote."""

    def __init__(self, inventory: Inventory) -> None:
        self.inventory = inventory
        self._read: dict[int, tuple[sympy.Basic, int]] = {}

    def read(self, expression: sympy.Basic) -> int:
        if id(expression) not in self._read:
            self._read[id(expression)] = (expression, self._translate(expression))
        return self._read[id(expression)][1]

    def _translate(self, expression: sympy.Basic) -> int:
        inventory = self.inventory
        if isinstance(expression, sympy.Symbol):
            return inventory.atom(expression.name)
        if isinstance(expression, sympy.Number | sympy.NumberSymbol):
            return inventory.constant(float(expression))
        if isinstance(expression, functions.Named):
            return self.read(expression.args[1])
        if isinstance(expression, sympy.Add):
            return self._sum(expression.args)
        if isinstance(expression, sympy.Mul):
            return self._product(expression.args)
        if isinstance(expression, sympy.Pow):
            return self._power(expression)
        if isinstance(expression, functions.WrapAngle):
            return inventory.call("DiffAngMod", *self._difference(expression.args[0]))
        operands = [self.read(argument) for argument in expression.args]
        if type(expression) in REWRITTEN:
            return REWRITTEN[type(expression)](inventory, *operands)
        if type(expression) in FUNCTIONS:
            return inventory.call(FUNCTIONS[type(expression)], *operands)
        raise ValueError(f"the rival has no operator for {type(expression).__name__}")

    def _sum(self, terms: tuple[sympy.Basic, ...]) -> int:
        result = self.read(terms[0])
        for term in terms[1:]:
            opposite = _opposite(term)
            if opposite is None:
                result = self.inventory.add(result, self.read(term))
            else:
                result = self.inventory.sub(result, self.read(opposite))
        return result

    def _product(self, factors: tuple[sympy.Basic, ...]) -> int:
        result = self.read(factors[0])
        for factor in factors[1:]:
            denominator = _denominator(factor)
            if denominator is None:
                result = self.inventory.mul(result, self.read(factor))
            else:
                result = self.inventory.div(
                    result, self.inventory.power(self.read(denominator[0]), denominator[1])
                )
        return result

    def _power(self, expression: sympy.Pow) -> int:
        base, exponent = expression.args
        if exponent == sympy.Rational(1, 2):
            return self.inventory.call("sqrt", self.read(base))
        if not isinstance(exponent, sympy.Integer):
            raise ValueError(f"the rival has no power for {expression}")
        return self.inventory.power(self.read(base), int(exponent))

    def _difference(self, angle: sympy.Basic) -> tuple[int, int]:
        """The two angles whose difference is wrapped."""
        if isinstance(angle, sympy.Add) and (opposite := _opposite(angle.args[-1])) is not None:
            return self._sum(angle.args[:-1]), self.read(opposite)
        return self.read(angle), self.inventory.constant(0.0)


def _opposite(term: sympy.Basic) -> sympy.Basic | None:
    """`b` of a term written `-b`."""
    if isinstance(term, sympy.Mul) and len(term.args) == 2 and term.args[0] == -1:
        return term.args[1]
    return None


def _denominator(factor: sympy.Basic) -> tuple[sympy.Basic, int] | None:
    """(base, exponent) of a factor written as a division."""
    if isinstance(factor, sympy.Pow) and isinstance(factor.args[1], sympy.Integer) and factor.args[1] < 0:
        return factor.args[0], -int(factor.args[1])
    return None
