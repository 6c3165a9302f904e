"""Sums and products as people see them: signed terms, factors above and below, parts that come again."""

from collections import Counter

import sympy

from obseq.codegen.equations.whole_blocks import Reading, Term
from obseq.formulas import functions

SHARED = 3
"""Operations from which a part that comes several times is worth a name."""
TERM_WEIGHTS = {"apply": 3, "product": 3, "cross": 2}


def signed_terms(
    value: sympy.Basic, sign: int, kept: frozenset[sympy.Basic]
) -> list[tuple[int, sympy.Basic]]:
    """The terms of a sum with their signs, zeros left out; what is kept is one term."""
    if value in kept:
        return [(sign, value)]
    if isinstance(value, Term):
        if value.kind not in ("add", "sub", "difference"):
            return [(sign, value)]
        a, b = value.parts
        return signed_terms(a, sign, kept) + signed_terms(b, sign if value.kind == "add" else -sign, kept)
    value = sympy.sympify(value)
    if isinstance(value, sympy.Add):
        return [signed for part in value.args for signed in signed_terms(part, sign, kept)]
    if isinstance(value, sympy.Mul):
        return _signed_product(value, sign, kept)
    if value.is_Number and value.is_negative:
        return [(-sign, abs(value))]
    return [] if value.is_zero else [(sign, value)]


def _signed_product(
    value: sympy.Mul, sign: int, kept: frozenset[sympy.Basic]
) -> list[tuple[int, sympy.Basic]]:
    """A product as one signed term, its numbers multiplied; a sum times a sign is a sum."""
    factors = _flat(value, kept - {value})
    number = sympy.prod([factor for factor in factors if factor.is_Number])
    if number == 0:
        return []
    rest = [factor for factor in factors if not factor.is_Number]
    sign = -sign if number < 0 else sign
    if abs(number) != 1:
        rest = [abs(number), *rest]
    if len(rest) == 1:
        return signed_terms(rest[0], sign, kept)
    return [(sign, value if rest == factors else sympy.Mul(*rest, evaluate=False))]


def _flat(value: sympy.Expr, kept: frozenset[sympy.Basic]) -> list[sympy.Expr]:
    """The factors of a product; what is kept is one factor."""
    if value in kept:
        return [value]
    if isinstance(value, sympy.Mul):
        return [factor for part in value.args for factor in _flat(part, kept)]
    return [value]


def factors_of(
    value: sympy.Basic, kept: frozenset[sympy.Basic]
) -> tuple[list[sympy.Basic], list[sympy.Basic]]:
    """The factors above and below the fraction bar, ones left out."""
    above, below = [], []
    for factor in _flat(value, kept - {value}):
        if isinstance(factor, sympy.Pow) and factor.args[1].is_number and factor.args[1].is_negative:
            base, exponent = factor.args
            below.append(base if exponent == -1 else sympy.Pow(base, -exponent, evaluate=False))
        elif factor != 1:
            above.append(factor)
    return above, below


def repeated(reading: Reading, values: list[sympy.Basic]) -> frozenset[sympy.Basic]:
    """The parts of some expressions, of three operations or more, that several others use."""
    order: dict[sympy.Basic, None] = {}
    uses: Counter[sympy.Basic] = Counter()

    def visit(value: sympy.Basic) -> None:
        if value not in order:
            parts = _parts_of(value, reading)
            uses.update(parts)
            for part in parts:
                visit(part)
            order[value] = None

    for value in values:
        visit(value)
    weights: dict[sympy.Basic, int] = {}
    shared = set()
    for value in order:
        weights[value] = _own_weight(value, reading) + sum(
            weights[part] for part in _parts_of(value, reading)
        )
        if _has_name(value):
            weights[value] = 0
        elif uses[value] > 1 and weights[value] >= SHARED and value not in reading.terms:
            shared.add(value)
            weights[value] = 0
    return frozenset(shared)


def _parts_of(value: sympy.Basic, reading: Reading) -> list[sympy.Basic]:
    if isinstance(value, Term):
        if value.kind == "name":
            return [reading.definitions[value.parts[0]]] if value.parts[0] in reading.definitions else []
        return [part for part in value.parts if isinstance(part, Term | sympy.Basic)]
    if isinstance(value, functions.Named):
        return [value.args[1]]
    return [reading.terms[value]] if value in reading.terms else list(value.args)


def _has_name(value: sympy.Basic) -> bool:
    return isinstance(value, functions.Named) or (isinstance(value, Term) and value.kind == "name")


def _own_weight(value: sympy.Basic, reading: Reading) -> int:
    """The operations of a part itself; a sign is none."""
    if isinstance(value, sympy.Symbol) or (isinstance(value, sympy.Mul) and value.args[0] == -1):
        return 0
    parts = _parts_of(value, reading)
    if isinstance(value, Term):
        return TERM_WEIGHTS.get(value.kind, int(bool(parts)))
    return max(len(parts) - 1, int(bool(parts)))
