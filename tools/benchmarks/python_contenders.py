"""The Python contenders of the kernel bench: sympy's own derivatives and sharing under numba, and JAX."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy
from interleaved import Repeat
from numba import njit
from numpy.typing import NDArray

from obseq.formulas import functions
from obseq.formulas.base import Formula

Array = NDArray[np.float64]


class Wrap(sympy.Function):  # type: ignore[misc]
    """An angle brought to (-pi, pi], whose derivative is 1."""

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        """The derivative."""
        return sympy.S.One

    def _pythoncode(self, printer: Any) -> str:
        angle = printer._print(self.args[0])
        return f"({angle} - {2 * math.pi!r} * math.ceil(({angle} - {math.pi!r}) / {2 * math.pi!r}))"


STANDARD = {
    functions.Named: lambda _, value: value,
    functions.WrapAngle: lambda angle: Wrap(angle),
    functions.Sqrt: lambda x: sympy.sqrt(x),
    functions.SincSqrt: lambda s: sympy.sin(sympy.sqrt(s)) / sympy.sqrt(s),
    functions.CosSqrt: lambda s: sympy.cos(sympy.sqrt(s)),
    functions.AngleRatio: lambda s, z: sympy.atan2(sympy.sqrt(s), z) / sympy.sqrt(s),
    functions.AxialSum: lambda s, z: sympy.sqrt(s + z**2) + z,
    functions.NormalisedRatio: lambda a, b: sympy.Piecewise((a / b - 1, a < b), (1 - b / a, True)),
}
"""Our functions as sympy's own."""


def expressions(formula: Formula) -> list[sympy.Expr]:
    """The residuals in sympy's own functions, simplified as sympy does when it builds them."""
    memory: dict[int, sympy.Basic] = {}

    def visit(expression: sympy.Basic) -> sympy.Basic:
        if id(expression) not in memory:
            rebuild = STANDARD.get(type(expression), expression.func)
            memory[id(expression)] = (
                rebuild(*(visit(a) for a in expression.args)) if expression.args else expression
            )
        return memory[id(expression)]

    return [visit(expression) for expression in formula.expressions()]


def shared_jacobian(
    formula: Formula,
) -> tuple[list[tuple[sympy.Symbol, sympy.Expr]], list[sympy.Expr]]:
    """sympy.diff of every residual by every unknown, and one sympy.cse of everything."""
    residuals = expressions(formula)
    unknowns = [sympy.Symbol(name, real=True) for name in formula.unknowns]
    outputs = [e for residual in residuals for e in (residual, *(residual.diff(x) for x in unknowns))]
    replacements, reduced = sympy.cse(outputs, symbols=sympy.numbered_symbols("shared_"))
    return replacements, reduced


def sympy_contender(formula: Formula, u: Array, o: Array) -> tuple[Repeat, Array]:
    """Derivatives and shared sub-expressions of sympy, printed as a loop over rows and compiled by numba."""
    replacements, outputs = shared_jacobian(formula)
    text = _loop(formula, replacements, outputs)
    namespace: dict[str, Any] = {"math": math, "njit": njit}
    exec(text, namespace)
    results = np.zeros((len(u), len(outputs)))
    run = namespace["run"]
    run(u, o, results, 1)
    jacobian = results.reshape(len(u), -1, 1 + len(formula.unknowns))[:, :, 1:].copy()
    return lambda repeats: run(u, o, results, repeats), jacobian


def _loop(
    formula: Formula, replacements: Sequence[tuple[sympy.Symbol, sympy.Expr]], outputs: Sequence[sympy.Expr]
) -> str:
    lines = [f"{name} = u[i, {k}]" for k, name in enumerate(formula.unknowns)]
    lines += [f"{name} = o[i, {k}]" for k, name in enumerate(formula.observations)]
    lines += [f"{symbol} = {sympy.pycode(expression)}" for symbol, expression in replacements]
    lines += [f"results[i, {k}] = {sympy.pycode(expression)}" for k, expression in enumerate(outputs)]
    body = "\n".join(f"            {line}" for line in lines)
    return f"""
@njit(error_model="numpy", fastmath={{"contract"}})
def run(u, o, results, repeats):
    for _ in range(repeats):
        for i in range(len(u)):
{body}
"""


def jax_contender(formula: Formula, u: Array, o: Array) -> tuple[Repeat, Array]:
    """jit(vmap) of values and Jacobian, in forward or reverse mode, whichever is faster here."""
    import jax  # type: ignore[import-not-found]  # optional
    from interleaved import race

    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_platforms", "cpu")
    symbols = [
        [sympy.Symbol(n, real=True) for n in names] for names in (formula.unknowns, formula.observations)
    ]
    wrap = {"Wrap": lambda angle: angle - 2 * math.pi * jax.numpy.ceil((angle - math.pi) / (2 * math.pi))}
    value = sympy.lambdify(symbols, expressions(formula), modules=[wrap, "jax"], cse=True)

    def residuals(x: Any, y: Any) -> Any:
        return jax.numpy.stack(value(x, y))

    a, b = jax.numpy.asarray(u), jax.numpy.asarray(o)
    contenders: dict[str, Repeat] = {}
    for mode in (jax.jacfwd, jax.jacrev):
        both = jax.jit(jax.vmap(lambda x, y, mode=mode: (residuals(x, y), mode(residuals)(x, y))))
        contenders[mode.__name__] = _repeated(both, a, b)
        jacobian = np.asarray(both(a, b)[1])
    timings = race(contenders, 5)
    return contenders[min(timings, key=lambda name: timings[name].median)], jacobian


def _repeated(function: Any, a: Any, b: Any) -> Repeat:
    def run(repeats: int) -> None:
        for _ in range(repeats):
            function(a, b)[1].block_until_ready()

    return run
