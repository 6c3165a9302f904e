"""The rival's formulas: shared by name, reduced as they are built, differentiated one unknown at a time.

The original: `include/SymbDer` of micmacIGN/micmac, without the defect of its sum reduction.
"""

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

POWERS = {2: "square", 3: "cube", 4: "pow4", 5: "pow5", 6: "pow6", 7: "pow7"}


class Node(NamedTuple):
    """One formula of the rival: its operator, its operands (numbers), its name, its value if constant."""

    operator: str
    operands: tuple[int, ...]
    name: str
    value: float | None = None


@dataclass
class Inventory:
    """The rival's coordinator: formulas by name, each built once, reduced as it is built."""

    unknowns: tuple[str, ...]
    observations: tuple[str, ...]
    nodes: list[Node] = field(default_factory=list)
    _by_name: dict[str, int] = field(default_factory=dict)
    _constants: dict[float, int] = field(default_factory=dict)
    _derivatives: dict[tuple[int, str], int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for value in (0.0, 1.0, 2.0):
            self.constant(value)
        for name in (*self.unknowns, *self.observations):
            self._register("atom", (), name)

    def _register(self, operator: str, operands: tuple[int, ...], name: str) -> int:
        self._by_name[name] = len(self.nodes)
        self.nodes.append(Node(operator, operands, name))
        return len(self.nodes) - 1

    def constant(self, value: float) -> int:
        """The constant of that value."""
        if value not in self._constants:
            self._constants[value] = len(self.nodes)
            self.nodes.append(Node("constant", (), f"_C{len(self._constants)}", value))
        return self._constants[value]

    def atom(self, name: str) -> int:
        """An unknown or an observation."""
        return self._by_name[name]

    def value(self, f: int) -> float | None:
        """The value of a constant, None for any other formula."""
        return self.nodes[f].value

    def _node(self, operator: str, *operands: int) -> int:
        first, *rest = operands
        name = f"F{first}_{operator}F{rest[0]}_" if rest else f"{operator} F{first}_"
        if name in self._by_name:
            return self._by_name[name]
        reduced = self._factorised(operator, first, rest[0]) if operator in ("+", "-") and rest else None
        return self._register(operator, operands, name) if reduced is None else reduced

    def _factorised(self, operator: str, a: int, b: int) -> int | None:
        """A sum or difference of two products, or two quotients, with a factor at the same position."""
        first, second = self.nodes[a], self.nodes[b]
        join = self.add if operator == "+" else self.sub
        if first.operator == second.operator == "*":
            (p, q), (r, s) = first.operands, second.operands
            if p == r:
                return self.mul(p, join(q, s))
            if q == s:
                return self.mul(join(p, r), q)
        if first.operator == second.operator == "/" and first.operands[1] == second.operands[1]:
            return self.div(join(first.operands[0], second.operands[0]), first.operands[1])
        return None

    def _ordered(self, a: int, b: int) -> tuple[int, int]:
        return (b, a) if self.nodes[a].name > self.nodes[b].name else (a, b)

    def _folded(self, operation: Callable[[float, float], float], a: int, b: int) -> int | None:
        u, v = self.value(a), self.value(b)
        return None if u is None or v is None else self.constant(operation(u, v))

    def add(self, a: int, b: int) -> int:
        """The sum a + b."""
        if self.value(a) == 0.0:
            return b
        if self.value(b) == 0.0:
            return a
        a, b = self._ordered(a, b)
        folded = self._folded(lambda u, v: u + v, a, b)
        return self._node("+", a, b) if folded is None else folded

    def sub(self, a: int, b: int) -> int:
        """The difference a - b."""
        if self.value(a) == 0.0:
            return self.neg(b)
        if self.value(b) == 0.0:
            return a
        if self.nodes[b].operator == "neg":
            return self.add(a, self.nodes[b].operands[0])
        folded = self._folded(lambda u, v: u - v, a, b)
        return self._node("-", a, b) if folded is None else folded

    def neg(self, a: int) -> int:
        """The opposite of a."""
        operator, operands, _, value = self.nodes[a]
        if value is not None:
            return self.constant(-value)
        if operator == "neg":
            return operands[0]
        if operator == "-":
            return self.sub(operands[1], operands[0])
        return self._node("neg", a)

    def mul(self, a: int, b: int) -> int:
        """The product a b."""
        for factor, other in ((a, b), (b, a)):
            if self.value(factor) == 0.0:
                return factor
            if self.value(factor) == 1.0:
                return other
            if self.value(factor) == -1.0:
                return self.neg(other)
        a, b = self._ordered(a, b)
        folded = self._folded(lambda u, v: u * v, a, b)
        return self._node("*", a, b) if folded is None else folded

    def div(self, a: int, b: int) -> int:
        """The quotient a / b."""
        if self.value(a) == 0.0 or self.value(b) == 1.0:
            return a
        if self.value(b) == -1.0:
            return self.neg(a)
        folded = self._folded(lambda u, v: u / v, a, b)
        return self._node("/", a, b) if folded is None else folded

    def power(self, a: int, exponent: int) -> int:
        """A whole power: an operator of its own up to the seventh."""
        if exponent < 0:
            return self.div(self.constant(1.0), self.power(a, -exponent))
        if exponent == 0:
            return self.constant(1.0)
        if exponent == 1:
            return a
        if (value := self.value(a)) is not None:
            return self.constant(value**exponent)
        return (
            self._node(POWERS[exponent], a)
            if exponent in POWERS
            else self._node("pow", a, self.constant(exponent))
        )

    def call(self, function: str, *operands: int) -> int:
        """A function of other formulas."""
        return self._node(function, *operands)

    def regrouped(self, f: int) -> int:
        """An output with its chain of sums regrouped: terms sorted by name, neighbours merged."""
        if self.nodes[f].operator != "+":
            return f
        terms = sorted(self._terms(f), key=lambda term: self.nodes[term].name)
        merged = True
        while merged:
            merged = False
            for k in range(len(terms) - 1):
                if (joined := self._merged(terms[k], terms[k + 1])) is not None:
                    terms = sorted([*terms[:k], joined, *terms[k + 2 :]], key=lambda t: self.nodes[t].name)
                    merged = True
                    break
        return functools.reduce(self.add, terms)

    def _terms(self, f: int) -> Iterator[int]:
        if self.nodes[f].operator != "+":
            yield f
            return
        for operand in self.nodes[f].operands:
            yield from self._terms(operand)

    def _merged(self, a: int, b: int) -> int | None:
        """A + A, A B + A C and A B + A as one product."""
        if a == b:
            return self.mul(self.constant(2.0), a)
        factors = [self.nodes[t].operands if self.nodes[t].operator == "*" else (t,) for t in (a, b)]
        for factor in factors[0]:
            if factor in factors[1]:
                rest = [self._without(operands, factor) for operands in factors]
                return self.mul(factor, self.add(rest[0], rest[1]))
        return None

    def _without(self, operands: tuple[int, ...], factor: int) -> int:
        if len(operands) == 1:
            return self.constant(1.0)
        return operands[1] if operands[0] == factor else operands[0]

    def derivative(self, f: int, unknown: str) -> int:
        """The symbolic derivative of a formula by one unknown."""
        if (f, unknown) not in self._derivatives:
            self._derivatives[f, unknown] = self._derived(f, unknown)
        return self._derivatives[f, unknown]

    def _derived(self, f: int, unknown: str) -> int:
        operator, operands, name, _ = self.nodes[f]
        if operator in ("atom", "constant"):
            return self.constant(1.0 if name == unknown else 0.0)
        slopes = [self.derivative(operand, unknown) for operand in operands]
        if operator in BINARY:
            return BINARY[operator](self, operands[0], operands[1], slopes[0], slopes[1])
        if operator in UNARY:
            return UNARY[operator](self, f, operands[0], slopes[0])
        if operator not in PARTIALS:
            raise ValueError(f"the rival cannot differentiate {operator}")
        parts = [
            self.mul(slope, self.call(partial, *operands))
            for slope, partial in zip(slopes, PARTIALS[operator], strict=True)
        ]
        return functools.reduce(self.add, parts)

    def reached(self, outputs: list[int]) -> list[int]:
        """The formulas that the outputs need, by depth."""
        depth: dict[int, int] = {}
        for node in sorted(self._ancestors(outputs)):
            depth[node] = 1 + max((depth[operand] for operand in self.nodes[node].operands), default=-1)
        return sorted(depth, key=lambda node: (depth[node], node))

    def _ancestors(self, outputs: list[int]) -> set[int]:
        seen: set[int] = set()
        pending = list(outputs)
        while pending:
            node = pending.pop()
            if node not in seen:
                seen.add(node)
                pending.extend(self.nodes[node].operands)
        return seen


Inv = Inventory
BINARY: dict[str, Callable[[Inv, int, int, int, int], int]] = {
    "+": lambda m, f, g, df, dg: m.add(df, dg),
    "-": lambda m, f, g, df, dg: m.sub(df, dg),
    "*": lambda m, f, g, df, dg: m.add(m.mul(g, df), m.mul(f, dg)),
    "/": lambda m, f, g, df, dg: m.div(m.sub(m.mul(df, g), m.mul(dg, f)), m.power(g, 2)),
    "pow": lambda m, f, g, df, dg: m.mul(m.mul(g, df), m.power(f, round(m.value(g) or 0.0) - 1)),
}
UNARY: dict[str, Callable[[Inv, int, int, int], int]] = {
    "neg": lambda m, n, f, df: m.neg(df),
    "sqrt": lambda m, n, f, df: m.div(df, m.mul(m.constant(2.0), n)),
    "exp": lambda m, n, f, df: m.mul(df, n),
    "log": lambda m, n, f, df: m.div(df, f),
    "sin": lambda m, n, f, df: m.mul(df, m.call("cos", f)),
    "cos": lambda m, n, f, df: m.neg(m.mul(df, m.call("sin", f))),
}


def _power_slope(exponent: int) -> Callable[[Inv, int, int, int], int]:
    return lambda m, n, f, df: m.mul(m.mul(m.constant(exponent), df), m.power(f, exponent - 1))


UNARY |= {name: _power_slope(exponent) for exponent, name in POWERS.items()}

PARTIALS = {
    "ATan2": ("DerX_ATan2", "DerY_ATan2"),
    "DiffAngMod": ("DerA_DiffAngMod", "DerB_DiffAngMod"),
    "ASin": ("DerASin",),
    "tan": ("DerTan",),
    "atan": ("DerATan",),
    "acos": ("DerACos",),
    "sinC": ("DerSinC",),
    "AtanXsY_sX": ("DerXAtanXsY_sX", "DerYAtanXsY_sX"),
    "NormalisedRatioPos": ("DerA_NormalisedRatioPos", "DerB_NormalisedRatioPos"),
}
"""The rival's own operators and the functions that give their derivatives."""
