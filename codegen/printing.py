"""From a graph to the Python lines of a kernel: loads, named intermediate values, stores."""

import keyword
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from obseq.codegen.graphs.expression_graph import COMMUTATIVE, CONSTANT, INPUT, ExpressionGraph
from obseq.codegen.operators import OPERATORS

NOTHING: Mapping[int, str] = MappingProxyType({})
LONGEST_EXPRESSION = 80
"""Characters beyond which an expression is cut, and its parts get names of their own."""

SUM, PRODUCT, SIGN, ATOM = range(4)
PRECEDENCE = {"add": SUM, "sub": SUM, "mul": PRODUCT, "rcp": PRODUCT, "neg": SIGN}


@dataclass(frozen=True)
class Dialect:
    """How a language writes what a kernel is made of.

    Attributes:
        definition: Text that gives a name to an expression.
        store: Text that puts an expression in a place.
        comment: Text of a comment.
        reserved: Words that no name may take.
    """

    definition: str
    store: str
    comment: str
    reserved: frozenset[str]


PYTHON = Dialect(
    "{} = {}",
    "{} = {}",
    "# {}",
    frozenset({*keyword.kwlist, "tiles", "n_tiles", "tile", "at", "lane", "k", "range", "LANES", "STRIDE"}),
)


@dataclass(frozen=True)
class Store:
    """An output of a kernel: the node, the place where it goes, what it is (for a comment)."""

    node: int
    place: str
    comment: str = ""


@dataclass
class Printer:
    """Prints the operations that some stores need, every shared node as one assignment.

    A kernel may be several loops; the names of nodes are the same in all of them.

    Attributes:
        graph: The graph.
        places: Name of every input, and the place that it is read from, in the order of the loads.
        dialect: The language.
        functions: The functions called so far.
    """

    graph: ExpressionGraph
    places: dict[str, str]
    dialect: Dialect = PYTHON
    functions: set[str] = field(default_factory=set)
    _lines: list[str] = field(default_factory=list)
    _names: dict[int, str] = field(default_factory=dict)
    _inputs: dict[str, str] = field(default_factory=dict)
    _text: dict[int, str] = field(default_factory=dict)
    _taken: set[str] = field(default_factory=lambda: set(OPERATORS))
    _uses: Counter[int] = field(default_factory=Counter)
    _temporaries: int = 0

    def __post_init__(self) -> None:
        self._taken |= self.dialect.reserved
        self._inputs = {name: self._free_name(name) for name in self.places}

    def loop(self, stores: list[Store], spilled: Mapping[int, str] = NOTHING) -> list[str]:
        """The lines of a loop's body: loads of what it needs, operations, stores.

        Args:
            stores: The outputs.
            spilled: Nodes that an earlier loop computed, and the places where it left them.
        """
        outputs = [store.node for store in stores]
        nodes = self.graph.reachable(outputs, spilled)
        computed = [node for node in nodes if node not in spilled]
        self._lines, self._text = [], {}
        self._uses = Counter(operand for node in computed for operand in self.graph.nodes[node].operands)
        self._uses.update(outputs)
        self._load(nodes, spilled)
        comment = ""
        for store in stores:
            if store.comment != comment:
                comment = store.comment
                self._lines.append(self.dialect.comment.format(comment))
            self._lines.append(self.dialect.store.format(store.place, self._expression(store.node)[0]))
        return self._lines

    def _load(self, nodes: list[int], spilled: Mapping[int, str]) -> None:
        """One line per input used, in the order of the places, then one per spilled value."""
        inputs = {str(self.graph.nodes[n].value): n for n in nodes if self.graph.nodes[n].operator == INPUT}
        for name, place in self.places.items():
            if name in inputs:
                self._text[inputs[name]] = self._inputs[name]
                self._lines.append(self.dialect.definition.format(self._inputs[name], place))
        for node, place in spilled.items():
            if node in nodes:
                self._define(node, place)

    def _free_name(self, wanted: str) -> str:
        while wanted in self._taken:
            wanted += "_"
        self._taken.add(wanted)
        return wanted

    def _temporary(self) -> str:
        self._temporaries += 1
        return self._free_name(f"t{self._temporaries}")

    def _define(self, node: int, expression: str) -> str:
        """A line that gives a node its name, in this loop."""
        if node not in self._names:
            name = self.graph.names.get(node)
            self._names[node] = self._free_name(name) if name else self._temporary()
        self._text[node] = self._names[node]
        self._lines.append(self.dialect.definition.format(self._text[node], expression))
        return self._text[node]

    def _expression(self, node: int) -> tuple[str, int]:
        """(text, precedence) of a node; a shared or named node is assigned on the way."""
        if node in self._text:
            return self._text[node], ATOM
        operator, operands, value = self.graph.nodes[node]
        if operator == CONSTANT:
            return repr(float(value)), ATOM if float(value) >= 0 else SIGN
        text, precedence = self._operation(operator, operands)
        if self._uses[node] > 1 or node in self.graph.names:
            return self._define(node, text), ATOM
        return text, precedence

    def _operation(self, operator: str, operands: tuple[int, ...]) -> tuple[str, int]:
        if operator == "mul" and (quotient := self._quotient(operands)):
            return quotient, PRODUCT
        if OPERATORS[operator].function:
            self.functions.add(OPERATORS[operator].function)
        precedence = PRECEDENCE.get(operator, ATOM)
        if operator in COMMUTATIVE:
            operands = self._constant_first(operands)
        parts = [self._expression(operand) for operand in operands]
        texts = []
        for position, (operand, (text, inner)) in enumerate(zip(operands, parts, strict=True)):
            if len(text) > LONGEST_EXPRESSION // len(operands):
                text, inner = self._define(operand, text), ATOM
            leads = position == 0 and len(operands) > 1
            tight = inner < precedence or (inner in (precedence, SIGN) and not leads)
            texts.append(f"({text})" if tight and precedence != ATOM else text)
        return OPERATORS[operator].symbol.format(*texts), precedence

    def _constant_first(self, operands: tuple[int, ...]) -> tuple[int, ...]:
        a, b = operands
        return (b, a) if self.graph.nodes[b].operator == CONSTANT else (a, b)

    def _quotient(self, operands: tuple[int, ...]) -> str:
        """The product a (1/b) as a / b when nothing else uses 1/b; empty when it is not one."""
        for numerator, inverse in (operands, operands[::-1]):
            node = self.graph.nodes[inverse]
            if node.operator == "rcp" and self._uses[inverse] == 1 and inverse not in self._text:
                (top, outer), (bottom, inner) = (
                    self._expression(numerator),
                    self._expression(node.operands[0]),
                )
                if len(top) > LONGEST_EXPRESSION // 2:
                    top, outer = self._define(numerator, top), ATOM
                if len(bottom) > LONGEST_EXPRESSION // 2:
                    bottom, inner = self._define(node.operands[0], bottom), ATOM
                top = f"({top})" if outer in (SUM, SIGN) else top
                return f"{top} / {bottom}" if inner == ATOM else f"{top} / ({bottom})"
        return ""


def row_place(row: int) -> str:
    """Where the scalar of a row lies, for the lane of the loop."""
    return "tiles[at]" if row == 0 else f"tiles[at + {row} * STRIDE]"
