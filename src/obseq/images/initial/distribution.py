"""How control points are spread: what a resection can do with them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from obseq.arrays import BoolArray, FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.images.control import ControlPoints
from obseq.images.measures import ImagePoints
from obseq.images.names import index_of

COLLINEAR = 1e-4
"""Below this linearity, points are on a line for a resection."""
DEGREES = 1e-3
"""Share of their range in height that x and y of points in degrees do not reach."""
LEAST = 3
"""Points that tell what is far from them."""
NAMED = 5
"""Names of points in a message."""


@dataclass(frozen=True, eq=False)
class Distribution:
    """Indices of the distribution of control points, per image (MMVII's `OriPoseEstimCheckGCPDist`).

    With the roots l0 <= l1 <= l2 of the mean squared extents along the principal axes of the n points:
    linearity = l1 / l2 n / (n - 2), planarity = l0 / l2 n / (n - 3); NaN where there are too few points.

    Attributes:
        images: (k,) names.
        counts: (k,) control points measured.
        linearity: (k,) 0 on a line.
        planarity: (k,) 0 in a plane.
        allows_resection: (k,) enough, and not near a line.
        allows_eleven_parameters: (k,) enough, and not near a plane.
    """

    images: tuple[str, ...]
    counts: NDArray[np.int64]
    linearity: FloatArray
    planarity: FloatArray
    allows_resection: BoolArray
    allows_eleven_parameters: BoolArray


def check_distribution(
    measures: ImagePoints,
    control: ControlPoints,
    least_linearity: float = 0.1,
    least_planarity: float = 0.01,
    least_for_resection: int = 4,
    least_for_eleven: int = 6,
) -> Distribution:
    """The distribution of the control points in each image.

    Args:
        measures: points in images.
        control: known points.
        least_linearity: an image needs more for a resection.
        least_planarity: an image needs more for a resection without calibration.
        least_for_resection: points that a resection takes.
        least_for_eleven: points that a resection without calibration takes.
    """
    known = measures.of_points(control.names)
    ground = control.coordinates[index_of(control.names, known.point_names, "control point")]
    per_image = {name: np.flatnonzero(known.image == k) for k, name in enumerate(known.image_names)}
    rows = [per_image.get(name, np.zeros(0, dtype=np.int64)) for name in measures.image_names]
    indices = [spread_indices(ground[known.point[part]]) for part in rows]
    counts = np.array([len(part) for part in rows], dtype=np.int64)
    linearity, planarity = np.array(indices).reshape(-1, 2).T
    linearity = np.where(counts >= least_for_resection, linearity, np.nan)
    planarity = np.where(counts >= least_for_eleven, planarity, np.nan)
    return Distribution(
        measures.image_names,
        counts,
        linearity,
        planarity,
        linearity > least_linearity,
        planarity > least_planarity,
    )


def spread_indices(points: FloatArray) -> tuple[float, float]:
    """Linearity and planarity of points (n, 3); NaN where n is too small for the index."""
    n = len(points)
    if n < 3:
        return float("nan"), float("nan")
    l2, l1, l0 = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if l2 == 0.0:
        return 0.0, 0.0
    return float(l1 / l2 * n / (n - 2)), float(l0 / l2 * n / (n - 3)) if n > 3 else float("nan")


def check_spread(points: FloatArray, what: str, names: Sequence[str] = ()) -> None:
    """Refuses points (n, 3) that are on a line, or at one place.

    Raises:
        InputError: the message begins with `what`, and has the first of their names.
    """
    linearity, _ = spread_indices(points)
    if not linearity > COLLINEAR:
        check_places(points, what)
        _refuse_far_one(points, what, names)
        first = ", ".join([*names[:NAMED], "..."] if len(names) > NAMED else names)
        listed = f" ({first})" if names else ""
        raise InputError(
            f"{what}: its {len(points)} control points{listed} are on a line, which leaves the rotation "
            f"about it undetermined; {_remedy(points)}"
        )


def check_places(points: FloatArray, what: str) -> None:
    """Refuses points (n, 3) that all have one place.

    Raises:
        InputError: the message begins with `what`.
    """
    if len(points) > 1 and not np.ptp(points, axis=0).any():
        place = ", ".join(f"{value:.10g}" for value in points[0])
        raise InputError(
            f"{what}: all its {len(points)} control points have one place ({place}): their coordinates are "
            "those of a single point, repeated; look for where they were copied or lost"
        )


def _refuse_far_one(points: FloatArray, what: str, names: Sequence[str]) -> None:
    """Refuses the point of points (n, 3) that is so far from the others that these look like one.

    Raises:
        InputError: the others are on no line by themselves.
    """
    away = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    far = int(np.argmax(away))
    others = np.delete(points, far, axis=0)
    if len(others) < LEAST or not spread_indices(others)[0] > COLLINEAR:
        return
    size = float(np.linalg.norm(np.ptp(others, axis=0)))
    named = names[far] if names else f"the {far + 1}th"
    raise InputError(
        f"{what}: control point {named} is {away[far]:.6g} from the others, which are within {size:.4g} "
        "of each other and would do without it: likely a digit, the unit or an axis of its coordinates is "
        "wrong"
    )


def _remedy(points: FloatArray) -> str:
    """What to do about points (n, 3) on a line."""
    across, up = np.ptp(points[:, :2], axis=0).max(), float(np.ptp(points[:, 2]))
    if across < DEGREES * up and np.abs(points[:, :2]).max() <= 360.0:
        return "x and y look like degrees: give lengths, in a local frame"
    return "add a point beside the line"
