"""From a formula to its module: the stages, in order.

| stage | takes | gives |
|---|---|---|
| `declare` | `Formula`, a class with a `residual` | `Declared`: sympy expressions of its residuals |
| `translate` | `Declared` | `Translated`: a graph where equal expressions are one node; its hash |
| `differentiate` | `Translated` | `Differentiated`: the Jacobian, by the chain rule in several orders |
| `simplify` | `Differentiated` | `Derived`: the cheapest of them, signs and products shared |
| `print_kernels` | `Derived` | `Printed`: the loops of the kernels, as lines |
| `render` | `Printed` | `Module`: the text of the file; its names, equation, hashes |

`gencode NAME --stages` shows them at work on a formula.
"""

import inspect
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from obseq.codegen.compiler import (
    Declared,
    Derived,
    Differentiated,
    Translated,
    declare,
    derive,
    differentiate,
    simplify,
    translate,
)
from obseq.codegen.kernel_text import Printed, print_all_kernels, print_kernels
from obseq.codegen.modules import Module, render
from obseq.errors import FormulaError
from obseq.formulas.base import Formula


class Stage(NamedTuple):
    """A stage: what runs, what it takes, what it gives."""

    run: Callable[[Any], object]
    takes: type
    gives: type


STAGES = (
    Stage(declare, Formula, Declared),
    Stage(translate, Declared, Translated),
    Stage(differentiate, Translated, Differentiated),
    Stage(simplify, Differentiated, Derived),
    Stage(print_kernels, Derived, Printed),
    Stage(render, Printed, Module),
)


def outcomes(formula: Formula) -> Iterator[tuple[Stage, Any]]:
    """Each stage with what it gives."""
    outcome: Any = formula
    for stage in STAGES:
        outcome = stage.run(outcome)
        yield stage, outcome


def generate(formula: Formula, *, on_demand: bool = False) -> Module:
    """The module of a formula.

    Args:
        formula: The formula.
        on_demand: True for all kernels, also those that the generated folder does without.

    Raises:
        FormulaError: The formula cannot be generated.
    """
    try:
        if on_demand:
            return render(print_all_kernels(derive(formula)))
        *_, (_, module) = outcomes(formula)
    except RecursionError:
        raise FormulaError(
            f"{formula.name}: its expressions are nested too deeply to be generated; take lower degrees"
        ) from None
    result: Module = module
    return result


def shown(formula: Formula) -> Iterator[str]:
    """The stages at work on a formula, a line or two for each."""
    yield f"{formula.name}"
    for number, (stage, outcome) in enumerate(outcomes(formula), 1):
        summary = (inspect.getdoc(stage.run) or "").partition("\n")[0]
        yield f"{number}. {stage.run.__name__}: {stage.takes.__name__} -> {stage.gives.__name__}. {summary}"
        yield f"   {outcome}"
