"""What blocks declare of themselves: their atoms, the names of their scalars, their units."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from obseq.formulas.functions import Scalar

WORLD_TO_LOCAL = "world to local"
"""Marks a pose or rotation whose context is its transposed matrix (MMVII pushes it by columns)."""


@dataclass(frozen=True)
class Atom:
    """An atomic block: scalars that are adjusted, frozen and updated together.

    Attributes:
        kind: `Point3`, `Point2`, `Rotation`, `Direction`, `Vector`, `Scalar`, or a kind of one's own.
        scalars: Names of its scalars.
        context: Names of its context values.
        part: What it is in a composite block (`centre`, `rotation`), else empty.
        transposed: True when the context holds the transposed matrix.
        unit: Unit of its scalars, for the documentation.
        meaning: What its context holds, for the documentation.
    """

    kind: str
    scalars: tuple[str, ...]
    context: tuple[str, ...] = ()
    part: str = ""
    transposed: bool = False
    unit: str = ""
    meaning: str = ""


@dataclass(frozen=True)
class Unit:
    """The unit of an argument when it is not its block's: `Annotated[Point2, "Im", Unit("pixel")]`."""

    name: str


@dataclass(frozen=True)
class Declaration:
    """What an argument of a formula is made of: its atomic blocks and how they become the argument.

    Attributes:
        atoms: Atomic blocks in the order of their scalars.
        build: Makes the argument from (scalars, context).
    """

    atoms: tuple[Atom, ...]
    build: Callable[[Sequence[Scalar], Sequence[Scalar]], Any]


def component_names(labels: Sequence[str], suffixes: Sequence[str]) -> tuple[str, ...]:
    """Names of components: one label is a prefix, as many labels as components are the names themselves.

    A label with `{}` is a pattern: `"p_{}_0"` gives `p_x_0`, `p_y_0`; the prefix `"p"` is short for `"p_{}"`.
    """
    if len(labels) == len(suffixes) and len(labels) > 1:
        return tuple(labels)
    (prefix,) = labels
    pattern = prefix if "{}" in prefix else f"{prefix}_{{}}"
    return tuple(pattern.format(suffix) for suffix in suffixes)


def matrix_names(prefix: str, columns: int = 3, rows: int = 3) -> tuple[str, ...]:
    """Names `prefix_column_row` of a matrix, row by row, as MMVII writes them; or those of a pattern."""
    return component_names((prefix,), [f"{column}_{row}" for row in range(rows) for column in range(columns)])
