"""The stages of gencode: formula -> graph and derivatives -> kernels -> module text."""

import hashlib
from dataclasses import dataclass
from typing import NamedTuple

from obseq.codegen.counting import operations
from obseq.codegen.differentiate import Jacobian, jacobians
from obseq.codegen.graph import Graph
from obseq.codegen.printing import Printer, Store, row_place
from obseq.codegen.stages import parked
from obseq.codegen.translate import translate
from obseq.formulas.base import Formula

GENERATOR_VERSION = "1"

SHORTEST_LOOP = 12
"""Lines of a lane loop up to which LLVM must be kept from unrolling it before it is vectorised."""

PARKED = "what takes long, parked in rows of results"


@dataclass(frozen=True)
class Derived:
    """A formula with the graph of its residuals and of its Jacobian.

    Attributes:
        formula: The formula.
        graph: The graph of everything.
        residuals: Nodes of the residuals.
        jacobian: Nodes of the Jacobian, a row per residual.
        digest: Hash of the mathematics.
    """

    formula: Formula
    graph: Graph
    residuals: list[int]
    jacobian: Jacobian
    digest: str

    @property
    def outputs(self) -> list[int]:
        """All nodes computed by the kernel of values and derivatives."""
        return [*self.residuals, *(node for row in self.jacobian for node in row)]

    def constant_entries(self) -> list[tuple[int, int, float]]:
        """(residual, unknown, value) of the entries of the Jacobian that never change."""
        return [
            (i, j, value)
            for i, row in enumerate(self.jacobian)
            for j, node in enumerate(row)
            if (value := self.graph.constant_value(node)) is not None
        ]


@dataclass(frozen=True)
class KernelText:
    """The text of one kernel: its name, its documentation, the bodies of its lane loops, what it calls."""

    name: str
    doc: str
    rows_name: str
    loops: list[list[str]]
    functions: set[str]


class Output(NamedTuple):
    """A result of a kernel: its node, its row in the tile, what it is."""

    node: int
    row: int
    comment: str = ""


def derive(formula: Formula) -> Derived:
    """The graph of a formula and its derivatives, worked out in the cheapest order."""
    graph, residuals = translate(formula)
    digest = mathematics_hash(formula, graph, residuals)
    candidates = jacobians(graph, residuals, formula.unknowns, formula.name)
    graph, jacobian = min(candidates, key=lambda candidate: _cost(candidate[0], candidate[1], residuals))
    return Derived(formula, graph, residuals, jacobian, digest)


def _cost(graph: Graph, jacobian: Jacobian, residuals: list[int]) -> int:
    """Operations of the residuals and of a Jacobian together."""
    return operations(graph, [*residuals, *(node for row in jacobian for node in row)])


def mathematics_hash(formula: Formula, graph: Graph, residuals: list[int]) -> str:
    """Hash of names, residual expressions and generator version: comments and layout do not count."""
    order = graph.reachable(residuals)
    position = {node: k for k, node in enumerate(order)}
    content: list[object] = [GENERATOR_VERSION, formula.name, formula.unknowns, formula.observations]
    content += [
        (node.operator, tuple(position[operand] for operand in node.operands), node.value)
        for node in (graph.nodes[number] for number in order)
    ]
    content.append([position[residual] for residual in residuals])
    return hashlib.sha256(repr(content).encode()).hexdigest()[:16]


def value_kernel(derived: Derived) -> KernelText:
    """The kernel that computes the residuals alone."""
    outputs = [Output(node, row) for row, node in enumerate(derived.residuals, _first_result(derived))]
    doc = f"Rows of each tile: {_rows_text(derived, False)}; one lane per observation."
    return _kernel(derived, "value", doc, "VALUE_ROWS", outputs)


def jacobian_kernel(derived: Derived) -> KernelText:
    """The kernel that computes residuals and Jacobian; constant entries of the Jacobian are not stored."""
    first = _first_result(derived)
    outputs = [Output(node, row, "residuals") for row, node in enumerate(derived.residuals, first)]
    entries = (node for row in derived.jacobian for node in row)
    outputs += [
        Output(node, row, "derivatives")
        for row, node in enumerate(entries, first + len(derived.residuals))
        if derived.graph.constant_value(node) is None
    ]
    doc = f"Rows of each tile: {_rows_text(derived, True)}; one lane per observation."
    return _kernel(derived, "value_and_jacobian", doc, "ROWS", outputs)


def _first_result(derived: Derived) -> int:
    return len(derived.formula.unknowns) + len(derived.formula.observations)


def _kernel(derived: Derived, name: str, doc: str, rows_name: str, outputs: list[Output]) -> KernelText:
    """The text of a kernel: one loop, or two where that is faster."""
    scalars = (*derived.formula.unknowns, *derived.formula.observations)
    printer = Printer(derived.graph, {scalar: row_place(row) for row, scalar in enumerate(scalars)})
    rows = parked(derived.graph, [(output.node, output.row) for output in outputs])
    places = {node: row_place(row) for node, row in rows.items()}
    loops = [printer.loop([Store(node, place, PARKED) for node, place in places.items()])] if rows else []
    stores = [
        Store(output.node, row_place(output.row), output.comment)
        for output in outputs
        if rows.get(output.node) != output.row
    ]
    loops.append(printer.loop(stores, places))
    if len(loops) == 1 and len(loops[0]) <= SHORTEST_LOOP:
        loops[0].insert(0, "keep_loop()")
        printer.functions.add("keep_loop")
    return KernelText(name, doc, rows_name, loops, printer.functions)


def _rows_text(derived: Derived, with_jacobian: bool) -> str:
    formula = derived.formula
    parts, first = [], 0
    sizes = [("unknowns", len(formula.unknowns)), ("observations", len(formula.observations))]
    sizes.append(("residuals", len(derived.residuals)))
    if with_jacobian:
        sizes.append(("Jacobian", len(derived.residuals) * len(formula.unknowns)))
    for label, size in sizes:
        if size:
            parts.append(f"{label} {first}" if size == 1 else f"{label} {first}-{first + size - 1}")
        first += size
    return ", ".join(parts)


def residual_names(derived: Derived) -> tuple[str, ...]:
    """Names of the residuals: the formula's, else those of the measured values if they match, else numbered."""
    if derived.formula.outputs:
        return derived.formula.outputs
    measured, count = derived.formula.measured, len(derived.residuals)
    if len(measured) == count:
        return measured
    return ("residual",) if count == 1 else tuple(f"residual_{k}" for k in range(count))


def operation_counts(derived: Derived) -> tuple[int, int]:
    """Operations of the value kernel and of the kernel with derivatives."""
    return operations(derived.graph, derived.residuals), operations(derived.graph, derived.outputs)
