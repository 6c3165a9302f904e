"""Observations between points that stand beside or above their marks: any equation of a target, composed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from obseq.cached import cached_property
from obseq.formulas.base import Argument, Formula
from obseq.formulas.blocks import Point3
from obseq.formulas.functions import Scalar
from obseq.formulas.naming import Registered
from obseq.formulas.special_topography import TopoAlpha, TopoBeta
from obseq.formulas.topography import (
    TopoDist,
    TopoDistHz,
    TopoDX,
    TopoDY,
    TopoDZ,
    TopoHz,
    TopoZen,
)

SIGHTS = (
    TopoHz(),
    TopoZen(),
    TopoDist(),
    TopoDX(),
    TopoDY(),
    TopoDZ(),
    TopoDistHz(),
    TopoAlpha(),
    TopoBeta(),
)
"""The registered equations whose instrument and target have heights."""


@dataclass(frozen=True)
class Beside(Formula):
    """An observation between two points that stand beside or above their marks.

    Residual: that of the observation with the target moved by `off`: the offset of the target (its height
    along its vertical) minus that of the instrument, in the frame of the points. Undefined where that is.

    Attributes:
        observed: The equation of the observation; its second unknown is the target.
    """

    pattern = "{observed}Off"
    observed: Annotated[Formula, Registered(SIGHTS)]

    @cached_property
    def arguments(self) -> tuple[Argument, ...]:
        """Those of the observation, with the offset before what is measured."""
        unknowns = tuple(argument for argument in self.observed.arguments if argument.is_unknown)
        measured = self.observed.arguments[len(unknowns) :]
        return (*unknowns, Argument("offset", False, Point3.declare(["off"], self)), *measured)

    @property
    def source(self) -> str:  # type: ignore[override]  # of each member
        """Where the equation comes from."""
        return f"{self.observed.name} with heights of instrument and target"

    @property
    def typical(self) -> Mapping[str, tuple[float, float]]:  # type: ignore[override]  # of each member
        """Where the equation lives."""
        return self.observed.typical

    def residual(self, origin: Any, target: Point3, *, offset: Point3, **measured: Any) -> Scalar:
        """What the observation gives for the moved target, minus what was observed."""
        found: Scalar = self.observed.residual(origin, target + offset, **measured)
        return found


BESIDE = tuple(map(Beside, SIGHTS))
