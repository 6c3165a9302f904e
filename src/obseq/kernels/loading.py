"""Loading a generated module: its description at once, its compiled kernels when they are first asked for."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable
from types import ModuleType

from obseq.cached import cached_property
from obseq.compilation.digests import CONTRACT, Function
from obseq.compilation.routines import Routine
from obseq.compilation.signatures import KERNEL
from obseq.dataclass import dataclass
from obseq.errors import FormulaError, nearest
from obseq.kernels import index, ondemand, provenance
from obseq.kernels.layout import Block, Input


@dataclass(frozen=True)
class Kernel:
    """A generated formula: names, blocks, tile layout, and the addresses of its compiled kernels.

    Attributes:
        name: Name of the formula.
        unknowns: Names of the unknowns.
        observations: Names of the observations, context of the unknown blocks included.
        residuals: Names of the residuals.
        blocks: Atomic unknown blocks, contiguous, in the order of the unknowns.
        measured: Indices of the observations that are not context: what is given per observation.
        inputs: The same, argument by argument, with units.
        equation: The equation in plain text, a definition or a residual per line.
        source: Where the equation comes from.
        typical: (centre, half width) of scalars for random checks.
        constant_jacobian: (residual, unknown, value) of the entries that kernels do not write.
        value_rows: Rows of a tile of the value kernel.
        rows: Rows of a tile of the kernel with derivatives.
        module: The generated module.
    """

    name: str
    unknowns: tuple[str, ...]
    observations: tuple[str, ...]
    residuals: tuple[str, ...]
    blocks: tuple[Block, ...]
    measured: tuple[int, ...]
    inputs: tuple[Input, ...]
    equation: str
    source: str
    typical: dict[str, tuple[float, float]]
    constant_jacobian: tuple[tuple[int, int, float], ...]
    value_rows: int
    rows: int
    module: ModuleType

    def __reduce__(self) -> tuple[Callable[..., Kernel], tuple[str, ...]]:
        """By its name where that gives it, else by the text of its module."""
        if ondemand.TEXT in self.module.__dict__:
            return _of_text, (self.name, self.module.__dict__[ondemand.TEXT])
        return load, (self.name,)

    @property
    def first_result(self) -> int:
        """Row of the first residual in a tile."""
        return len(self.unknowns) + len(self.observations)

    @cached_property
    def constant_rows(self) -> tuple[tuple[int, float], ...]:
        """(row of a tile, value) of the constant entries of the Jacobian."""
        first = self.first_result + len(self.residuals)
        return tuple((first + i * len(self.unknowns) + j, value) for i, j, value in self.constant_jacobian)

    @property
    def directional_rows(self) -> int:
        """Rows of a tile of the kernel with derivatives along a direction."""
        return self.first_result + len(self.unknowns) + 2 * len(self.residuals)

    @property
    def value_address(self) -> int:
        """Address of the compiled value kernel; found or compiled at the first call."""
        return routine(self.module, "value").address

    @property
    def value_and_jacobian_address(self) -> int:
        """Address of the compiled kernel of values and derivatives."""
        return routine(self.module, "value_and_jacobian").address

    @property
    def directional_address(self) -> int:
        """Address of the compiled kernel of values and derivatives along a direction; 0 where there is none.

        Modules made on demand have it; for a generated formula one is made, where the generator is installed.
        """
        module = self.module if hasattr(self.module, "directional") else ondemand.find(self.name)
        return routine(module, "directional").address if module else 0


def formula_names() -> tuple[str, ...]:
    """Names of all generated formulas, those of other packages too, sorted."""
    return tuple(sorted({**index.own(), **index.registered()}))


@functools.cache
def load(name: str) -> Kernel:
    """The formula of that name; nothing is compiled yet.

    A member of a family that is not among the generated modules is built on demand (see `ondemand`). A kernel
    that is older than its formula is told, once, where the formula is at hand.

    Raises:
        FormulaError: No formula has that name; the message gives close ones.
    """
    if place := index.place(name):
        provenance.tell(name)
        return describe(importlib.import_module(place.module))
    module = ondemand.find(name)
    if module is None:
        raise FormulaError(_unknown(name))
    return describe(module)


def _of_text(name: str, text: str) -> Kernel:
    return describe(ondemand.in_memory(name, text))


def _unknown(name: str) -> str:
    message = f"no formula is named {nearest(name, formula_names())}."
    if ondemand.can_build():
        return message + " `gencode --list` gives those of the registry; of a family, any degrees will do."
    return message + (
        " If it is another member of a family, it can be built where the generator is installed:"
        ' pip install "obseq[gencode]"'
    )


def describe(module: ModuleType) -> Kernel:
    """The kernel that a generated module describes."""
    return Kernel(
        name=module.NAME,
        unknowns=module.UNKNOWNS,
        observations=module.OBSERVATIONS,
        residuals=module.RESIDUALS,
        blocks=module.BLOCKS,
        measured=module.MEASURED,
        inputs=module.INPUTS,
        equation=module.EQUATION,
        source=module.SOURCE,
        typical=module.TYPICAL,
        constant_jacobian=module.CONSTANT_JACOBIAN,
        value_rows=module.VALUE_ROWS,
        rows=module.ROWS,
        module=module,
    )


@functools.cache
def routine(module: ModuleType, function: str) -> Routine:
    """The machine code of one kernel of a generated module."""
    return Routine(Function(getattr(module, function), CONTRACT), KERNEL)
