"""Formulas outside the generated folder: made in memory from a class, or in a file from a name."""

import importlib
from pathlib import Path

from obseq.arguments import expecting, instance
from obseq.codegen.compiler import derive
from obseq.codegen.pipeline import generate
from obseq.formulas import find
from obseq.formulas.base import Formula
from obseq.kernels.loading import Kernel, describe
from obseq.kernels.ondemand import folder, in_memory, write_kept
from obseq.module_texts import OWN


@expecting(formula=instance(Formula, what="a formula, an object of a class derived from Formula"))
def compile_formula(formula: Formula) -> Kernel:
    """The kernel of a formula, in memory; only its machine code is kept for other processes.

    It serves wherever a formula's name does: `obseq.Calculator(kernel)`, `LeastSquares.add(kernel, ...)`.

    Raises:
        FormulaError: The formula cannot be generated.
        InputError: It is something else: the class itself, or a name.
    """
    return describe(in_memory(formula.name, generate(formula, on_demand=True).text))


def text_of(name: str) -> str | None:
    """The module of a name of the registry, or of any member of a family; None when no formula has it.

    Raises:
        FormulaError: The formula cannot be generated.
    """
    formula = find(name)
    return None if formula is None else generate(formula, on_demand=True).text


def formula_hash(name: str, package: str) -> str:
    """Hash of the mathematics of a formula, as generated modules say it; empty without such a formula."""
    formula = formula_of(name, package)
    return "" if formula is None else derive(formula).digest


def formula_of(name: str, package: str) -> Formula | None:
    """The formula of a name: of obseq, its families included, or of the list of another package."""
    if package == OWN:
        return find(name)
    registry = importlib.import_module(f"{package}.formulas").REGISTRY
    return next((formula for formula in registry if formula.name == name), None)


def keep(formula: Formula) -> Path:
    """Writes the module of a formula where those built on demand are kept; the file."""
    path = folder() / f"{formula.name}.py"
    write_kept(path, generate(formula, on_demand=True).text)
    return path
