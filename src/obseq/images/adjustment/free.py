"""Free blocks: position, orientation and scale by inner constraints on projection centres or points.

First the solution without any datum: damped steps need none, and come home from far. Then a similarity takes
all of it to where the changes of the datum from the start are least, and what the similarity leaves (where
lengths, verticals or known places determine some of the seven) is done by steps on the datum. Where these
fail, the damped solution is what there is, without precisions.
"""

from __future__ import annotations

from collections.abc import Sequence, Sized
from dataclasses import replace
from functools import partial

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.errors import DivergenceError, InputError, ObseqError, SingularSystemError
from obseq.geometry import RigidMotion
from obseq.images.adjustment.approach import Solving, approach, drop_undetermined, solve_to_the_end
from obseq.images.adjustment.equations import Equations
from obseq.images.adjustment.start import LeftOut
from obseq.images.initial.growth import similarity
from obseq.images.names import index_of
from obseq.leastsquares import Iteration, LeastSquares, LeastSquaresResult

SETTLINGS = 8
SETTLED = 1e-6
"""Share of its extent by which a last step may move the datum: what such a step leaves is its square."""
HIGHER = 1e-6
"""Share of a sum of squares by which steps on the datum may end above the damped solution: rounding."""


def solve_free(
    equations: Equations,
    datum: str | Sequence[str],
    strategy: str,
    covariance: bool | None,
    solving: Solving,
    further: int,
) -> tuple[LeastSquaresResult, tuple[Iteration, ...], tuple[LeftOut, ...]]:
    """The solution of a free block closest to its start on the datum, its iterations, what was left out.

    Raises:
        InputError: what the datum rests on does not fix it.
    """
    system = equations.system
    unknowns = [equations.centres, equations.rotations, equations.points, *equations.instruments]
    groups = [ids for ids in unknowns if ids.size] + [ids[None] for ids in equations.calibrations]
    chosen = datum_blocks(equations, datum)
    before, wanted = [system.values(ids) for ids in groups], system.values(chosen)
    done: tuple[Iteration, ...] = ()
    dropped: tuple[LeftOut, ...] = ()
    damped: LeastSquaresResult | None = None
    if strategy == "levenberg-marquardt":
        done = approach(equations, strategy, solving)
        dropped = drop_undetermined(equations)
        damped, more, lost = solve_to_the_end(equations, strategy, solving, further)
        done, dropped = done + more, dropped + lost
    _move_back(equations, chosen, wanted, datum)
    after = [system.values(ids) for ids in groups]
    for ids, values in zip(groups, before, strict=True):
        system.set_values(ids, values)
    # the datum keeps the present values as its reference
    system.set_datum(chosen, motions=partial(_motions, equations) if _floats(equations) else None)
    for ids, values in zip(groups, after, strict=True):
        system.set_values(ids, values)
    result, more = _on_datum(system, chosen, damped, covariance, solving)
    return result, done + more, dropped


def _on_datum(
    system: LeastSquares,
    chosen: IntArray,
    damped: LeastSquaresResult | None,
    covariance: bool | None,
    solving: Solving,
) -> tuple[LeastSquaresResult, tuple[Iteration, ...]]:
    """The solution on its datum, and the steps to it; the damped one, where these lead nowhere better."""
    here = system.unknowns.state()
    try:
        result, done = _settled(system, chosen, covariance, solving)
    except (InputError, DivergenceError, SingularSystemError) as error:
        if damped is None:
            raise
        why: ObseqError = error
    else:
        if damped is None or _is_as_good(result, damped):
            return result, done
        why = SingularSystemError("steps on the datum lead away from the solution")
    system.set_datum(())
    system.unknowns.restore(here)
    return replace(damped, state=here, weak=damped.weak or why), ()


def _is_as_good(result: LeastSquaresResult, damped: LeastSquaresResult) -> bool:
    """Whether a solution on its datum is at least what the damped one is."""
    return result.converged >= damped.converged and result.cost <= (1.0 + HIGHER) * damped.cost


def _settled(
    system: LeastSquares, chosen: IntArray, covariance: bool | None, solving: Solving
) -> tuple[LeastSquaresResult, tuple[Iteration, ...]]:
    done: tuple[Iteration, ...] = ()
    extent = float(np.ptp(system.values(chosen), axis=0).max())
    for _ in range(SETTLINGS):
        before = system.values(chosen)
        settled = system.solve(strategy="gauss-newton", **solving).iterations
        done += settled
        if len(settled) == 1 and np.abs(system.values(chosen) - before).max() <= SETTLED * extent:
            break
    result = system.solve(strategy="gauss-newton", covariance=covariance, **solving)
    return result, done + result.iterations


def datum_blocks(equations: Equations, datum: str | Sequence[str]) -> IntArray:
    """The blocks of unknowns that a datum rests on: `centres`, `points`, or points by name."""
    if isinstance(datum, str):
        return equations.centres if datum == "centres" else equations.points
    return equations.points[index_of(equations.start.points, datum, "datum: point")]


def _move_back(
    equations: Equations, chosen: IntArray, wanted: FloatArray, datum: str | Sequence[str]
) -> None:
    """Moves a block that nothing but lengths, or a vertical, ties to the world onto its datum."""
    if not _floats(equations):
        return
    system, axis = equations.system, _axis(equations)
    try:
        scale, motion = similarity(system.values(chosen), wanted, not _has_scale(equations), axis)
    except InputError as error:
        raise InputError(_too_little(datum, str(error))) from None
    for ids in (equations.centres, equations.points):
        system.set_values(ids, motion.centre + scale * system.values(ids) @ motion.rotation.T)
    for part in equations.rigid:
        system.set_values(part.centres, scale * system.values(part.centres))
    _turn(equations, motion)


def _motions(equations: Equations, places: FloatArray) -> FloatArray:
    """(n, 3, k) how places (n, 3) move with a block that floats: shifted, turned, larger if it has no scale.

    None of these changes a residual, which rounding may hide in the normal matrix.
    """
    arms = places - places.mean(axis=0)
    shifts = np.broadcast_to(np.eye(3), (len(arms), 3, 3))
    axis = _axis(equations)
    axes = np.eye(3) if axis is None else axis[None]
    turns = np.cross(axes, arms[:, None]).swapaxes(1, 2)
    sizes = np.zeros((len(arms), 3, 0)) if _has_scale(equations) else arms[:, :, None]
    alone = np.concatenate([shifts, turns, sizes], axis=2).reshape(3 * len(arms), -1)
    return np.asarray(np.linalg.qr(alone)[0].reshape(*places.shape, -1))


def _too_little(datum: str | Sequence[str], why: str) -> str:
    """Why a datum fixes no position, orientation and scale, and what would."""
    lacking = "fixes no position, orientation and scale"
    if not isinstance(datum, str):
        return f"the datum on {', '.join(datum[:5])} {lacking}: {why}; choose others, not all on a line"
    other = "points" if datum == "centres" else "centres"
    return (
        f"the datum on {datum} {lacking}: {why}. It takes three that are not on one line; take the "
        f"other (--datum {other}, datum='{other}' in Python), or measure more"
    )


def _turn(equations: Equations, motion: RigidMotion) -> None:
    system = equations.system
    system.set_values(equations.rotations, motion.rotation @ system.values(equations.rotations))


def _floats(equations: Equations) -> bool:
    """Whether a motion of images and points changes no residual, and moves nothing that is held.

    A rigid one; one that keeps the vertical where clinometers refer to it (`_axis`).
    """
    block = equations.block
    tied: list[Sized] = [
        block.surveys,
        block.pose_observations,
        block.antennas,
        block.shutters,
        block.instruments.inclinations if block.instruments.vertical_is_free else (),
        block.fixed_centres,
        block.fixed_rotations,
        np.flatnonzero(~equations.start.is_free.all(axis=1)),
    ]
    return not any(len(part) for part in tied)


def _axis(equations: Equations) -> FloatArray | None:
    """(3,) the vertical about which alone a block may turn; None where nothing refers to it."""
    instruments = equations.block.instruments
    if not instruments.are_read:
        return None
    vertical = np.array(instruments.vertical)
    return np.asarray(vertical / np.linalg.norm(vertical))


def _has_scale(equations: Equations) -> bool:
    block = equations.block
    return bool(block.lengths.values) or any(rigid.has_scale for rigid in block.rigid_blocks)
