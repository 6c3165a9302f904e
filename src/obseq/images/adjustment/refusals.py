"""Why a block has no solution: what a common cause explains is said with the error."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from obseq.boundary import Boundary
from obseq.errors import ObseqError, SingularSystemError
from obseq.images.adjustment.axes import axes_in_words, exchanged_axes
from obseq.images.adjustment.causes import common_cause, silent
from obseq.images.adjustment.given_poses import misplaced
from obseq.images.adjustment.odd_control import odd_control
from obseq.images.adjustment.start import ContradictionError
from obseq.images.adjustment.trials import Attempts, is_mirrored, is_rejected
from obseq.images.initial.conventions import MOST_PLACED

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from obseq.images.adjustment.adjustable import AdjustableBlock
    from obseq.images.adjustment.solution import BundleSolution


@contextmanager
def explained(
    block: AdjustableBlock, told: Callable[[str], None] | None = None, **options: Any
) -> Iterator[None]:
    """Errors of a block that its measures leave undetermined, or contradict, say what explains them.

    Args:
        block: with the poses that were given.
        told: is told what is being tried.
        options: of `solve`.
    """
    given = block.poses
    try:
        yield
    except (ContradictionError, SingularSystemError) as error:
        attempts, boundary = Attempts(block, given, told or silent, options), Boundary()
        is_small = sum(len(part.measures) for part in block.sets) <= MOST_PLACED
        said = boundary.attempt("the search for causes", lambda: _cause(attempts), "") if is_small else ""
        if said:
            error.args = (f"{error}\nLikely cause: {said}",)
        raise


def _cause(attempts: Attempts) -> str:
    """What makes the block fit when it is changed, in words; empty where nothing does."""
    held = _with_held_cameras(attempts)
    if held is not None and held.converged and not (is_mirrored(held) or is_rejected(held)):
        return (
            "the measures do not determine the cameras; with their parameters held as they were given, "
            f"{attempts.falls(held)}"
        )
    return (
        axes_in_words(attempts, exchanged_axes(attempts))
        or misplaced(attempts)
        or odd_control(attempts)
        or ("" if held is None else _of_calibrated(attempts, held))
    )


def _with_held_cameras(attempts: Attempts) -> BundleSolution | None:
    """The solution of a block whose cameras keep their parameters, if there is one."""
    made = attempts.copy()
    made.freeze_parameters()
    try:
        made.initialise(causes=False)
        return made.solve(**{**attempts.options, "covariance": False})
    except ObseqError:
        return None


def _of_calibrated(attempts: Attempts, held: BundleSolution) -> str:
    """What is wrong with a block that has a solution when its cameras keep their parameters, in words."""
    made = attempts.copy()
    made.freeze_parameters()
    return common_cause(made, held, attempts.given, attempts.told, **attempts.options)
