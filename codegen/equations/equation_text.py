"""The equations of a formula as people write them: in plain text, and in LaTeX."""

import re
from collections import Counter
from dataclasses import dataclass, field

import sympy

from obseq.codegen.equations.expressions import factors_of, repeated, signed_terms
from obseq.codegen.equations.whole_blocks import Reading, Term, common_name, read
from obseq.codegen.operators import OPERATORS
from obseq.formulas import functions
from obseq.formulas.base import Formula

SUM, PRODUCT, POWER, ATOM = range(4)

FUNCTIONS = {operator.symbolic: operator.written for operator in OPERATORS.values()}
"""What functions are called in equations, when that is not the name of their class."""


@dataclass(frozen=True)
class Equation:
    """One line: what is on the left of the equal sign, and the terms of a sum on the right."""

    left: str
    right: tuple[str, ...]


@dataclass
class Text:
    """Writes equations in plain text.

    Attributes:
        reading: What the symbols stand for.
        shared: Parts that come several times: they get names `s_1`, `s_2`, ...
        lines: The definitions written so far, in an order where each comes before its use.
    """

    reading: Reading
    shared: frozenset[sympy.Basic] = frozenset()
    lines: list[Equation] = field(default_factory=list)
    _written: dict[str, sympy.Basic] = field(default_factory=dict)
    _abbreviations: dict[sympy.Basic, str] = field(default_factory=dict)

    def name(self, name: str) -> str:
        """A name of a scalar, of a vector or of a matrix."""
        return name

    def fraction(self, above: str, below: str) -> str:
        """A quotient; its parts are ready to be set beside a stroke."""
        return f"{above} / {below}"

    def root(self, text: str) -> str:
        """A square root."""
        return f"sqrt({text})"

    def power(self, base: str, exponent: str) -> str:
        """A power."""
        return f"{base}^{exponent}"

    def call(self, function: str, arguments: list[str]) -> str:
        """A function."""
        return f"{function}({', '.join(arguments)})"

    def between(self, text: str) -> str:
        """Parentheses."""
        return f"({text})"

    def length(self, text: str) -> str:
        """The length of a vector."""
        return f"|{text}|"

    def transpose(self, text: str) -> str:
        """A transposed matrix."""
        return f"{text}^T"

    def turn(self, small: str) -> str:
        """I minus the matrix of the cross product."""
        return f"(I - [{small}]x)"

    def component(self, vector: str, axis: str) -> str:
        """A component of a vector."""
        return f"{vector}_{axis}"

    product, scalar_product, cross_product = " ", " . ", " ^ "
    fraction_binding = PRODUCT

    # what is common to all styles

    def define(self, name: str, value: sympy.Basic, key: sympy.Basic) -> str:
        """The name of a definition, written out the first time that it is met."""
        while name in self._written and self._written[name] is not key:
            name += "'"
        if name not in self._written:
            self._written[name] = key
            terms = self.sum_of(value, whole=True)
            self.lines.append(Equation(self.name(name), terms))
        return self.name(name)

    def distinct(self, name: str) -> str:
        """A name that no definition has."""
        while name in self._written:
            name += "'"
        return self.name(name)

    def abbreviate(self, value: sympy.Basic) -> str:
        """The name given to a part that comes several times."""
        if value not in self._abbreviations:
            terms = self.sum_of(value, whole=True)
            name = self._abbreviations[value] = self.name(f"s_{len(self._abbreviations) + 1}")
            self.lines.append(Equation(name, terms))
        return self._abbreviations[value]

    def write(self, value: sympy.Basic, tighter: int = SUM) -> str:
        """A scalar, a vector or a matrix; between parentheses when it binds less than asked."""
        if value in self.shared:
            return self.abbreviate(value)
        text, binding = self._term(value) if isinstance(value, Term) else self._scalar(value)
        return text if binding >= tighter else self.between(text)

    def sum_of(self, value: sympy.Basic, whole: bool = False) -> tuple[str, ...]:
        """The terms of a sum, each after the first with its sign; anything else is one term.

        Args:
            value: What to write.
            whole: True for the right side of an equation, which is written out even if it has a name.
        """
        kept = self.shared - {value} if whole else self.shared
        signed = signed_terms(value, 1, kept)
        if whole and [term for _, term in signed] == [value]:
            terms = [(signed[0][0], self._written_out(value))]
        else:
            terms = [(sign, self.write(term, PRODUCT)) for sign, term in signed]
        if not terms:
            return ("0",)
        first = terms[0]
        lead = f"-{first[1]}" if first[0] < 0 else first[1]
        return (lead, *(f"{'+' if sign > 0 else '-'} {text}" for sign, text in terms[1:]))

    def _written_out(self, value: sympy.Basic) -> str:
        return (self._term(value) if isinstance(value, Term) else self._scalar(value))[0]

    def _scalar(self, value: sympy.Basic) -> tuple[str, int]:
        value = sympy.sympify(value)
        if isinstance(value, sympy.Symbol):
            term = self.reading.terms.get(value)
            return (self.name(value.name), ATOM) if term is None else self._of_vectors(term)
        if isinstance(value, sympy.Number):
            return self._number(value)
        if isinstance(value, functions.Named):
            return self.define(str(value.args[0]), value.args[1], value.args[1]), ATOM
        if isinstance(value, sympy.Add | sympy.Mul):
            return self._sum_or_product(value)
        if isinstance(value, sympy.Pow):
            return self._power(value.args[0], value.args[1])
        return self._function(value)

    def _number(self, value: sympy.Number) -> tuple[str, int]:
        if value.is_Rational and not value.is_Integer:
            return self.fraction(str(value.p), str(value.q)), self.fraction_binding
        text = str(value) if value.is_Integer else f"{float(value):g}"
        return text, ATOM if value >= 0 else SUM

    def _sum_or_product(self, value: sympy.Expr) -> tuple[str, int]:
        terms = signed_terms(value, 1, self.shared - {value})
        if len(terms) != 1 or terms[0][0] < 0:
            return " ".join(self.sum_of(value, whole=True)), SUM
        above, below = factors_of(terms[0][1], self.shared - {value})
        if not below and len(above) == 1:
            return self.write(above[0], ATOM), ATOM
        if not below and len(set(above)) == 1:
            return self._product(above), POWER
        if not below:
            return self._product(above), PRODUCT
        return self._quotient(above, below), self.fraction_binding

    def _product(self, factors: list[sympy.Basic]) -> str:
        counts = Counter(factors)
        texts = [
            self.write(factor, POWER) if count == 1 else self.power(self.write(factor, ATOM), str(count))
            for factor, count in counts.items()
        ]
        return self.product.join(texts) or "1"

    def _quotient(self, above: list[sympy.Basic], below: list[sympy.Basic]) -> str:
        denominator = self._product(below) if len(below) == 1 else self.between(self._product(below))
        return self.fraction(self._product(above), denominator)

    def _power(self, base: sympy.Basic, exponent: sympy.Basic) -> tuple[str, int]:
        if exponent == sympy.Rational(1, 2):
            return self.root(self.write(base)), ATOM
        if exponent.is_number and exponent.is_negative:
            above, below = factors_of(sympy.Pow(base, exponent, evaluate=False), self.shared)
            return self._quotient(above, below), self.fraction_binding
        return self.power(self.write(base, ATOM), self.write(exponent)), POWER

    def _function(self, value: sympy.Basic) -> tuple[str, int]:
        if isinstance(value, functions.Sqrt):
            return self._root(value.args[0]), ATOM
        name = FUNCTIONS.get(type(value)) or type(value).__name__
        return self.call(name, [self.write(argument) for argument in value.args]), ATOM

    def _root(self, value: sympy.Basic) -> str:
        term = self.reading.terms.get(value)
        if term is not None and term.kind == "dot" and term.parts[0] == term.parts[1]:
            return self.length(self.write(term.parts[0]))
        return self.root(self.write(value))

    def _of_vectors(self, term: Term) -> tuple[str, int]:
        """A scalar made of vectors."""
        if term.kind == "dot":
            a, b = term.parts
            return self.scalar_product.join((self.write(a, POWER), self.write(b, POWER))), PRODUCT
        vector, axis = term.parts
        return self.component(self.write(vector, ATOM), axis), ATOM

    def _term(self, term: Term) -> tuple[str, int]:
        kind, parts = term
        if kind == "name":
            defined = self.reading.definitions.get(parts[0])
            return (self.define(parts[0], defined, defined) if defined else self.name(parts[0])), ATOM
        if kind in ("add", "sub", "difference"):
            return " ".join(self.sum_of(term)), SUM
        if kind == "cross":
            return self.cross_product.join(self.write(part, POWER) for part in parts), PRODUCT
        if kind == "scale":
            return self.product.join((self.write(parts[0], POWER), self.write(parts[1], PRODUCT))), PRODUCT
        if kind in ("apply", "product"):
            return self.product.join(self.write(part, PRODUCT) for part in parts), PRODUCT
        if kind == "transpose":
            return self.transpose(self.write(parts[0], ATOM)), ATOM
        if kind == "turn":
            return self.turn(self.write(parts[0])), ATOM
        matrix, row = parts
        return self.component(self.write(matrix, ATOM), str(row + 1)), ATOM


@dataclass
class Latex(Text):
    """Writes equations in LaTeX."""

    def name(self, name: str) -> str:
        """A name, its parts after an underscore as an index."""
        base, _, index = name.rstrip("'").partition("_")
        primes = "'" * name.count("'")
        letter = re.fullmatch(r"([A-Za-z])(\d*)", base)
        head = letter[1] if letter else rf"\mathrm{{{base}}}"
        indices = [part for part in ((letter[2] if letter else ""), *index.split("_")) if part]
        words = [part if len(part) == 1 or part.isdigit() else rf"\mathrm{{{part}}}" for part in indices]
        return head + (f"_{{{','.join(words)}}}" if words else "") + primes

    def fraction(self, above: str, below: str) -> str:
        """A fraction; the bar replaces parentheses around all that is above or below."""
        return rf"\frac{{{_bare(above)}}}{{{_bare(below)}}}"

    def root(self, text: str) -> str:
        """A square root."""
        return rf"\sqrt{{{text}}}"

    def power(self, base: str, exponent: str) -> str:
        """A power."""
        return f"{{{base}}}^{{{exponent}}}"

    def call(self, function: str, arguments: list[str]) -> str:
        """A function."""
        name = function.replace("_", r"\_")
        head = (
            rf"\{function}"
            if function in ("sin", "cos", "tan", "exp", "log")
            else rf"\operatorname{{{name}}}"
        )
        return rf"{head}\left({', '.join(arguments)}\right)"

    def between(self, text: str) -> str:
        """Parentheses."""
        return rf"\left({text}\right)"

    def length(self, text: str) -> str:
        """The length of a vector."""
        return rf"\left\lVert {text}\right\rVert"

    def transpose(self, text: str) -> str:
        """A transposed matrix."""
        return f"{{{text}}}^T"

    def turn(self, small: str) -> str:
        """I minus the matrix of the cross product."""
        return rf"\left(I - [{small}]_\times\right)"

    def component(self, vector: str, axis: str) -> str:
        """A component of a vector, beside its index if it has one."""
        if vector.endswith("}") and "_{" in vector and vector.count("_{") == 1 and "left" not in vector:
            return f"{vector[:-1]},{axis}}}"
        return f"{vector}_{{{axis}}}"

    product, scalar_product, cross_product = r"\,", r" \cdot ", r" \wedge "
    fraction_binding = POWER


def _bare(latex: str) -> str:
    """Without the parentheses that hold the whole, if they do."""
    depth = 0
    for match in re.finditer(r"\\(left|right)[()]", latex):
        depth += 1 if match[1] == "left" else -1
        if depth == 0:
            whole = latex.startswith(r"\left(") and match.end() == len(latex)
            return latex[len(r"\left(") : match.start()] if whole else latex
    return latex


def equations(formula: Formula, residuals: tuple[str, ...], style: type[Text]) -> list[Equation]:
    """The definitions of a formula, then its residuals, written in a style.

    Args:
        formula: The formula.
        residuals: Names of its scalar residuals.
        style: `Text` or `Latex`.
    """
    reading, parts = read(formula)
    values = [
        sympy.sympify(part) if (term := getattr(part, "term", None)) is None else term for part in parts
    ]
    writer = style(reading, repeated(reading, values))
    results, first = [], 0
    for k, (part, value) in enumerate(zip(parts, values, strict=True)):
        size = len(tuple(part)) if isinstance(value, Term) else 1
        left = _left(residuals[first : first + size], formula, writer, k if len(parts) > 1 else None)
        results.append(Equation(left, writer.sum_of(value, whole=True)))
        first += size
    return writer.lines + results


def _left(names: tuple[str, ...], formula: Formula, writer: Text, number: int | None) -> str:
    """What a residual is called: `v` with the name of what was observed; or the name of a value."""
    name = names[0] if len(names) == 1 else common_name(names, "")
    if re.search(r"^\s*Values?\b", type(formula).__doc__ or "", re.MULTILINE) and name:
        return writer.distinct(name)
    if not name or name.startswith("residual"):
        return writer.name("v" if number is None else f"v_{number + 1}")
    return writer.name(f"v_{name}")
