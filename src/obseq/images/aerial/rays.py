"""Where rays meet: two rays in closed form, many rays by least squares; arrays of any length.

Rays are centres and directions in one Euclidean frame; nothing here knows of maps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass

PARALLEL = 1e-12
"""Squared sine of the angle under which two rays count as parallel: doubles do not determine their foot."""


class RayPairs(NamedTuple):
    """The common perpendiculars of pairs of rays.

    Attributes:
        middle: (n, 3) middle of the feet; nan for parallel rays.
        gap: (n, 3) from the foot on the first ray to that on the second.
        reach: (n, 2) how far along each ray its foot is, in lengths of the direction: negative is behind.
        sine: (n,) sine of the angle between the rays.
    """

    middle: FloatArray
    gap: FloatArray
    reach: FloatArray
    sine: FloatArray


def meet(first: FloatArray, towards: FloatArray, second: FloatArray, along: FloatArray) -> RayPairs:
    """The common perpendiculars of rays from `first` (n, 3) `towards`, and from `second` (n, 3) `along`.

    Minimises ``|P1 + t1 v1 - P2 - t2 v2|``. The printed formula of the seed text has five faults
    (`docs/aerial.md`); this is the computation itself.
    """
    base = second - first
    n1, n2, c = _dot(towards, towards), _dot(along, along), _dot(towards, along)
    b1, b2 = _dot(base, towards), _dot(base, along)
    squared = (n1 * n2 - c * c) / (n1 * n2)
    with np.errstate(divide="ignore", invalid="ignore"):
        below = np.where(squared > PARALLEL, n1 * n2 - c * c, np.nan)
        t1, t2 = (b1 * n2 - b2 * c) / below, (b1 * c - b2 * n1) / below
    on_first = first + t1[:, None] * towards
    gap = second + t2[:, None] * along - on_first
    sine = np.sqrt(np.clip(squared, 0.0, None))
    return RayPairs(on_first + 0.5 * gap, gap, np.stack([t1, t2], axis=1), sine)


def middle_jacobian(towards: FloatArray, along: FloatArray, pairs: RayPairs) -> FloatArray:
    """Derivative (n, 3, 6) of the middle by both directions (v1, then v2).

    From the conditions that the gap is perpendicular to both rays.
    """
    t1, t2 = pairs.reach[:, 0, None, None], pairs.reach[:, 1, None, None]
    n1, n2, c = _dot(towards, towards), _dot(along, along), _dot(towards, along)
    v1, v2, gap = towards[:, None, :], along[:, None, :], pairs.gap[:, None, :]
    # n1 dt1 - c dt2 = (gap - t1 v1) dv1 + t2 v1 dv2 ;  c dt1 - n2 dt2 = -t1 v2 dv1 + (gap + t2 v2) dv2
    first = np.concatenate([gap - t1 * v1, t2 * v1], axis=2)
    second = np.concatenate([-t1 * v2, gap + t2 * v2], axis=2)
    below = (c * c - n1 * n2)[:, None, None]
    dt1 = (c[:, None, None] * second - n2[:, None, None] * first) / below
    dt2 = (n1[:, None, None] * second - c[:, None, None] * first) / below
    moved = towards[:, :, None] * dt1 + along[:, :, None] * dt2
    eye = np.eye(3)
    moved[:, :, :3] += t1 * eye
    moved[:, :, 3:] += t2 * eye
    return np.asarray(0.5 * moved)


def solve_by_point(matrices: FloatArray, right: FloatArray) -> FloatArray:
    """Solutions (n, 3) of small systems; nan where a matrix is singular to the rounding error."""
    good = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    scale = np.trace(matrices[good], axis1=1, axis2=2)
    good[good] = np.linalg.eigvalsh(matrices[good])[:, 0] > PARALLEL * scale
    found = np.full_like(right, np.nan)
    if good.any():
        found[good] = np.linalg.solve(matrices[good], right[good][:, :, None])[:, :, 0]
    return found


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("ni,ni->n", a, b))


GOOD = 1.5
"""Residuals are good up to so many times the expected size."""
LEVEL = 0.001
"""Probability that a point is suspected where nothing is wrong."""
SHOWN = 5


@dataclass(frozen=True)
class RayVerdict:
    """How well rays meet.

    Attributes:
        tested: points whose rays could miss each other.
        size: residuals over what the sigma of the measures announces, of most points (by the median).
        suspects: names of points whose rays miss each other by far more than those of the others, and the
            size of their residuals over the sigma; the worst first.
    """

    tested: int
    size: float
    suspects: tuple[tuple[str, float], ...]

    @property
    def is_good(self) -> bool:
        """Whether nothing is larger than expected."""
        return self.size <= GOOD and not self.suspects

    def sentences(self) -> str:
        """What was found, in words."""
        if not self.tested:
            return "nothing tests the orientations: no point has two rays that could miss each other"
        found = (
            f"rays of {self.tested} points miss each other by {self.size:.3g} times what --sigma announces"
        )
        judged = "GOOD" if self.size <= GOOD else "TOO LARGE: look at orientations, cameras, or --sigma"
        return "\n".join([f"{found}: {judged}", *([self._of_suspects()] if self.suspects else [])])

    def _of_suspects(self) -> str:
        listed = ", ".join(f"point {name} ({size:.3g} times)" for name, size in self.suspects[:SHOWN])
        more = len(self.suspects) - SHOWN
        count = "a gross error is" if len(self.suspects) == 1 else f"{len(self.suspects)} gross errors are"
        return f"{count} suspected: {listed}" + (f" and {more} more" if more > 0 else "")


def judged(names: Sequence[str], squares: FloatArray, redundancy: IntArray) -> RayVerdict:
    """The verdict on points.

    Args:
        names: (n,) of the points.
        squares: (n,) sums of squared residuals over their sigmas; not finite where nothing is known.
        redundancy: (n,) their degrees of freedom.
    """
    from scipy.special import chdtrc, chdtri

    rows = np.flatnonzero(np.isfinite(squares) & (redundancy > 0))
    if not rows.size:
        return RayVerdict(0, 0.0, ())
    sums, degrees = squares[rows], redundancy[rows].astype(np.float64)
    size = float(np.sqrt(np.median(sums / chdtri(degrees, 0.5))))
    beyond = np.flatnonzero(chdtrc(degrees, sums / max(size, 1.0) ** 2) < LEVEL / rows.size)
    each = np.sqrt(sums / degrees)
    worst = beyond[np.argsort(-each[beyond], kind="stable")]
    return RayVerdict(int(rows.size), size, tuple((names[rows[k]], float(each[k])) for k in worst))
