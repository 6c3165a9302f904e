"""What a block lacks to be adjusted, in the words of its images and points."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError, SingularSystemError
from obseq.images.adjustment.start import ContradictionError
from obseq.images.adjustment.weakness import known_beside_points
from obseq.images.initial.distribution import check_spread
from obseq.leastsquares.diagnosis.rejection import is_emptied

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from obseq.images.adjustment.equations import Equations
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.adjustment.start import Start
    from obseq.images.block import Block

DATUMS = ("control", "centres", "points", "none")


def check_datum(block: Block, start: Start, datum: str | Sequence[str]) -> None:
    """Refuses a block that nothing places in the world, unless a free one is asked for.

    Raises:
        InputError: the datum is unknown; too little is known; all that is known is on a line.
    """
    if isinstance(datum, str) and datum not in DATUMS:
        raise InputError(f"datum {datum!r} is none of {', '.join(DATUMS)} or a list of point names")
    if datum != "control" or block.surveys:
        return
    known = start.is_control[:, None] & ~start.is_free
    others = known_beside_points(block, start)
    if int(known.sum()) + others < 7:
        raise InputError(
            f"{block.source}the block has no datum: {int(known.sum()) + others} coordinates of measured "
            "points are known, and position, orientation and scale take 7; add control points, or ask for a "
            "free block, on its centres or on its points (datum='centres', datum='points'; --datum centres, "
            "--datum points)" + _idle(start)
        )
    if others == len(block.lengths.values) and (known.all(axis=1) == known.any(axis=1)).all():
        rows = np.flatnonzero(known.all(axis=1))
        places = block.control_places([start.points[row] for row in rows])
        what = "the block" if any(origin.lines for _, origin in block.control_origins) else ""
        check_spread(start.coordinates[rows], what or f"{block.source}the block", places)


def check_weights(equations: Equations) -> None:
    """Refuses a solution in which no image point has any weight: only what is known besides says the poses.

    Raises:
        SingularSystemError: thresholds have rejected all of them.
    """
    batches = [item.batch for item in equations.measures if item.batch.active.any()]
    if batches and all(is_emptied(batch) for batch in batches):
        raise SingularSystemError(
            f"all {sum(int(batch.active.sum()) for batch in batches)} image points lie beyond the threshold: "
            "none has any weight"
        )


def check_cameras(solution: BundleSolution) -> BundleSolution:
    """A solution, if its cameras are possible.

    Raises:
        ContradictionError: one is not: a mirror image has a negative focal length.
    """
    with cameras_refused():
        solution.cameras  # noqa: B018  (each is checked when it is made)
    return solution


@contextmanager
def cameras_refused() -> Iterator[None]:
    """Cameras that cannot be, which iterations have led to, are said to be those of a mirror image."""
    try:
        yield
    except InputError as error:
        raise ContradictionError(
            f"{error}: the block fits as a mirror image only; check the axes of image points and control "
            "points, the principal point and the poses, or hold the camera (--freeze '.*')"
        ) from None


def _idle(start: Start) -> str:
    """The control points that are given and in no image, if there are some."""
    names = [item.name for item in start.unmeasured]
    if not names:
        return ""
    measured = f"{', '.join(start.points[:3])}, ..." if start.points else "none"
    return (
        f". {len(names)} control points are in no image: {', '.join(names[:3])}; names count with their case "
        f"(points in images: {measured})"
    )


def check_scale(block: Block, datum: str | Sequence[str]) -> None:
    """Refuses rigid blocks of unknown size without a scale: the world would shrink for their sake."""
    has_scale = datum == "control" or block.lengths.values or block.surveys
    for part in block.rigid_blocks:
        if not (has_scale or part.is_exact or part.is_fixed or part.observed_places.keys() - {part.master}):
            raise InputError(
                f"rigid block {part.name}: its sigmas are in the unit of the world, and nothing gives "
                "the block a scale; add a length, or take the places of the cameras as known (is_fixed) "
                "or as observed (place_sigmas)"
            )
