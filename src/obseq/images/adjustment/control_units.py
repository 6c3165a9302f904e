"""Control points in another unit than the rest of a block, or than their own sigmas."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.images.adjustment.trials import is_rejected
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
LARGE, LEAST = 0.2, 5.0
"""Times themselves, sigmas that are not blamed; redundancy that says so."""
ROUNDS, NEAR = 6, 1.4
"""Steps of a variance component, and the last of them, at most."""
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


def large_sigmas(trials: Trials) -> str:
    """That sigmas of control points are in a smaller unit than their coordinates, in words; else empty."""
    scale = _scale(trials)
    for factor, unit in FACTORS:
        if scale is not None and 1.0 / ABOUT < scale * factor < ABOUT:
            return (
                f"the sigmas of the control points are about {1.0 / scale:.0f} times as large as their "
                f"residuals: in {unit}, with coordinates in metres? Divided by {factor:g}, they agree"
            )
    return ""


def _scale(trials: Trials) -> float | None:
    """By what sigmas of control points are to be multiplied that are far too large; None where they are not.

    Their variance component says it after some steps: a weak block bends with loose control points.
    """
    w = _standardised(trials.before)
    if not w.size or np.sqrt(np.mean(np.square(w))) > LARGE:
        return None
    scale = 1.0
    for _ in range(ROUNDS):
        found = _with_sigmas(trials, scale)
        step = None if found is None or is_rejected(found) else _component(found)
        if step is None or not 0.0 < scale * step < LARGE:
            return None
        scale *= step
        if 1.0 / NEAR < step < NEAR:
            return scale
    return None


def _with_sigmas(trials: Trials, scale: float) -> BundleSolution | None:
    """The block with the sigmas of control points multiplied, and covariances."""
    if scale == 1.0 and trials.before.result.has_covariances:
        return trials.before
    changed = trials.copy()
    changed.control = changed.control.scaled(scale)
    return trials.solved(changed, f"sigmas of control points times {scale:.3g}", covariance=True)


def _component(found: BundleSolution) -> float | None:
    """By what sigmas of control points are to be multiplied, by their residuals; None where these are few."""
    sigmas = found.block.control.select(found.control_residuals()[0]).sigmas
    known = np.isfinite(sigmas) & (sigmas > 0.0)
    if not known.any() or not found.result.redundancy:
        return None
    points = found.equations.points[found.start.is_control]
    cofactors = np.diagonal(found.result.covariance(points, a_priori=True), axis1=1, axis2=2)
    redundancy = float(np.sum(1.0 - cofactors[known] / np.square(sigmas[known])))
    squares = float(np.sum(np.square(_standardised(found))))
    return float(np.sqrt(squares / redundancy)) if redundancy > LEAST else None


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
    rms = _rms(found)
    return rms is not None and 1.0 / ABOUT < rms < ABOUT


def _rms(found: BundleSolution) -> float | None:
    """Of the residuals of control points over their sigmas; None where there are too few."""
    w = _standardised(found)
    return float(np.sqrt(np.sum(w**2) / (w.size - 7))) if w.size > 7 else None


def _standardised(found: BundleSolution) -> FloatArray:
    """(n,) residuals of the coordinates of control points that have sigmas, over these."""
    names, residuals = found.control_residuals()
    sigmas = found.block.control.select(names).sigmas
    known = np.isfinite(sigmas) & (sigmas > 0.0)
    return np.asarray(residuals[known] / sigmas[known])
