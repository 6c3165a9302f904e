"""Whether points have stayed: tests of displacements, and the datum of points that have.

The congruence test is Pelzer's: ``d' Q^+ d / (h s0^2)`` against Fisher's distribution, h the rank of the
cofactors Q of the displacements d. Displacements relative to reference points are those after the
S-transformation that fits the epochs together on them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.comparison_record import TestRecord
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.statistics.distributions import chi_square_limit, chi_square_tails

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, FloatArray
    from obseq.survey.epochs.displacements import Displacements

RANK = 1e-9
"""Share of the largest eigenvalue below which a direction counts as known exactly."""
LEAST_SHARE = 0.5
"""Of the reference points must stay: otherwise nothing says which ones have moved."""


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
        return self._judged(squares / freedom, freedom)

    def of_ratio(self, ratio: float, above: int, below: int) -> TestRecord:
        """The two-sided test of a ratio of variance factors, the larger above, of given redundancies."""
        from scipy.special import fdtrc, fdtri

        p_value = min(2.0 * float(fdtrc(above, below, ratio)), 1.0)
        limit = float(fdtri(above, below, 1.0 - 0.5 * self.level))
        return TestRecord(ratio, above, limit, p_value, p_value >= self.level)

    def _judged(self, statistic: float, freedom: int) -> TestRecord:
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


def relative_to(moved: Displacements, reference: BoolArray, *, is_spatial: bool) -> Displacements:
    """Displacements after the epochs were fitted together on reference points (a mask).

    Args:
        moved: along axes that are parallel at all points.
        reference: at least two points.
        is_spatial: fit three rotations; one about the vertical otherwise.
    """
    motions = _motions(moved.places, is_spatial=is_spatial)
    fitted = np.linalg.pinv(motions * np.repeat(reference, 3)[:, None], rcond=1e-10)
    rest = np.eye(len(motions)) - motions @ (fitted * np.repeat(reference, 3)[None, :])
    vectors = (rest @ moved.vectors.ravel()).reshape(-1, 3)
    return replace(
        moved,
        vectors=vectors,
        cofactors=rest @ moved.cofactors @ rest.T,
        tested=np.ones(len(reference), np.bool_),
    )


def stable(
    moved: Displacements, reference: BoolArray, tester: Tester, *, is_spatial: bool
) -> tuple[BoolArray, list[int]]:
    """The reference points that have stayed, and the rows of the others in the order of their removal.

    One point after the other is taken out, the one that contradicts the rest most, until these pass the
    congruence test.

    Raises:
        InputError: so many have moved that nothing says which ones.
    """
    staying, removed = reference.copy(), list[int]()
    least = max(2, int(np.ceil(LEAST_SHARE * np.count_nonzero(reference))))
    while True:
        now = relative_to(moved, staying, is_spatial=is_spatial)
        if congruence(now, staying, tester).passed:
            return staying, removed
        if np.count_nonzero(staying) <= least:
            listed = ", ".join(moved.names[row] for row in removed)
            without = f" even without {listed}: more than half have moved" if listed else ": some have moved"
            raise InputError(
                f"compare: the reference points do not agree{without}, or the sigmas are too small; name "
                "reference points that have stayed, or more of them (--reference)"
            )
        worst = _worst(now, staying)
        staying[worst] = False
        removed.append(worst)


def _worst(moved: Displacements, chosen: BoolArray) -> int:
    """The chosen point whose removal lowers the statistic most."""
    rows = np.flatnonzero(chosen)
    scalars = np.repeat(chosen, 3)
    weights = np.linalg.pinv(moved.cofactors[np.ix_(scalars, scalars)], rcond=RANK, hermitian=True)
    pulls = (weights @ moved.vectors[chosen].ravel()).reshape(-1, 3)
    shares = [
        float(pull @ np.linalg.pinv(weights[3 * k : 3 * k + 3, 3 * k : 3 * k + 3], hermitian=True) @ pull)
        for k, pull in enumerate(pulls)
    ]
    return int(rows[int(np.argmax(shares))])


def _motions(places: FloatArray, *, is_spatial: bool) -> FloatArray:
    """(3 n, 4 or 6) translations and rotations of points about their middle, in lengths of the network."""
    centred = places - places.mean(axis=0)
    centred /= max(float(np.abs(centred).max()), 1e-12)
    x, y, z = centred.T
    zero = np.zeros(len(x))
    turns = [np.column_stack([-y, x, zero])]
    if is_spatial:
        turns += [np.column_stack([zero, -z, y]), np.column_stack([z, zero, -x])]
    shifts = [np.broadcast_to(axis, (len(x), 3)) for axis in np.eye(3)]
    return np.stack([motion.ravel() for motion in (*shifts, *turns)], axis=1)
