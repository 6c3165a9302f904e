"""Formulas outside the generated folder: made in memory from a class, or in a file from a name."""

import linecache
from pathlib import Path
from types import ModuleType

from obseq.codegen.files import write_atomically
from obseq.codegen.modules import render_module
from obseq.formulas.base import Formula
from obseq.formulas.families import find
from obseq.kernels.loading import Kernel, describe
from obseq.kernels.ondemand import folder


def compile_formula(formula: Formula) -> Kernel:
    """The kernel of a formula, in memory: no file is written, and nothing is kept for the next process.

    It serves wherever a formula's name does: `obseq.Calculator(kernel)`, `LeastSquares.add(kernel, ...)`.

    Raises:
        FormulaError: The formula cannot be generated.
    """
    rendered = render_module(formula)
    module = ModuleType(rendered.module)
    place = f"<generated {formula.name}>"
    linecache.cache[place] = (len(rendered.text), None, rendered.text.splitlines(keepends=True), place)
    exec(compile(rendered.text, place, "exec"), module.__dict__)  # the one place that executes text
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
    text = render_module(formula).text
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, text)
