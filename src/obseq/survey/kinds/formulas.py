"""A kind of observation for any formula of points: one of the catalogue, or one of the user's."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.kernels import Kernel
from obseq.survey.kinds.kind import ObservationKind, Site

MOST_POINTS = 3
UNITS = ("m", "rad")
"""What the value of a formula may be in."""


@dataclass(frozen=True)
class FormulaKind(ObservationKind):
    """Observations of a formula whose unknowns are points, as its signature says.

    Attributes:
        kernel: The formula.
        roles: What the formula calls its points.
        numbers: What it calls the numbers that are given with each observation; the last is the value.
    """

    kernel: Kernel | None = field(default=None, compare=False, repr=False)
    roles: tuple[str, ...] = ()
    numbers: tuple[str, ...] = ()

    def equation(self, suffix: str) -> str | Kernel:
        """Its formula, which has no variants."""
        return self.kernel or self.formula

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """Its points, by their roles."""
        ends = (*site.ends(rows), site.backsights(rows))
        return dict(zip(self.roles, ends, strict=False))

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, k) the numbers before the value."""
        return site.numbers(rows, max(len(self.numbers) - 1, 0))

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) values; (n, 0) of a formula that takes none."""
        return site.measured(rows) if self.numbers else np.zeros((len(rows), 0))


def kind_of(kernel: Kernel, code: int) -> FormulaKind:
    """The kind of observations of a formula.

    Raises:
        InputError: It has unknowns other than one to three points, or not one residual in metres or radians.
    """
    problem = _problem(kernel)
    if problem is not None:
        raise InputError(f"formula {kernel.name}: {problem}")
    roles = tuple(block.name for block in kernel.blocks)
    return FormulaKind(
        kernel.name,
        code,
        f"observation of {kernel.name}",
        kernel.name,
        is_angle=_unit(kernel) == "rad",
        is_absolute=len(roles) == 1,
        kernel=kernel,
        roles=roles,
        numbers=tuple(kernel.observations[k] for k in kernel.measured),
    )


def _unit(kernel: Kernel) -> str:
    """Unit of the value; of what takes none, metres."""
    return kernel.inputs[-1].unit if kernel.inputs else "m"


def _problem(kernel: Kernel) -> str | None:
    """Why observations of a survey network cannot have this formula, in words."""
    others = [f"{block.name} ({block.kind})" for block in kernel.blocks if block.kind != "Point3"]
    if others:
        return f"its unknown {others[0]} is no point of a network; only points in space can be named"
    if not 1 <= len(kernel.blocks) <= MOST_POINTS:
        return f"it has {len(kernel.blocks)} points; 1 to {MOST_POINTS} can be named"
    if len(kernel.residuals) != 1:
        return f"it has {len(kernel.residuals)} residuals; one is needed"
    if _unit(kernel) not in UNITS:
        return "its last value is neither a length nor an angle; annotate it as Length or Angle"
    return None
