"""The stages of gencode: formula -> graph and derivatives -> kernels -> module text."""

import hashlib
from dataclasses import dataclass
from typing import NamedTuple

from obseq.codegen.counting import operations
from obseq.codegen.differentiate import Jacobian, directional, jacobians
from obseq.codegen.graph import Graph
from obseq.codegen.printing import Printer, Store, row_place
from obseq.codegen.products import share_products
from obseq.codegen.signs import share_signs
from obseq.codegen.stages import parked
from obseq.codegen.terms import collect_terms
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
    jacobian = share_signs(graph, residuals, jacobian)
    outputs = [*residuals, *(node for row in jacobian for node in row)]
    writings = [outputs, *share_products(graph, outputs)]
    writings += [collect_terms(graph, writing) for writing in writings]
    count, most = len(residuals), operations(graph, residuals)
    fitting = [writing for writing in writings if operations(graph, writing[:count]) <= most]
    best = min(fitting, key=lambda writing: operations(graph, writing))
    cheapest = iter(best)
    residuals = [next(cheapest) for _ in residuals]
    return Derived(formula, graph, residuals, [[next(cheapest) for _ in row] for row in jacobian], digest)


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
    name: str, rows_name: str, rows: _Rows, graph: Graph, scalars: list[str], outputs: list[Output]
) -> KernelText:
    """The text of a kernel: one loop, or two where that is faster."""
    printer = Printer(graph, {scalar: row_place(row) for row, scalar in enumerate(scalars)})
    kept = parked(graph, [(output.node, output.row) for output in outputs])
    places = {node: row_place(row) for node, row in kept.items()}
    loops = [printer.loop([Store(node, place, PARKED) for node, place in places.items()])] if kept else []
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


def residual_names(derived: Derived) -> tuple[str, ...]:
    """Names of the residuals: the formula's, else the measured values' if they match, else numbered."""
    if derived.formula.outputs:
        return derived.formula.outputs
    measured, count = derived.formula.measured, len(derived.residuals)
    if len(measured) == count:
        return measured
    return ("residual",) if count == 1 else tuple(f"residual_{k}" for k in range(count))


def operation_counts(derived: Derived) -> tuple[int, int]:
    """Operations of the value kernel and of the kernel with derivatives."""
    return operations(derived.graph, derived.residuals), operations(derived.graph, derived.outputs)
