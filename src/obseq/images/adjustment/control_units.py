"""Control points in another unit than the rest of a block, or than their own sigmas."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.images.initial.units import unit_of_control

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.adjustment.trials import Trials

FINE = 1e-6
"""Of the extent of the control points: sigmas below may be in another unit than coordinates."""
FACTORS = ((1000.0, "millimetres"), (100.0, "centimetres"))
MANY = 3.0
"""Times what larger sigmas of control points gain by chance, from which they are named."""
ABOUT = 1.8
"""Times which residuals may be larger or smaller than sigmas of the right unit."""


def control_unit(trials: Trials) -> str:
    """Control points in a unit that the rest of the block is not in, in words; empty where that is not so."""
    unit = unit_of_control(trials.block, trials.given)
    if unit is None:
        return ""
    factor, said = unit
    changed, control = trials.copy(), trials.block.control
    changed.control = replace(control, coordinates=control.coordinates / factor)
    found = trials.fitting(changed, f"control points divided by {factor:.6g}")
    if found is None:
        return ""
    return (
        f"the control points are {factor:.6g} times as large as the rest of the block says ({said}): divided "
        f"by that, {trials.falls(found)}"
    )


def control_sigmas(trials: Trials) -> str:
    """Sigmas of control points in another unit than their coordinates, in words; empty where they are not."""
    control = trials.block.control
    sigmas = control.sigmas[np.isfinite(control.sigmas) & (control.sigmas > 0.0)]
    if len(control) < 4 or not sigmas.size:
        return ""
    extent = float(np.linalg.norm(np.ptp(control.coordinates, axis=0)))
    if float(np.median(sigmas)) > FINE * extent:
        return ""
    return next(filter(None, (_larger(trials, factor, unit) for factor, unit in FACTORS)), "")


def _larger(trials: Trials, factor: float, unit: str) -> str:
    """What is said where residuals of the control points are as sigmas that are so many times larger."""
    changed = trials.copy()
    changed.control = changed.control.scaled(factor)
    found = trials.solved(changed, f"sigmas of control points times {factor:g}")
    if found is None or not _agree(found) or trials.gains(found) < MANY * 3 * len(trials.block.control):
        return ""
    return (
        f"the sigmas of the control points are about {factor:g} times too small: coordinates in {unit} with "
        f"sigmas in metres? With sigmas in {unit}, {trials.falls(found)}"
    )


def _agree(found: BundleSolution) -> bool:
    """Whether residuals of control points are about as large as their sigmas."""
    w = _standardised(found)
    if w.size <= 7:
        return False
    rms = float(np.sqrt(np.sum(w**2) / (w.size - 7)))
    return bool(1.0 / ABOUT < rms < ABOUT)


def _standardised(found: BundleSolution) -> FloatArray:
    """(n,) residuals of the coordinates of control points that have sigmas, over these."""
    names, residuals = found.control_residuals()
    sigmas = found.block.control.select(names).sigmas
    known = np.isfinite(sigmas) & (sigmas > 0.0)
    return np.asarray(residuals[known] / sigmas[known])
