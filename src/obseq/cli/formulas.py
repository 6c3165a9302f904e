"""`obseq formulas`: the list of formulas, or what there is to know of one."""

import argparse
import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from obseq.cli.parsing import Commands, add_command

if TYPE_CHECKING:
    from obseq.kernels import Kernel

MORE = """
Without a name: one line per formula. With a name: its equation, its unknowns and observations with
their units, and where it comes from; the name may be that of any member of a family."""

WIDTH = 100
NOTATION = {
    " ^ ": "a ^ b is the vector product",
    " . ": "a . b is the scalar product",
    "wrap(": "wrap() brings an angle to (-pi, pi]",
    "[": "[w]x is the matrix of the vector product by w",
    "s_1 =": "s_1, s_2, ... are parts that come several times",
}


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
    yield from ("", "equation", textwrap.indent(formula.equation.rstrip(), "  "))
    if notes := [note for sign, note in NOTATION.items() if sign in formula.equation]:
        yield from _filled(f"({'; '.join(notes)})")
    yield from ("", "unknowns")
    for block in formula.blocks:
        names = formula.unknowns[block.start : block.start + block.size]
        yield from _line(block.name, block.kind, block.unit, names)
    if formula.inputs:
        yield from ("", "observations")
    for given in formula.inputs:
        names = formula.observations[given.start : given.start + given.size]
        yield from _line(given.name, given.kind, given.unit, names)
    if blocks := [block for block in formula.blocks if block.context]:
        yield from ("", "context (current values of the unknowns, kept by obseq)")
        for block in blocks:
            kind = "transposed" if block.transposed else ""
            yield from _line(block.name, kind, "", formula.observations[slice(*(block.context or ()))])
    yield from ("", "residuals")
    yield from _filled(", ".join(formula.residuals) or "none")
    if formula.source:
        yield from ("", f"source: {formula.source}")


def _line(name: str, kind: str, unit: str, scalars: Sequence[str]) -> list[str]:
    head = f"  {name:<20} {kind:<10} {unit:<16} "
    return textwrap.wrap(", ".join(scalars), WIDTH, initial_indent=head, subsequent_indent=" " * len(head))


def _filled(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False)


def _description(formula: "Kernel") -> str:
    return (formula.module.__doc__ or "").strip()
