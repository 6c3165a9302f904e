"""Formulas outside the generated folder: made in memory from a class, or in a file from a name."""

import linecache
from pathlib import Path
from types import ModuleType

from obseq.codegen.files import write_atomically
from obseq.codegen.pipeline import generate
from obseq.formulas.base import Formula
from obseq.formulas.families import find
from obseq.kernels.loading import Kernel, describe
from obseq.kernels.ondemand import folder


def compile_formula(formula: Formula) -> Kernel:
    """The kernel of a formula, in memory: no module is written.

    It serves wherever a formula's name does: `obseq.Calculator(kernel)`, `LeastSquares.add(kernel, ...)`.

    Raises:
        FormulaError: The formula cannot be generated.
    """
    made = generate(formula, on_demand=True)
    module = ModuleType(made.module)
    place = f"<generated {formula.name}>"
    linecache.cache[place] = (len(made.text), None, made.text.splitlines(keepends=True), place)
    exec(compile(made.text, place, "exec"), module.__dict__)  # the one place that executes text
    return describe(module)


def write(name: str, path: Path) -> bool:
    """Writes the module of the formula of that name, if it is a formula; says whether it is.

    Args:
        name: A name of the registry, or of any member of a family.
        path: File to write; its folder is created.
    """
    formula = find(name)
    if formula is not None:
        _write(formula, path)
    return formula is not None


def keep(formula: Formula) -> Path:
    """Writes the module of a formula where those built on demand are kept; the file."""
    path = folder() / f"{formula.name}.py"
    _write(formula, path)
    return path


def _write(formula: Formula, path: Path) -> None:
    text = generate(formula, on_demand=True).text
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, text)
