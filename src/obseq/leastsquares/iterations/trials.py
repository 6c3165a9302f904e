"""Steps to try, and what they bring of what they promise."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.leastsquares.assembly.linearisation import Linearisation
from obseq.leastsquares.iterations.arrival import EPS

ROUNDED_COST = 16.0 * EPS
"""Share of the cost below which a promised decrease cannot be seen in it."""


@dataclass(frozen=True)
class Trial:
    """A step to try.

    Attributes:
        move: (n_scalars,) of all unknowns.
        length: its length in the metric of the (damped) normal matrix.
        norm: its length in the metric of the radius.
        promised: the decrease of the cost that the linearisation promises.
        is_full: whether it is the Gauss-Newton step.
        linearisation: the linearisation it comes from.
        share: how much of the way to hard constraints it goes.
    """

    move: FloatArray
    length: float
    norm: float
    promised: float
    is_full: bool
    linearisation: Linearisation
    share: float = 1.0


class Path(Protocol):
    """What differs between the methods: the step of a size.

    Attributes:
        radius: what the first step may have.
        first_radius: what a first step may have that is not nearly as good as promised; infinite for any.
        is_bold: whether full steps stay allowed as long as they descend, and no excursion is made.
        defect: number of parameters that the observations leave free.
    """

    radius: float
    first_radius: float
    is_bold: bool
    defect: int

    def linearise(self, in_passing: bool = False) -> None:
        """Assembles at the current values; `in_passing`, the metric of the radius learns nothing of them."""

    def within(self, radius: float) -> Trial:
        """The step of the last linearisation whose norm is at most (about) the radius."""

    def settle(self) -> None:
        """Counts the defect where the iterations have arrived."""

    def full(self) -> Trial:
        """The Gauss-Newton step of the last linearisation, or what comes closest where there is none."""


def scaled(trial: Trial, share: float) -> Trial:
    """A share of a step, for a sum of squares whose minimum lies there."""
    length, norm, promised = share * trial.length, share * trial.norm, share * trial.promised
    return replace(trial, move=share * trial.move, length=length, norm=norm, promised=promised)


def share_of(trial: Trial, cost: float, after: float) -> float:
    """Where the parabola through both costs with the slope at the start has its minimum: 0.1 to 0.5."""
    if not after < 100.0 * cost:
        return 0.1
    slope = 2.0 * trial.length**2
    return min(max(0.5 * slope / (after - cost + slope), 0.1), 0.5) if after > cost else 0.5


def gain_of(trial: Trial, cost: float, after: float) -> float:
    """Share of the promised decrease that came true; hard constraints that ask for a rise get their way."""
    if not np.isfinite(after):
        return -1.0
    if trial.promised <= 0.0:
        return 1.0 if trial.promised < -ROUNDED_COST * cost else 0.0
    return (cost - after) / trial.promised
