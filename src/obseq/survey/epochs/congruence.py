"""Whether points have stayed: two epochs fitted together on those that have, and tests of displacements.

What the epochs are moved by (the S-transformation) is what their observations leave free: position, and
rotation about the vertical, of most networks; the scale too where nothing but angles is observed, tilts where
nothing but distances is, and no rotation where vectors orient the network.
The congruence test is Pelzer's: ``d' Q^+ d / (h s0^2)`` against Fisher's distribution, h the rank of the
cofactors Q of the displacements d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.diagnosis.free_motions import SHAPE
from obseq.leastsquares.statistics.distributions import chi_square_limit, chi_square_tails
from obseq.records.comparison import TestRecord
from obseq.survey.adjustment.adjusted import Adjustment
from obseq.survey.epochs.displacements import Displacements

RANK = 1e-9
"""Share of the largest eigenvalue below which a direction counts as known exactly."""


@dataclass(frozen=True)
class Tester:
    """Tests at one level.

    Attributes:
        level: probability that a test finds a movement where there is none.
        variance_factor: of both epochs together; 1 when the sigmas are trusted.
        redundancy: behind it; None when the sigmas are trusted.
    """

    level: float
    variance_factor: float = 1.0
    redundancy: int | None = None

    def of(self, vector: FloatArray, cofactors: FloatArray) -> TestRecord | None:
        """The test of displacements (k,) with cofactors (k, k); None where all of them are known exactly."""
        if not cofactors.any():
            return None
        values, vectors = np.linalg.eigh(cofactors)
        kept = values > RANK * values[-1]
        freedom = int(np.count_nonzero(kept))
        along = vectors[:, kept].T @ vector
        squares = float(np.sum(along**2 / values[kept]) / self.variance_factor)
        return self.judged(squares / freedom, freedom)

    def of_ratio(self, ratio: float, above: int, below: int) -> TestRecord:
        """The two-sided test of a ratio of variance factors, the larger above, of given redundancies."""
        from scipy.special import fdtrc, fdtri

        p_value = min(2.0 * float(fdtrc(above, below, ratio)), 1.0)
        limit = float(fdtri(above, below, 1.0 - 0.5 * self.level))
        return TestRecord(ratio, above, limit, p_value, p_value >= self.level)

    def judged(self, statistic: float, freedom: int) -> TestRecord:
        """The test of a statistic, of displacements in units of sigma0, by its degrees of freedom."""
        if self.redundancy is None:
            p_value = chi_square_tails(statistic * freedom, freedom)[1]
            limit = chi_square_limit(freedom, above=self.level) / freedom
        else:
            from scipy.special import fdtrc, fdtri

            p_value = float(fdtrc(freedom, self.redundancy, statistic))
            limit = float(fdtri(freedom, self.redundancy, 1.0 - self.level))
        return TestRecord(statistic, freedom, limit, p_value, p_value >= self.level)


def congruence(moved: Displacements, chosen: BoolArray, tester: Tester) -> TestRecord:
    """The test of chosen points (a mask) together.

    Raises:
        InputError: all of them are held: nothing can be tested.
    """
    scalars = np.repeat(chosen, 3)
    found = tester.of(moved.vectors[chosen].ravel(), moved.cofactors[np.ix_(scalars, scalars)])
    if found is None:
        raise InputError("compare: all common points are held in both epochs; there is nothing to test")
    return found


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
