"""The same graph as a C++ class with MMVII's calling convention: pushes, one evaluation, lines of results.

The class is called as the original's generated one (`cDist3DVDer`), and has its methods: `PushNewEvals`,
`EvalAndClear`, `DoOneEval`, `ValComp`, `DerComp`, names and sizes. It needs nothing of MMVII.
"""

from collections.abc import Iterable
from pathlib import Path

from obseq.codegen.c99 import header
from obseq.codegen.compiler import Derived, derive
from obseq.codegen.modules import module_name
from obseq.codegen.templating import template
from obseq.formulas.base import Formula
from obseq.writing import write_all

WITH_DERIVATIVES = "VDer"
"""What ends the name of a calculator of values and derivatives."""


def write_classes(formulas: Iterable[Formula], folder: Path) -> list[Path]:
    """Writes a header for each formula in a folder, which is created; gives the files.

    Raises:
        FormulaError: A formula has no C text.
        InputError: The folder cannot be written.
    """
    texts = {
        folder / f"CodeGen_c{formula.name}{WITH_DERIVATIVES}.h": cpp(derive(formula)) for formula in formulas
    }
    write_all(texts)
    return list(texts)


def cpp(derived: Derived) -> str:
    """The header of a formula: its functions, and the class that calls them."""
    formula = derived.formula
    identifier = module_name(formula.name)
    return template("calculator.h.jinja").render(
        functions=header(derived, identifier, "--cpp"),
        name=f"c{formula.name}{WITH_DERIVATIVES}",
        calculator=f"{formula.name}{WITH_DERIVATIVES}",
        function=f"obseq_{identifier}_value_and_jacobian",
        unknowns=formula.unknowns,
        observations=formula.observations,
        elements=len(derived.residuals),
    )
