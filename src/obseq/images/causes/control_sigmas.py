"""Sigmas of control points in another unit than their coordinates."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from obseq.arrays import FloatArray
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.causes.shared import SharedCause, Subject, Told, Trial

FACTORS = ((1000.0, "millimetres"), (100.0, "centimetres"))
ABOUT = 1.8
"""Times which residuals may be larger or smaller than sigmas of the right unit."""
FINE = 1e-6
"""Of the extent of the control points: sigmas below may be in another unit than coordinates."""
LOUD = 4.0
"""Sigmas: one control coordinate that is farther off is wrong itself."""
FREE = 7
"""Coordinates that the block takes from the control points whatever they are."""


def _trials(subject: Subject) -> Iterator[Trial]:
    for factor, unit in FACTORS:
        if _are_fine(subject):
            said = (
                f"the sigmas of the control points are about {factor:g} times too small: coordinates in "
                f"{unit} with sigmas in metres?"
            )
            yield _scaled(subject, factor, said)
        if subject.solution is not None and _are_large(subject.solution):
            said = (
                f"the sigmas of the control points are about {factor:g} times as large as their residuals: "
                f"in {unit}, with coordinates in metres?"
            )
            yield _scaled(subject, 1.0 / factor, said)


def _scaled(subject: Subject, factor: float, said: str) -> Trial:
    made = subject.block.copied()
    made.poses = subject.given
    made.control = made.control.scaled(factor)
    return Trial(
        f"sigmas of control points times {factor:g}",
        made,
        lambda found: Told(said if _agree(found) else ""),
    )


def _agree(found: BundleSolution) -> bool:
    """Whether residuals of control points are about as large as their sigmas, and none stands out."""
    all_of_them = ratio(found)
    return (
        all_of_them is not None
        and 1.0 / ABOUT < all_of_them < ABOUT
        and bool(np.abs(_standardised(found)).max(initial=0.0) < LOUD)
    )


def _standardised(found: BundleSolution) -> FloatArray:
    """(n,) residuals of control coordinates that have sigmas, over these."""
    names, residuals = found.control_residuals()
    sigmas = found.block.control.select(names).sigmas
    known = np.isfinite(sigmas) & (sigmas > 0.0)
    return np.asarray(residuals[known] / sigmas[known])


def ratio(found: BundleSolution) -> float | None:
    """Residuals of control points over their sigmas, in the square mean; None where there are too few."""
    w = _standardised(found)
    return float(np.sqrt(np.sum(w**2) / (w.size - FREE))) if w.size > FREE else None


def _are_fine(subject: Subject) -> bool:
    """Whether sigmas are so small beside the extent of the points that they may be in a larger unit."""
    control = subject.block.control
    sigmas = control.sigmas[np.isfinite(control.sigmas) & (control.sigmas > 0.0)]
    extent = float(np.linalg.norm(np.ptp(control.coordinates, axis=0))) if len(control) else 0.0
    return bool(sigmas.size) and float(np.median(sigmas)) <= FINE * extent


def _are_large(found: BundleSolution) -> bool:
    """Whether residuals are so much smaller than sigmas that these may be in a smaller unit."""
    all_of_them = ratio(found)
    return all_of_them is not None and all_of_them < ABOUT / FACTORS[-1][0] ** 0.5


def _are_odd(subject: Subject) -> bool:
    """Whether sigmas may be in another unit, by their residuals or by their size."""
    return _are_fine(subject) or (subject.solution is not None and _are_large(subject.solution))


CONTROL_SIGMAS = SharedCause(
    "I190",
    "sigmas of control",
    "The sigmas of the control points are in another unit than their coordinates.",
    "Sigmas in millimetres with coordinates in metres.",
    "Give both in one unit.",
    4.0,
    _trials,
    _are_odd,
)
