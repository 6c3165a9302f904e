"""`obseq formulas`: the list of formulas, or what there is to know of one."""

import argparse
import ast
import importlib.util
import re
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.parsing import Commands, add_command
from obseq.errors import FormulaError

if TYPE_CHECKING:
    from obseq.kernels import Kernel

MORE = """
Without a name: one line per formula. With a name: its unknowns, its observations, its equation as it
is written, and where it comes from."""


@dataclass(frozen=True)
class Equation:
    """A formula as it is written.

    Attributes:
        place: The class, by its import path.
        text: The method that computes the residuals.
        source: Where the equation comes from.
    """

    place: str
    text: str
    source: str


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "formulas", run, "list the observation equations, or show one", MORE)
    command.add_argument("name", nargs="?", metavar="NAME", help="the formula to show")


def run(arguments: argparse.Namespace) -> int:
    """Print the list, or one formula."""
    from obseq import kernels

    if arguments.name:
        lines = shown(kernels.load(arguments.name))
    else:
        lines = listed([kernels.load(name) for name in kernels.formula_names()])
    for line in lines:
        print(line)
    return 0


def listed(formulas: "list[Kernel]") -> Iterator[str]:
    """One line per formula: name, number of unknowns and of residuals, what it says."""
    width = max(len(formula.name) for formula in formulas)
    yield f"{'formula':<{width}}  unknowns  residuals"
    for formula in formulas:
        counts = f"{len(formula.unknowns):>8}  {len(formula.residuals):>9}"
        yield f"{formula.name:<{width}}  {counts}  {_description(formula).splitlines()[0]}"


def shown(formula: "Kernel") -> Iterator[str]:
    """A formula in full."""
    yield f"{formula.name}: {_description(formula)}"
    yield ""
    yield "unknowns"
    for block in formula.blocks:
        names = formula.unknowns[block.start : block.start + block.size]
        yield f"  {block.name:<20} {block.kind:<10} {', '.join(names)}"
    context = [name for k, name in enumerate(formula.observations) if k not in formula.measured]
    yield from _names("observations", [formula.observations[k] for k in formula.measured])
    yield from _names("context (current values of the unknowns, kept by obseq)", context)
    yield from _names("residuals", list(formula.residuals))
    equation = equation_of(formula)
    yield ""
    yield f"equation ({equation.place})"
    yield textwrap.indent(equation.text, "  ")
    if equation.source:
        yield ""
        yield f"source: {equation.source}"


def equation_of(formula: "Kernel") -> Equation:
    """The equation as it is written in obseq.formulas, read without importing it: that would load sympy."""
    header = _text(Path(str(formula.module.__file__))).splitlines()[0]
    module, name = re.findall(r"from (obseq\.formulas\.\w+)\.(\w+)", header)[0]
    text = _text(_path_of(module))
    tree = ast.parse(text)
    classes = list(_classes(tree, name))
    residual = next(
        node for found in classes for node in found.body if getattr(node, "name", None) == "residual"
    )
    lines = text.splitlines()[residual.lineno - 1 : residual.end_lineno]
    source = next((text for found in classes if (text := _constant("source", found, tree))), "")
    return Equation(f"{module}.{name}", textwrap.dedent("\n".join(lines)), source)


def _path_of(module: str) -> Path:
    """The file of a module of obseq.formulas."""
    spec = importlib.util.find_spec("obseq.formulas")
    if spec is None or spec.origin is None:
        raise FormulaError("obseq.formulas is not installed with obseq: equations cannot be shown")
    return Path(spec.origin).with_name(f"{module.rpartition('.')[2]}.py")


def _classes(tree: ast.Module, name: str) -> Iterator[ast.ClassDef]:
    """The class of that name, then those of its bases that the same file defines."""
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and node.name == name:
            yield node
            for base in node.bases:
                yield from _classes(tree, ast.unparse(base))


def _constant(name: str, scope: ast.ClassDef | ast.Module, module: ast.Module) -> str:
    """The text that a name stands for in a scope: directly, through the module, or imported by it."""
    for node in scope.body:
        if isinstance(node, ast.ImportFrom) and name in [alias.name for alias in node.names]:
            other = ast.parse(_text(_path_of(str(node.module))))
            return _constant(name, other, other)
        if isinstance(node, ast.Assign) and name in [ast.unparse(target) for target in node.targets]:
            if isinstance(node.value, ast.Name):
                return _constant(node.value.id, module, module)
            return str(ast.literal_eval(node.value))
    return ""


def _names(title: str, names: list[str]) -> Iterator[str]:
    if names:
        yield ""
        yield title
        yield textwrap.fill(", ".join(names), 100, initial_indent="  ", subsequent_indent="  ")


def _description(formula: "Kernel") -> str:
    return (formula.module.__doc__ or "").strip()


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")
