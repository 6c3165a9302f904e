"""Whether rays meet as well as their measures announce, and which points are gross errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray, IntArray

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
