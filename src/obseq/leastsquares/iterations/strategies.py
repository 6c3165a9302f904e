"""How the iterations move: full steps, damped ones, or steps kept within a radius."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from obseq.errors import InputError


@dataclass(frozen=True)
class GaussNewton:
    """Full steps of the normal equations; for systems whose start is close, as most networks are.

    Attributes:
        step: How a step is computed: "normal" equations; "qr" (orthogonal, dense) or "lsmr" (iterative) from
            the stacked rows, for ill-conditioned systems; "l1" for the least sum of absolute residuals.
    """

    step: str = "normal"

    def __post_init__(self) -> None:
        if self.step not in ("normal", "qr", "lsmr", "l1"):
            raise InputError(f"unknown step {self.step!r}; known: normal, qr, lsmr, l1")


@dataclass(frozen=True)
class LevenbergMarquardt:
    """Damped steps: N + damping * diag(N), the damping adapted to the gain of each step (Nielsen, 1999).

    A step that does not decrease the cost is taken back.

    Attributes:
        damping: First damping, as a share of the diagonal.
        constant: True for MMVII's: the damping stays, and every step is accepted.
    """

    damping: float = 1e-4
    constant: bool = False

    def __post_init__(self) -> None:
        if not 0.0 < self.damping < float("inf"):
            raise InputError(f"the damping must be positive and finite, not {self.damping}")


@dataclass(frozen=True)
class Dogleg:
    """Steps between the steepest descent and Gauss-Newton, within a radius adapted to their gain (Powell).

    The radius is in the metric of diag(N): standard deviations that unknowns would have alone. Not for
    systems with eliminated or constrained unknowns.

    Attributes:
        radius: First radius; None for the length of the first Gauss-Newton step.
    """

    radius: float | None = None


Strategy: TypeAlias = GaussNewton | LevenbergMarquardt | Dogleg

NAMES: dict[str, Strategy] = {
    "gauss-newton": GaussNewton(),
    "levenberg-marquardt": LevenbergMarquardt(),
    "dogleg": Dogleg(),
    "qr": GaussNewton("qr"),
    "lsmr": GaussNewton("lsmr"),
    "l1": GaussNewton("l1"),
}
"""The strategies that have a name, for those who give one."""


def strategy_of(given: str | Strategy) -> Strategy:
    """The strategy of a name, or the strategy itself."""
    if isinstance(given, GaussNewton | LevenbergMarquardt | Dogleg):
        return given
    if not isinstance(given, str) or given not in NAMES:
        raise InputError(f"unknown strategy {given!r}; known: {', '.join(NAMES)}")
    return NAMES[given]
