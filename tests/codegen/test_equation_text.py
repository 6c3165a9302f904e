"""The equations that the documentation prints: evaluated as printed, they give the residuals."""

import math
import re
from typing import Any

import numpy as np
from families import of_each
from unchanged import Seen

from obseq.codegen.compiler import derive
from obseq.codegen.equations.documentation import equation_latex, equation_text
from obseq.codegen.equations.equation_text import Equation, Text, equations
from obseq.codegen.equations.whole_blocks import Reading, read
from obseq.formulas import REGISTRY, Formula, functions
from obseq.formulas.rigid_blocks import BlocRigid
from obseq.formulas.topography import TopoHz
from obseq.kernels import calculator, derivatives

TOKEN = re.compile(r"\s*(\d+(?:\.\d*)?(?:e[-+]?\d+)?|[A-Za-z_]\w*'*|\^T|[-+/().,^|\[\]])")

CALLS = {
    "wrap": functions.wrap_angle,
    "contrast": functions.normalised_ratio,
    "sinc_sqrt": functions.sinc_sqrt,
    "cos_sqrt": functions.cos_sqrt,
    "angle_ratio": functions.angle_ratio,
    "axial_sum": functions.axial_sum,
    **{name: getattr(math, name) for name in ("sin", "cos", "tan", "atan2", "asin", "acos", "sqrt", "exp")},
}


class Reader:
    """Evaluates an equation as it is printed: juxtaposition multiplies, ` . ` and ` ^ ` are products."""

    def __init__(self, text: str, names: dict[str, Any]) -> None:
        self.text, self.names = text, names
        self.tokens = [(match[1], match.start() < match.start(1)) for match in TOKEN.finditer(text)]
        assert "".join(token for token, _ in self.tokens) == text.replace(" ", ""), text
        self.at = 0

    def peek(self) -> str:
        return self.tokens[self.at][0] if self.at < len(self.tokens) else ""

    def is_spaced(self) -> bool:
        return self.at < len(self.tokens) and self.tokens[self.at][1]

    def take(self, *expected: str) -> str:
        token = self.peek()
        assert not expected or token in expected, f"{token!r} instead of {expected} in {self.text}"
        self.at += 1
        return token

    def sum(self) -> Any:
        negative = self.peek() == "-" and bool(self.take("-"))
        value = self.product()
        value = -value if negative else value
        while self.peek() in ("+", "-"):
            value = value + self.product() if self.take() == "+" else value - self.product()
        return value

    def product(self) -> Any:
        value = self.power()
        while True:
            if self.peek() == ".":
                self.take()
                value = float(np.dot(value, self.power()))
            elif self.peek() == "^" and self.is_spaced():
                self.take()
                value = np.cross(value, self.power())
            elif self.peek() == "/":
                self.take()
                value = value / self.power()
            elif re.match(r"[\w(|]", self.peek()) and not self.closes():
                return multiplied(value, self.product_of_the_right())
            else:
                return value

    def product_of_the_right(self) -> Any:
        """Products of matrices and vectors are read from the right; those of numbers do not care."""
        value = self.power()
        while self.peek() == "/":
            self.take()
            value = value / self.power()
        if re.match(r"[\w(|]", self.peek()) and not self.closes():
            return multiplied(value, self.product_of_the_right())
        return value

    def closes(self) -> bool:
        return self.peek() == "|" and not self.is_spaced()

    def power(self) -> Any:
        value = self.atom()
        while self.peek() == "^T" or (self.peek() == "^" and not self.is_spaced()):
            value = value.T if self.take() == "^T" else value ** self.atom()
        return value

    def atom(self) -> Any:
        token = self.take()
        if token == "(":
            value = self.turn() if self.text_ahead() == "I-[" else self.sum()
            self.take(")")
            return self.component(value)
        if token == "|":
            value = float(np.linalg.norm(self.sum()))
            self.take("|")
            return value
        if token[0].isdigit():
            return float(token)
        if self.peek() == "(" and not self.is_spaced():
            return CALLS[token](*self.arguments())
        return self.component(self.named(token))

    def component(self, value: Any) -> Any:
        if re.fullmatch(r"_[xyz]", self.peek()):
            return value["xyz".index(self.take()[1])]
        return value

    def text_ahead(self) -> str:
        return "".join(token for token, _ in self.tokens[self.at : self.at + 3])

    def turn(self) -> Any:
        self.at += 3
        (x, y, z) = self.named(self.take())
        self.take("]")
        self.take("x")
        return np.eye(3) - np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])

    def arguments(self) -> list[Any]:
        self.take("(")
        values = [self.sum()]
        while self.peek() == ",":
            self.take()
            values.append(self.sum())
        self.take(")")
        return values

    def named(self, name: str) -> Any:
        if name in self.names:
            return self.names[name]
        whole, _, part = name.rpartition("_")
        assert whole, f"{name} is not defined in {self.text}"
        if part.isdigit():
            return self.named(whole)[int(part) - 1]
        return self.named(whole)["xyz".index(part)]


def multiplied(a: Any, b: Any) -> Any:
    return a @ b if np.ndim(a) and np.ndim(b) else a * b


def whole_names(reading: Reading, values: dict[str, float]) -> dict[str, Any]:
    """Scalars, and the vectors and matrices made of them."""
    names: dict[str, Any] = {}
    for name, scalars in reading.made_of.items():
        array = np.array([values[scalar] for scalar in scalars])
        shape = {1: (), 9: (3, 3)}.get(len(scalars), array.shape)
        names[name] = array.reshape(shape)
    return names


def evaluated(names: dict[str, Any], lines: list[Equation], count: int) -> list[float]:
    """The residuals, from the equations as they are printed, as many of which are the residuals."""
    residuals: list[float] = []
    for line in lines:
        names[line.left] = Reader(" ".join(line.right), names).sum()
    for line in lines[len(lines) - count :]:
        residuals += np.ravel(names[line.left]).tolist()
    return residuals


@of_each()
def test_the_equation_printed_is_the_residual(formula: Formula, seen: Seen) -> None:
    if f"equations/{formula.name}" in seen:
        return
    calc = calculator(formula.name)
    unknowns, observations = derivatives.draw(calc.kernel, 3, np.random.default_rng(5))
    lines, (reading, parts) = equations(formula, calc.residuals, Text), read(formula)
    for u, o, expected in zip(unknowns, observations, calc.values(unknowns, observations), strict=True):
        values = dict(zip(calc.unknowns, u.tolist(), strict=True))
        values |= dict(zip(calc.observations, o.tolist(), strict=True))
        found = evaluated(whole_names(reading, values), lines, len(parts))
        size = max(1.0, np.abs(expected).max(initial=0.0), np.abs(o).max(initial=0.0))
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11 * size)
    seen.add(f"equations/{formula.name}")


def test_definitions_come_before_their_use_and_keep_their_names() -> None:
    assert equation_text(TopoHz(), ("val",)).splitlines() == [
        "R_station = mi (I - [Wi]x)",
        "sight = R_station^T (P_to - Ci)",
        "v_val = wrap(atan2(sight_x, sight_y) - val)",
    ]


def test_latex_of_a_sight() -> None:
    *_, sight, residual = equation_latex(TopoHz(), ("val",))
    assert sight == r"\mathrm{sight} &= {R_{\mathrm{station}}}^T\,\left(P_{\mathrm{to}} - \mathrm{Ci}\right)"
    assert residual == (
        r"v_{\mathrm{val}} &= \operatorname{wrap}\left(\operatorname{atan2}\left("
        r"\mathrm{sight}_{x}, \mathrm{sight}_{y}\right) - \mathrm{val}\right)"
    )


def test_braces_and_parentheses_of_latex_match(seen: Seen) -> None:
    for formula in () if "latex" in seen else REGISTRY:
        text = "".join(equation_latex(formula, calculator(formula.name).residuals))
        assert text.count("{") == text.count("}"), formula.name
        assert text.count(r"\left") == text.count(r"\right"), formula.name
    seen.add("latex")


def test_matrices_stay_whole() -> None:
    names = derive(BlocRigid()).residual_names
    last = equation_text(BlocRigid(), names).splitlines()[-1]
    assert last == "v_2 = R_camera_a^T R_camera_b - R_place_1^T R_place_2"
