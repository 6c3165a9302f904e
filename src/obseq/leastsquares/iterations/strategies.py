"""How the iterations move: full steps, damped ones, or steps kept within a radius."""

from __future__ import annotations

from typing import TypeAlias

from obseq.dataclass import dataclass
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
class Controlled:
    """Gauss-Newton whose steps are held back where they would raise the cost: Gauss-Newton itself elsewhere.

    A full step that lowers the cost is taken; one that does not is damped until it does.
    """


@dataclass(frozen=True)
class LevenbergMarquardt:
    """Steps kept within a radius by the least damping that does: N + damping * diag(N) (Moré, 1978).

    For starts that are far off: a step that does not decrease the cost is taken back. A free network is
    solved as it is; its defect counts in the redundancy.

    Attributes:
        damping: First damping, as a share of the diagonal; None: the first step changes the unknowns by no
            more than they are large, unless it is as good as promised.
        constant: True for MMVII's: the damping stays, 1e-4 when None, and every step is accepted.
    """

    damping: float | None = None
    constant: bool = False

    def __post_init__(self) -> None:
        if self.damping is not None and not 0.0 < self.damping < float("inf"):
            raise InputError(f"the damping must be positive and finite, not {self.damping}")

    @property
    def share(self) -> float:
        """The damping that stays, of those whose damping does."""
        return 1e-4 if self.damping is None else self.damping


@dataclass(frozen=True)
class Dogleg:
    """Steps between the steepest descent and Gauss-Newton, within a radius adapted to their gain (Powell).

    The radius is in the metric of diag(N): standard deviations that unknowns would have alone. Not for
    systems with eliminated or constrained unknowns.

    Attributes:
        radius: First radius; None: as of `LevenbergMarquardt`.
    """

    radius: float | None = None

    def __post_init__(self) -> None:
        if self.radius is not None and not self.radius > 0.0:
            raise InputError(f"the radius must be positive, not {self.radius}")


Strategy: TypeAlias = GaussNewton | Controlled | LevenbergMarquardt | Dogleg

NAMES: dict[str, Strategy] = {
    "gauss-newton": GaussNewton(),
    "controlled": Controlled(),
    "levenberg-marquardt": LevenbergMarquardt(),
    "dogleg": Dogleg(),
    "qr": GaussNewton("qr"),
    "lsmr": GaussNewton("lsmr"),
    "l1": GaussNewton("l1"),
}
"""The strategies that have a name, for those who give one."""


def strategy_of(given: str | Strategy) -> Strategy:
    """The strategy of a name, or the strategy itself."""
    if isinstance(given, Strategy):
        return given
    if not isinstance(given, str) or given not in NAMES:
        raise InputError(f"unknown strategy {given!r}; known: {', '.join(NAMES)}")
    return NAMES[given]
