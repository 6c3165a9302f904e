"""Two epochs fitted together on points that have stayed: displacements relative to these (S-transformation).

What the epochs are moved by is what their observations leave free: position, and rotation about the vertical,
of most networks; the scale too where nothing but angles is observed, tilts where nothing but distances is,
and no rotation where vectors orient the network.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares.diagnosis.free_motions import SHAPE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import BoolArray, FloatArray
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.epochs.displacements import Displacements

RANK = 1e-10
"""Share of the largest singular value below which points do not determine a motion."""


def motions_of(
    epochs: Sequence[Adjustment], moved: Displacements, reference: BoolArray, *, is_spatial: bool
) -> FloatArray:
    """(3 n, q) the motions by which the epochs are fitted together, from what their observations leave free.

    Args:
        epochs: the adjustments; free ones rest on inner constraints of the reference points.
        moved: the displacements between them.
        reference: the points (a mask).
        is_spatial: whether epochs that rest on known coordinates are fitted by three rotations; about the
            vertical alone otherwise.
    """
    defect = max(sum(motion.text != SHAPE for motion in epoch.undetermined) for epoch in epochs)
    if not defect:
        return similarities(moved.places)[:, : 6 if is_spatial else 4]
    is_sought = (np.diag(moved.cofactors).reshape(-1, 3) > 0.0).any(axis=0)
    every = similarities(moved.places) * np.tile(is_sought, len(moved.names))[:, None]
    own = np.repeat(reference, 3)
    _, sizes, axes = np.linalg.svd(every[own], full_matrices=False)
    kept = sizes > RANK * sizes[0]
    unit = axes[kept].T / sizes[kept]
    # constraints on the reference points leave no uncertainty along what the observations leave free
    spread = (every[own] @ unit).T @ moved.cofactors[np.ix_(own, own)] @ (every[own] @ unit)
    return np.asarray(every @ unit @ np.linalg.eigh(spread)[1][:, :defect])


def similarities(places: FloatArray) -> FloatArray:
    """(3 n, 7) translations, rotations about z, x and y, scale: about the middle, for its largest extent."""
    centred = places - places.mean(axis=0)
    centred /= max(float(np.abs(centred).max()), 1e-12)
    x, y, z = centred.T
    zero = np.zeros(len(x))
    turns = (
        np.column_stack([-y, x, zero]),
        np.column_stack([zero, -z, y]),
        np.column_stack([z, zero, -x]),
    )
    shifts = (np.broadcast_to(axis, (len(x), 3)) for axis in np.eye(3))
    return np.stack([motion.ravel() for motion in (*shifts, *turns, centred)], axis=1)


def determine(motions: FloatArray, chosen: BoolArray) -> bool:
    """Whether chosen points (a mask) determine all of the motions."""
    sizes = np.linalg.svd(motions[np.repeat(chosen, 3)], compute_uv=False)
    return len(sizes) == motions.shape[1] and bool(sizes[-1] > RANK * sizes[0])


def relative_to(moved: Displacements, reference: BoolArray, motions: FloatArray) -> Displacements:
    """Displacements after the epochs were fitted together on reference points (a mask).

    Args:
        moved: along axes that are parallel at all points.
        reference: the points, which determine the motions.
        motions: (3 n, q) by which the epochs are fitted.
    """
    own = np.repeat(reference, 3)
    fit = np.linalg.pinv(motions * own[:, None], rcond=RANK) * own
    through = fit @ moved.cofactors
    crossed = motions @ through
    fitted = motions @ (through @ fit.T) @ motions.T
    return replace(
        moved,
        vectors=moved.vectors - (motions @ (fit @ moved.vectors.ravel())).reshape(-1, 3),
        cofactors=moved.cofactors - crossed - crossed.T + fitted,
        tested=np.ones(len(reference), np.bool_),
    )
