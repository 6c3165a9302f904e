"""A formula read with its blocks kept whole: points, rotations and poses stay symbols, as on paper.

The third reading of `residual`, after symbols and floats: vectors and matrices are trees of terms, scalars
are sympy expressions in which a symbol may stand for a component or a product of vectors. What `let` names
becomes a definition. It is what the documentation prints: an equation that cannot differ from the code.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import NamedTuple

import sympy

from obseq.formulas.base import Argument, Formula
from obseq.formulas.blocks import Atom, Direction, InverseRotation, Matrix3, Point2, Point3, Rotation


class Term(NamedTuple):
    """A vector or a matrix: what it is made by, and from what.

    Kinds of vectors: `name`, `add`, `sub`, `scale`, `cross`, `apply` (matrix, vector), `row` (matrix, k).
    Kinds of matrices: `name`, `transpose`, `product`, `difference`, `turn` (I minus the cross product of a
    vector). Kinds of scalars: `component` (vector, axis), `dot`.
    """

    kind: str
    parts: tuple[sympy.Basic, ...]


def named(name: str) -> Term:
    """A vector or a matrix with a name."""
    return Term("name", (name,))


@dataclass
class Reading:
    """The terms that the symbols of a reading stand for, and the definitions met on the way.

    Attributes:
        terms: What a scalar symbol stands for.
        definitions: What a name stands for: a term of vectors or matrices.
        made_of: Names of the scalars of each vector or matrix that is given, and of each scalar.
    """

    terms: dict[sympy.Symbol, Term] = field(default_factory=dict)
    definitions: dict[str, Term] = field(default_factory=dict)
    made_of: dict[str, tuple[str, ...]] = field(default_factory=dict)
    scalars: dict[Term, sympy.Basic] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._cleaned: dict[sympy.Basic, sympy.Basic] = {}

    def cleaned(self, value: sympy.Basic) -> sympy.Basic:
        """An expression without powers 0 and 1, factors 1 and terms 0, otherwise as it was written."""
        value = sympy.sympify(value)
        if not value.args:
            return value
        if value not in self._cleaned:
            self._cleaned[value] = _without_neutral(value, [self.cleaned(part) for part in value.args])
        return self._cleaned[value]

    def scalar(self, term: Term) -> sympy.Symbol:
        """The symbol of a scalar made of vectors; for a component of an argument, its own name."""
        if term not in self.scalars:
            symbol = sympy.Symbol(f"<{len(self.terms)}>", real=True)
            self.terms[symbol] = term
            self.scalars[term] = symbol
        return self.scalars[term]

    def component(self, term: Term, axis: str) -> sympy.Basic:
        """A component of a vector; of a multiple, the multiple of the component."""
        if term.kind == "scale":
            factor, vector = term.parts
            return sympy.Mul(factor, self.component(vector, axis), evaluate=False)
        return self.scalar(Term("component", (term, axis)))

    def point3(self, term: Term) -> "WholePoint3":
        """The vector of space of a term."""
        x, y, z = (self.component(term, axis) for axis in "xyz")
        return WholePoint3(x, y, z, term, self)

    def point2(self, term: Term) -> "WholePoint2":
        """The vector of the plane of a term."""
        x, y = (self.component(term, axis) for axis in "xy")
        return WholePoint2(x, y, term, self)

    def matrix(self, term: Term) -> "WholeMatrix":
        """The matrix of a term."""
        a, b, c = (self.point3(Term("row", (term, k))) for k in range(3))
        return WholeMatrix((a, b, c), term, self)

    def given(self, scalars: Sequence[str], argument: str) -> Term:
        """The vector or matrix of some scalars, named after what they share, else after their argument."""
        others = (argument + "'" * k for k in itertools.count())
        names = itertools.chain([common_name(scalars, argument)], others)
        name = next(name for name in names if self.made_of.setdefault(name, tuple(scalars)) == tuple(scalars))
        return named(name)

    def define(self, name: str, term: Term) -> Term:
        """The name of a term, made distinct from that of any other term."""
        while self.definitions.setdefault(name, term) != term:
            name += "'"
        return named(name)


@dataclass(frozen=True)
class WholePoint2(Point2):
    """A vector of the plane that is a term."""

    term: Term
    reading: Reading

    def __add__(self, other: Point2) -> Point2:
        return self._with("add", other) or super().__add__(other)

    def __sub__(self, other: Point2) -> Point2:
        return self._with("sub", other) or super().__sub__(other)

    def __rmul__(self, factor: sympy.Basic) -> Point2:
        return self.reading.point2(Term("scale", (self.reading.cleaned(factor), self.term)))

    def dot(self, other: Point2) -> sympy.Basic:
        """Scalar product."""
        if isinstance(other, WholePoint2):
            return self.reading.scalar(Term("dot", (self.term, other.term)))
        return super().dot(other)

    def with_names(self, name: str) -> Point2:
        """The same vector, defined under that name."""
        return self.reading.point2(self.reading.define(name, self.term))

    def _with(self, kind: str, other: Point2) -> Point2 | None:
        if isinstance(other, WholePoint2):
            return self.reading.point2(Term(kind, (self.term, other.term)))
        return None


@dataclass(frozen=True)
class WholePoint3(Point3):
    """A vector of space that is a term."""

    term: Term
    reading: Reading

    def __add__(self, other: Point3) -> Point3:
        return self._with("add", other) or super().__add__(other)

    def __sub__(self, other: Point3) -> Point3:
        return self._with("sub", other) or super().__sub__(other)

    def __rmul__(self, factor: sympy.Basic) -> Point3:
        return self.reading.point3(Term("scale", (self.reading.cleaned(factor), self.term)))

    def cross(self, other: Point3) -> Point3:
        """Vector product."""
        return self._with("cross", other) or super().cross(other)

    def dot(self, other: Point3) -> sympy.Basic:
        """Scalar product."""
        if isinstance(other, WholePoint3):
            return self.reading.scalar(Term("dot", (self.term, other.term)))
        return super().dot(other)

    def with_names(self, name: str) -> Point3:
        """The same vector, defined under that name."""
        return self.reading.point3(self.reading.define(name, self.term))

    def _with(self, kind: str, other: Point3) -> Point3 | None:
        if isinstance(other, WholePoint3):
            return self.reading.point3(Term(kind, (self.term, other.term)))
        return None


@dataclass(frozen=True)
class WholeMatrix(Matrix3):
    """A matrix that is a term."""

    term: Term
    reading: Reading

    @property
    def T(self) -> Matrix3:  # noqa: N802  (the mathematical name)
        """The transpose."""
        return self.reading.matrix(transposed(self.term))

    def __sub__(self, other: Matrix3) -> Matrix3:
        if isinstance(other, WholeMatrix):
            return self.reading.matrix(Term("difference", (self.term, other.term)))
        return super().__sub__(other)

    def __matmul__(self, other: sympy.Basic) -> sympy.Basic:
        if isinstance(other, WholeMatrix):
            return self.reading.matrix(Term("product", (self.term, other.term)))
        if isinstance(other, WholePoint3):
            return self.reading.point3(Term("apply", (self.term, other.term)))
        return super().__matmul__(other)


@dataclass(frozen=True)
class WholeRotation(Rotation):
    """A rotation that is one symbol, defined by its current matrix and its small rotation."""

    whole: WholeMatrix

    def __matmul__(self, vector: Point3) -> Point3:
        turned: Point3 = self.whole @ vector
        return turned

    def matrix(self) -> Matrix3:
        """The matrix."""
        return self.whole

    def inverse(self) -> InverseRotation:
        """From the world to the local frame."""
        return WholeInverse(self, self.whole)


@dataclass(frozen=True)
class WholeInverse(InverseRotation):
    """The inverse of a rotation that is one symbol: its transpose."""

    whole: WholeMatrix

    def __matmul__(self, other: sympy.Basic) -> sympy.Basic:
        return self.whole.T @ (other.matrix() if isinstance(other, Rotation) else other)

    def matrix(self) -> Matrix3:
        """The matrix."""
        return self.whole.T


def _without_neutral(value: sympy.Basic, parts: list[sympy.Basic]) -> sympy.Basic:
    neutral = {sympy.Add: 0, sympy.Mul: 1}.get(type(value))
    if neutral is not None:
        parts = [part for part in parts if part != neutral]
        if len(parts) < 2:
            return parts[0] if parts else sympy.Integer(neutral)
    if isinstance(value, sympy.Pow) and parts[1] in (0, 1):
        return parts[0] if parts[1] == 1 else sympy.Integer(1)
    return value.func(*parts, evaluate=False)


def transposed(term: Term) -> Term:
    """The transpose of a matrix."""
    return Term(*term.parts[0]) if term.kind == "transpose" else Term("transpose", (term,))


def read(formula: Formula) -> tuple[Reading, list[sympy.Basic]]:
    """A formula with its blocks whole: the reading, and the parts of what `residual` returns."""
    reading = Reading(made_of={name: (name,) for name in (*formula.unknowns, *formula.observations)})
    positional, keyword = [], {}
    with sympy.evaluate(False):
        for argument in formula.arguments:
            whole = _argument(argument, reading)
            if argument.is_unknown:
                positional.append(whole)
            else:
                keyword[argument.name] = whole
        residual = formula.residual(*positional, **keyword)
        return reading, [
            part if hasattr(part, "term") else reading.cleaned(part) for part in _parts(residual)
        ]


def _parts(residual: sympy.Basic) -> Iterator[sympy.Basic]:
    if isinstance(residual, tuple | list):
        for part in residual:
            yield from _parts(part)
    elif isinstance(residual, Point2 | Point3 | Matrix3) and not hasattr(residual, "term"):
        yield from residual
    else:
        yield residual


def _argument(argument: Argument, reading: Reading) -> sympy.Basic:
    symbols = [sympy.Symbol(name, real=True) for name in argument.scalars]
    context = [sympy.Symbol(name, real=True) for name in argument.context]
    built = argument.declaration.build(symbols, context)
    return _whole(built, iter(argument.declaration.atoms), argument.name, reading)


def _whole(value: sympy.Basic, atoms: Iterator[Atom], name: str, reading: Reading) -> sympy.Basic:
    """A block with its points, rotations and matrices made whole, one atom after the other."""
    if isinstance(value, Point2 | Point3 | Rotation | Matrix3):
        return _whole_atom(value, next(atoms), name, reading)
    if is_dataclass(value) and not isinstance(value, type):
        parts = {f.name: _whole(getattr(value, f.name), atoms, name, reading) for f in fields(value)}
        return replace(value, **parts)
    if isinstance(value, tuple) and value and isinstance(value[0], Point2):
        return type(value)(_whole(part, atoms, name, reading) for part in value)
    next(atoms, None)
    return value


def _whole_atom(value: sympy.Basic, atom: Atom, name: str, reading: Reading) -> sympy.Basic:
    if isinstance(value, Rotation):
        return _whole_rotation(atom, name, reading)
    if isinstance(value, Direction):
        return _whole_direction(atom, reading)
    if isinstance(value, Matrix3):
        return reading.matrix(reading.given(atom.scalars, name))
    term = reading.given(atom.scalars, name)
    for axis, scalar in zip("xyz", atom.scalars, strict=False):
        reading.scalars[Term("component", (term, axis))] = sympy.Symbol(scalar, real=True)
    return reading.point2(term) if isinstance(value, Point2) else reading.point3(term)


def _whole_rotation(atom: Atom, name: str, reading: Reading) -> WholeRotation:
    stored = reading.given(atom.context, name)
    current = transposed(stored) if atom.transposed else stored
    small = reading.given(atom.scalars, name)
    whole = reading.define(f"R_{name}", Term("product", (current, Term("turn", (small,)))))
    return WholeRotation(reading.matrix(current), reading.point3(small), reading.matrix(whole))


def _whole_direction(atom: Atom, reading: Reading) -> WholePoint3:
    normal, along_u, along_v = (reading.given(atom.context[k : k + 3], "N") for k in (0, 3, 6))
    du, dv = (sympy.Symbol(scalar, real=True) for scalar in atom.scalars)
    moved = Term("add", (Term("add", (normal, Term("scale", (du, along_u)))), Term("scale", (dv, along_v))))
    name = normal.parts[0].removeprefix("PNorm").lstrip("_")
    return reading.point3(reading.define(f"N_{name}", moved))


def common_name(scalars: Sequence[str], otherwise: str) -> str:
    """What the names of components share: `P_to` of `P_to_x`, `P_to_y`, `P_to_z`; else a given name."""
    first, last = scalars[0], scalars[-1]
    start = next((k for k, (a, b) in enumerate(zip(first, last, strict=False)) if a != b), len(first))
    end = next(
        (k for k, (a, b) in enumerate(zip(first[::-1], last[::-1], strict=False)) if a != b), len(first)
    )
    head, tail = first[:start].rstrip("_"), first[len(first) - end :].lstrip("_") if end else ""
    joined = "_".join(part for part in (head, tail) if part)
    return joined if joined and len(first) == len(last) else otherwise
