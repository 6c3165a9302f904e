"""The loops of kernels as text: of values, of values and derivatives, of derivatives along a direction."""

from dataclasses import dataclass
from typing import NamedTuple

from obseq.codegen.compiler import Derived
from obseq.codegen.graphs.differentiate import directional
from obseq.codegen.graphs.expression_graph import ExpressionGraph
from obseq.codegen.graphs.loop_fission import spilled
from obseq.codegen.printing import Printer, Store, row_place
from obseq.formulas.base import Formula

SHORTEST_LOOP = 12
"""Lines of a lane loop up to which LLVM must be kept from unrolling it before it is vectorised."""

SPILLED = "what takes long, kept in rows of results"


@dataclass(frozen=True)
class KernelText:
    """The text of one kernel.

    Attributes:
        name: Name of the function.
        doc: What the rows of a tile are.
        rows_name: Name of the number of rows of a tile in the module.
        rows: That number.
        loops: Bodies of its lane loops.
        functions: What they call.
    """

    name: str
    doc: str
    rows_name: str
    rows: int
    loops: list[list[str]]
    functions: set[str]


@dataclass(frozen=True)
class Printed:
    """A formula with the text of its kernels.

    Attributes:
        derived: The formula.
        kernels: Its kernels.
    """

    derived: Derived
    kernels: list[KernelText]

    @property
    def functions(self) -> set[str]:
        """What the kernels call."""
        return set().union(*(kernel.functions for kernel in self.kernels))

    def __str__(self) -> str:
        lengths = (" + ".join(str(len(loop)) for loop in kernel.loops) for kernel in self.kernels)
        return ", ".join(f"{k.name}: {n} lines" for k, n in zip(self.kernels, lengths, strict=True))


class Output(NamedTuple):
    """A result of a kernel: its node, its row in the tile, what it is."""

    node: int
    row: int
    comment: str = ""


def print_kernels(derived: Derived) -> Printed:
    """Prints the loops of the two kernels, each operation that is shared as one line."""
    return Printed(derived, [value_kernel(derived), jacobian_kernel(derived)])


def print_all_kernels(derived: Derived) -> Printed:
    """Prints these two and the one along a direction, which only modules made on demand have."""
    return Printed(derived, [*print_kernels(derived).kernels, directional_kernel(derived)])


def value_kernel(derived: Derived) -> KernelText:
    """The kernel that computes the residuals alone."""
    rows = _Rows.of(derived, residuals=len(derived.residuals))
    outputs = [Output(node, row) for row, node in enumerate(derived.residuals, rows.start("residuals"))]
    return _kernel("value", "VALUE_ROWS", rows, derived.graph, _scalars(derived), outputs)


def jacobian_kernel(derived: Derived) -> KernelText:
    """The kernel that computes residuals and Jacobian; constant entries of the Jacobian are not stored."""
    n_residuals = len(derived.residuals)
    rows = _Rows.of(derived, residuals=n_residuals, Jacobian=n_residuals * len(derived.formula.unknowns))
    outputs = [
        Output(node, row, "residuals") for row, node in enumerate(derived.residuals, rows.start("residuals"))
    ]
    entries = (node for row in derived.jacobian for node in row)
    outputs += [
        Output(node, row, "derivatives")
        for row, node in enumerate(entries, rows.start("Jacobian"))
        if derived.graph.constant_value(node) is None
    ]
    return _kernel("value_and_jacobian", "ROWS", rows, derived.graph, _scalars(derived), outputs)


def directional_kernel(derived: Derived) -> KernelText:
    """The kernel that computes residuals and their derivatives along a direction of the unknowns."""
    formula, n_residuals = derived.formula, len(derived.residuals)
    components = _direction_names(formula)
    directions = dict(zip(formula.unknowns, components, strict=True))
    graph, derivatives = directional(derived.graph, derived.residuals, directions, formula.name)
    rows = _Rows.of(derived, direction=len(components), residuals=n_residuals, derivatives=n_residuals)
    outputs = [
        Output(node, row, "residuals") for row, node in enumerate(derived.residuals, rows.start("residuals"))
    ]
    outputs += [
        Output(node, row, "derivatives along the direction")
        for row, node in enumerate(derivatives, rows.start("derivatives"))
    ]
    scalars = [*_scalars(derived), *components]
    return _kernel("directional", "DIRECTIONAL_ROWS", rows, graph, scalars, outputs)


def _scalars(derived: Derived) -> list[str]:
    return [*derived.formula.unknowns, *derived.formula.observations]


def _direction_names(formula: Formula) -> list[str]:
    """A name for each component of a direction, that no scalar of the formula has."""
    taken = {*formula.unknowns, *formula.observations}
    prefix = "d"
    while any(f"{prefix}_{name}" in taken for name in formula.unknowns):
        prefix += "d"
    return [f"{prefix}_{name}" for name in formula.unknowns]


class _Rows(dict[str, int]):
    """What the rows of a tile hold, and how many rows each takes, in order."""

    @classmethod
    def of(cls, derived: Derived, **results: int) -> "_Rows":
        formula = derived.formula
        return cls(unknowns=len(formula.unknowns), observations=len(formula.observations), **results)

    def start(self, label: str) -> int:
        """The first row of a part."""
        return sum(list(self.values())[: list(self).index(label)])

    def __str__(self) -> str:
        parts = ((label, self.start(label), size) for label, size in self.items() if size)
        return ", ".join(
            f"{label} {first}" if size == 1 else f"{label} {first}-{first + size - 1}"
            for label, first, size in parts
        )


def _kernel(
    name: str, rows_name: str, rows: _Rows, graph: ExpressionGraph, scalars: list[str], outputs: list[Output]
) -> KernelText:
    """The text of a kernel: one loop, or two where that is faster."""
    printer = Printer(graph, {scalar: row_place(row) for row, scalar in enumerate(scalars)})
    kept = spilled(graph, [(output.node, output.row) for output in outputs])
    places = {node: row_place(row) for node, row in kept.items()}
    loops = [printer.loop([Store(node, place, SPILLED) for node, place in places.items()])] if kept else []
    stores = [
        Store(output.node, row_place(output.row), output.comment)
        for output in outputs
        if kept.get(output.node) != output.row
    ]
    loops.append(printer.loop(stores, places))
    if len(loops) == 1 and len(loops[0]) <= SHORTEST_LOOP:
        loops[0].insert(0, "keep_loop()")
        printer.functions.add("keep_loop")
    doc = f"Rows of each tile: {rows}; one lane per observation."
    return KernelText(name, doc, rows_name, sum(rows.values()), loops, printer.functions)
