"""Camera models of one's own: two formulas, compiled, that the catalogue does not have."""

from __future__ import annotations

from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.kernels import Calculator
from obseq.kernels.loading import Kernel

COLINEARITY_BLOCKS = ("point", "camera.centre", "camera.rotation", "calibration")
INTERIOR = ("F", "PPx", "PPy")


@dataclass(frozen=True)
class CameraModel:
    """A distortion of one's own, as a map of the plane and in the equation of colinearity.

    Attributes:
        distortion: two unknowns (a point of the plane), two values (the point distorted), the coefficients as
            observations.
        colinearity: the blocks and observations of `obseq.formulas.colinearity.Colinearity`, its calibration
            being `F_`, `PPx_`, `PPy_` and the coefficients, of the same names and in the same order.
    """

    distortion: Kernel
    colinearity: Kernel

    def __post_init__(self) -> None:
        plane, equation = self.distortion, self.colinearity
        if len(plane.unknowns) != 2 or len(plane.residuals) != 2:
            raise InputError(f"camera model: {plane.name} is no map of the plane: two unknowns, two values")
        blocks = [block.name for block in equation.blocks]
        if sorted(blocks) != sorted(COLINEARITY_BLOCKS):
            raise InputError(
                f"camera model: {equation.name} has the blocks {', '.join(blocks)}; a colinearity has "
                f"{', '.join(COLINEARITY_BLOCKS)}"
            )
        own = equation.unknowns[-len(INTERIOR) - len(self.coefficient_names) :]
        if own != ("F_", "PPx_", "PPy_", *self.coefficient_names):
            raise InputError(
                f"camera model: the calibration of {equation.name} ends with {', '.join(own)}; "
                f"{plane.name} has the coefficients {', '.join(self.coefficient_names) or '(none)'}"
            )

    @property
    def name(self) -> str:
        """Name of the equation."""
        return self.colinearity.name

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """Names of the coefficients."""
        return self.distortion.observations

    @cached_property
    def map(self) -> Calculator:
        """Evaluates the distortion."""
        return Calculator(self.distortion)
