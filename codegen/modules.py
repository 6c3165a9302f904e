"""Texts of the files that gencode writes: one module per formula, the index, the report."""

import inspect
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from obseq.codegen.compiler import Derived
from obseq.codegen.dependencies import functions_hash
from obseq.codegen.equations.documentation import equation_text, inputs
from obseq.codegen.kernel_text import Printed
from obseq.codegen.templating import template
from obseq.errors import FormulaError
from obseq.formulas.base import Formula
from obseq.module_texts import PENDING, formula_files, sources_hash, text_hash

WIDTH = 110
FROM_MATH = frozenset({"sqrt"})
REPORT = "REPORT.md"
COUNTS = re.compile(r"^\| `(\w+)` \|(?: \d+ \|){3} (\d+) \| (\d+) \|", re.MULTILINE)
"""Name and operations of a line of the report."""

ORIGINAL_OPERATIONS = {
    "Dist3D": 26,
    "TopoHz": 145,
    "EqColinearityCamPPC_Stenope_Dist_Rad3_Dec1_XY1": 639,
    "BlocRigid": 954,
}
"""Operations of MMVII's generated code for value and Jacobian, counted in it."""


@dataclass(frozen=True)
class Module:
    """A generated module.

    Attributes:
        formula: The formula.
        residuals: Names of its residuals.
        family: Name of the folder where it is, that of the module of the formula.
        module: Name of the module.
        text: Its text.
        report: Its line of the report.
    """

    formula: Formula
    residuals: tuple[str, ...]
    family: str
    module: str
    text: str
    report: dict[str, object]

    def __str__(self) -> str:
        return f"{self.family}/{self.module}.py, {len(self.text)} characters"


def module_name(formula_name: str) -> str:
    """The snake case of a formula's name: `TopoHz` gives `topo_hz`, `Dist3D` gives `dist3d`."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Za-z0-9])(?=[A-Z][a-z])", "_", formula_name)
    return re.sub("_+", "_", spaced).lower()


def render(printed: Printed) -> Module:
    """Writes the module: its names, its equation, its kernels, and the hashes of all three."""
    derived = printed.derived
    formula, residuals = derived.formula, derived.residual_names
    pending = template("module.py.jinja").render(_context(printed))
    text = pending.replace(f"text sha256:{PENDING}", f"text sha256:{text_hash(pending)}", 1)
    family = type(formula).__module__.rpartition(".")[2]
    return Module(formula, residuals, family, module_name(formula.name), text, _report(derived))


def render_index(modules: Iterable[tuple[str, str]], package: str) -> str:
    """The index: (formula name, module name) of everything generated; the hash of the equations' files."""
    sources = sources_hash(formula_files(package))
    return template("index.py.jinja").render(modules=sorted(modules), sources=sources, package=package)


def render_family(package: str, family: str) -> str:
    """The package of the modules of a family of formulas."""
    return template("family.py.jinja").render(package=package, module=f"{package}.formulas.{family}")


def render_report(rows: Iterable[dict[str, object]]) -> str:
    """The report of operations, one line per formula."""
    return template("report.md.jinja").render(rows=sorted(rows, key=lambda row: str(row["name"])))


def recorded_operations(report: str) -> dict[str, tuple[int, int]]:
    """Operations by formula, of value and of value and Jacobian, that a report records."""
    return {name: (int(value), int(both)) for name, value, both in COUNTS.findall(report)}


def _context(printed: Printed) -> dict[str, object]:
    derived, called = printed.derived, sorted(printed.functions)
    formula = derived.formula
    return {
        "origin": f"{type(formula).__module__}.{type(formula).__qualname__}",
        "formula_hash": derived.digest,
        "text_hash": PENDING,
        "functions_hash": functions_hash(called),
        "doc": _documentation(formula),
        "mathematics": [name for name in called if name in FROM_MATH],
        "functions": [name for name in called if name not in FROM_MATH],
        "name": formula.name,
        "unknowns": _tuple([_quoted(name) for name in formula.unknowns]),
        "observations": _tuple([_quoted(name) for name in formula.observations]),
        "residuals": _tuple([_quoted(name) for name in derived.residual_names]),
        "blocks": _tuple(_blocks(formula), one_per_line=True),
        "measured": _tuple([str(formula.observations.index(name)) for name in formula.measured]),
        "inputs": _tuple(_inputs(formula), one_per_line=True),
        "equation": equation_text(formula, derived.residual_names),
        "source": formula.source,
        "typical": _typical(formula),
        "constants": _tuple([f"({i}, {j}, {value!r})" for i, j, value in derived.constant_entries()]),
        "operations": _tuple([str(count) for count in derived.counts]),
        "kernels": printed.kernels,
    }


def _documentation(formula: Formula) -> str:
    """The formula's own words, without the parameters of its family; one-line when they are."""
    paragraphs = inspect.cleandoc(type(formula).__doc__ or formula.name).split("\n\n")
    doc = "\n\n".join(part for part in paragraphs if not part.startswith("Attributes:"))
    return doc + "\n" if "\n" in doc else doc


def _blocks(formula: Formula) -> list[str]:
    texts, start = [], 0
    for name, atom in formula.atoms:
        text = f'Block("{name}", "{atom.kind}", {start}, {len(atom.scalars)}'
        if atom.context:
            first = formula.observations.index(atom.context[0])
            text += f", context=({first}, {first + len(atom.context)})"
        text += ", transposed=True" if atom.transposed else ""
        texts.append(text + (f', unit="{atom.unit}")' if atom.unit else ")"))
        start += len(atom.scalars)
    return texts


def _inputs(formula: Formula) -> list[str]:
    texts = []
    for name, atom in inputs(formula):
        first = formula.observations.index(atom.scalars[0])
        unit = f', "{atom.unit}"' if atom.unit else ""
        texts.append(f'Input("{name}", "{atom.kind}", {first}, {len(atom.scalars)}{unit})')
    return texts


def _typical(formula: Formula) -> str:
    """The typical values as a dictionary of scalar names to (centre, half width)."""
    scalars = {argument.name: argument.scalars for argument in formula.arguments}
    scalars |= {name: atom.scalars for name, atom in formula.atoms}
    scalars |= {name: (name,) for name in (*formula.unknowns, *formula.observations)}
    if unknown := [name for name in formula.typical if name not in scalars]:
        raise FormulaError(f"{formula.name}: typical names nothing of the formula: {', '.join(unknown)}")
    typical = {scalar: interval for name, interval in formula.typical.items() for scalar in scalars[name]}
    items = [f'"{name}": {interval!r}' for name, interval in typical.items()]
    return "{" + _tuple(items)[1:-1].rstrip(",") + "}" if len(items) == 1 else "{" + _tuple(items)[1:-1] + "}"


def _quoted(name: str) -> str:
    return f'"{name}"'


def _tuple(items: Sequence[str], one_per_line: bool = False) -> str:
    """A tuple as the formatter would lay it out: on one line when it fits, else one item per line."""
    if len(items) == 1 and not one_per_line:
        return f"({items[0]},)"
    line = f"({', '.join(items)})"
    if (len(line) <= WIDTH - 25 and not one_per_line) or not items:
        return line
    return "(\n" + "".join(f"    {item},\n" for item in items) + ")"


def _report(derived: Derived) -> dict[str, object]:
    formula = derived.formula
    value_operations, all_operations = derived.counts
    entries = [derived.graph.constant_value(node) for row in derived.jacobian for node in row]
    return {
        "name": formula.name,
        "unknowns": len(formula.unknowns),
        "observations": len(formula.observations),
        "residuals": len(derived.residuals),
        "value_operations": value_operations,
        "operations": all_operations,
        "jacobian": len(entries),
        "original": ORIGINAL_OPERATIONS.get(formula.name, ""),
        "zeros": sum(value == 0.0 for value in entries),
    }
