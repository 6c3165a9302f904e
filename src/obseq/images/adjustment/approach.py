"""The way to a solution from rough poses, or with robust weights: what is hard in the end is soft before.

From rough poses nothing is weakened: residuals of hundreds of pixels say nothing of single measures.
Thresholds come last, when they mean what they say.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.errors import SingularSystemError
from obseq.images.adjustment.equations import Equations, MeasureBatch
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.adjustment.start import LeftOut, put_points
from obseq.images.adjustment.verdicts import cameras_refused
from obseq.images.camera import Camera
from obseq.images.initial.intersection import intersect
from obseq.images.initial.rough import ROUGH
from obseq.images.names import are_among
from obseq.images.poses import Poses
from obseq.leastsquares import Batch, Iteration, LeastSquaresResult
from obseq.leastsquares.problem.losses import Attenuated, Loss
from obseq.leastsquares.solution.result import StopReason

Solving: TypeAlias = dict[str, Any]
"""What `LeastSquares.solve` is given."""
STEPS, ROUNDS = 8, 12
RECALLS = 3
"""Solutions that are tried where points run away."""
NO_MORE = 0.9
"""What is left of the misfit after a round that has brought too little."""
LOST = 10.0
"""Times the usual distance from its rays, or `ROUGH` if that is more, where a given point is lost."""
NEAR = 0.5
"""Standard deviations by which unknowns may still move where the usual number of iterations is too small.

They are those of the given sigmas, or of the residuals where these are larger.
"""
LOOSE = 0.1
"""Share of its standard deviation by which an unknown may still move when a stage ends."""


def approach(equations: Equations, strategy: str, solving: Solving) -> tuple[Iteration, ...]:
    """The iterations before the last solution; the losses are as they were afterwards."""
    batches = _weakened(equations)
    losses = [batch.loss for batch in batches]
    own = [loss for loss in losses if isinstance(loss, Attenuated)]
    done: tuple[Iteration, ...] = ()
    try:
        if equations.start.misfit > ROUGH:
            _set_losses(batches, [None] * len(batches))
            done += _come_near(equations, strategy, solving)
        elif len(own) == len(losses):  # with other losses points of blunders are where they belong
            _place_lost(equations)
        if any(loss.threshold for loss in own):
            _set_losses(batches, [_soft(loss) if isinstance(loss, Attenuated) else loss for loss in losses])
            done += equations.system.solve(strategy=strategy, **{**solving, "tolerance": LOOSE}).iterations
    finally:
        _set_losses(batches, losses)
    return done


def _set_losses(batches: Sequence[Batch], losses: Sequence[Loss | None]) -> None:
    for batch, loss in zip(batches, losses, strict=True):
        batch.loss = loss


def _come_near(equations: Equations, strategy: str, solving: Solving) -> tuple[Iteration, ...]:
    """A few steps, after which points are put where their rays meet: until these do.

    Steps alone would drive points away where the rays of rough poses diverge. No point is eliminated here:
    steps are damped in all unknowns then.
    """
    gone = equations.eliminated
    if gone.size:
        equations.system.eliminate(gone, False)
    few = {**solving, "tolerance": LOOSE, "max_iterations": STEPS}
    done: tuple[Iteration, ...] = ()
    off = equations.start.misfit
    for _ in range(ROUNDS):
        with suppress(SingularSystemError):  # a point that has run away: it is called back
            result = equations.system.solve(strategy=strategy, **few)
            done += result.iterations
            if result.converged and not result.weak and _misses(equations)[1].max(initial=0.0) <= ROUGH:
                break
        before, off = off, _put_again(equations, _are_free(equations))[0]
        if off <= ROUGH or off > NO_MORE * before:
            break
    if gone.size:
        equations.system.eliminate(gone)
    return done


def _place_lost(equations: Equations) -> None:
    """Puts free points where their rays meet which were given far from there, where the others are not."""
    if not equations.measures:
        return
    point, misses = _misses(equations)
    if misses.max() <= LOST * ROUGH:
        return
    squares = np.bincount(point, misses**2, len(equations.start.points))
    usual = max(ROUGH, float(np.median(misses)))
    counts = np.maximum(np.bincount(point, minlength=len(squares)), 1)
    lost = _are_free(equations) & ~(squares <= (LOST * usual) ** 2 * counts)
    if lost.any():
        _put_again(equations, lost)


def _misses(equations: Equations) -> tuple[IntArray, FloatArray]:
    """(m,) points of the measures that count, and (m,) by how many pixels their rays miss these now."""
    measures = [(item, item.batch.active) for item in equations.measures]
    residuals = [equations.system.residuals(item.batch)[active] for item, active in measures]
    points = [equations.start.sets[item.part].point[item.rows[active]] for item, active in measures]
    return np.concatenate(points), np.hypot(*np.concatenate(residuals).T)


def _are_free(equations: Equations) -> BoolArray:
    """(n,) whether nothing but images says where a point is."""
    start = equations.start
    return np.asarray(start.is_free.all(axis=1) & ~are_among(start.points, equations.block.joined_points))


def _put_again(equations: Equations, free: BoolArray) -> tuple[float, dict[int, str]]:
    """Puts points where their rays meet at the present state.

    Returns:
        By how many pixels the rays miss them, in the median; why points have no such place, by number.
    """
    start, system = equations.start, equations.system
    poses = Poses(
        start.poses.images,
        system.values(equations.centres),
        system.values(equations.rotations),
        start.poses.cameras,
    )
    coordinates = system.values(equations.points)
    coordinates[free] = np.nan
    reasons, off = put_points(coordinates, free, poses, _present_cameras(equations), start.points, start.sets)
    placed = free & np.isfinite(coordinates).all(axis=1)
    if placed.any():
        system.set_values(equations.points[placed], coordinates[placed])
    return off, reasons


def solve_to_the_end(
    equations: Equations, strategy: str, solving: Solving, further: int, covariance: bool | None = None
) -> tuple[LeastSquaresResult, tuple[Iteration, ...], tuple[LeftOut, ...]]:
    """The solution, its iterations, and the points that had to be left out on the way.

    Args:
        equations: of the block.
        strategy: of the iterations.
        solving: how many iterations, and the rest.
        further: how many more there may be where these have come near.
        covariance: whether one is wanted.

    Raises:
        SingularSystemError: something is undetermined.
    """
    result, lost = _solve_calling_back(equations, strategy, solving, covariance)
    done = result.iterations
    if further and _has_come_near(result):
        more = {**solving, "max_iterations": further}
        result, dropped = _solve_calling_back(equations, strategy, more, covariance)
        done, lost = done + result.iterations, lost + dropped
    return result, done, lost


def _has_come_near(result: LeastSquaresResult) -> bool:
    """Whether iterations that ended at their number were about to arrive."""
    if result.stop_reason is not StopReason.ITERATIONS or not result.iterations:
        return False
    last = result.iterations[-1]
    return last.length <= NEAR * max(last.sigma0 or 1.0, 1.0)


def _solve_calling_back(
    equations: Equations, strategy: str, solving: Solving, covariance: bool | None
) -> tuple[LeastSquaresResult, tuple[LeftOut, ...]]:
    """The solution, and the points that had to be left out on the way.

    A point whose rays are nearly parallel may run away while poses are still rough. It is put back to where
    its rays meet; those of which even good poses make no point are left out the second time. A solution that
    leaves something weak is better than none.

    Raises:
        SingularSystemError: something is undetermined from the start.
    """
    lost: tuple[LeftOut, ...] = ()
    found: LeastSquaresResult | None = None
    for attempt in range(RECALLS):
        is_last = attempt == RECALLS - 1
        try:
            result = equations.system.solve(strategy=strategy, covariance=covariance, **solving)
        except SingularSystemError:
            if found is not None:
                equations.system.unknowns.restore(found.state)
                return found, lost
            if is_last or not _has_tie_points(equations):
                raise
            lost += _call_back(equations, attempt > 0)
            continue
        if is_last or (result.converged and not result.weak):
            break
        if result.weak:
            if not _has_tie_points(equations):
                break
            found = result
            lost += _call_back(equations, attempt > 0)
            continue
        if len(result.iterations) >= solving["max_iterations"]:
            break
        _call_back(equations, leave_out=False)
    return result, lost


def _has_tie_points(equations: Equations) -> bool:
    return bool(equations.start.is_free.all(axis=1).any())


def _call_back(equations: Equations, leave_out: bool) -> tuple[LeftOut, ...]:
    """Puts points where their rays meet; leaves out those whose rays do not, if that is asked for."""
    reasons = _put_again(equations, _are_free(equations))[1]
    if not leave_out or not reasons:
        return ()
    lost = np.zeros(len(equations.start.points), dtype=bool)
    lost[list(reasons)] = True
    _switch_off(equations, lost)
    return tuple(LeftOut("point", equations.start.points[k], reasons[k]) for k in sorted(reasons))


def _present_cameras(equations: Equations) -> list[Camera]:
    """The camera of each image with its present parameters."""
    ids = dict(zip(equations.cameras, equations.calibrations.tolist(), strict=True))
    values = equations.system.values
    used = {camera.name: camera for camera in equations.start.cameras}
    with cameras_refused():
        present = {name: camera.with_parameters(values([ids[name]])[0]) for name, camera in used.items()}
    return [present[camera.name] for camera in equations.start.cameras]


def _weakened(equations: Equations) -> list[Batch]:
    return [item.batch for item in equations.measures if item.batch.loss is not None]


def _soft(loss: Attenuated) -> Attenuated:
    """A loss without its threshold; where it is nothing else, one that weakens what lies about there."""
    if loss.attenuation is None and loss.threshold is not None:
        return Attenuated(loss.threshold, None, 2.0)
    return replace(loss, threshold=None)


def drop_undetermined(equations: Equations) -> tuple[LeftOut, ...]:
    """Leaves out the free points of which thresholds keep fewer than two measures, at the present state.

    Their measures are switched off, and the points stay where they are.
    """
    batches = _weakened(equations)
    if not any(isinstance(batch.loss, Attenuated) and batch.loss.threshold for batch in batches):
        return ()
    start = equations.start
    kept, all_of = (np.zeros(len(start.points), dtype=np.int64) for _ in range(2))
    for item in equations.measures:
        points = start.sets[item.part].point[item.rows]
        all_of += np.bincount(points[item.batch.active], minlength=len(kept))
        kept += np.bincount(points[item.batch.active & _weighs(equations, item)], minlength=len(kept))
    lost = (kept < 2) & (kept < all_of) & _are_free(equations)
    if lost.any():
        _switch_off(equations, lost)
    reason = "of its {} measures, {} are beyond the threshold"
    return tuple(
        LeftOut("point", start.points[k], reason.format(all_of[k], all_of[k] - kept[k]))
        for k in np.flatnonzero(lost)
    )


def taken_in_again(solution: BundleSolution) -> dict[str, FloatArray]:
    """Where points are whose rays met nowhere at first, and do at the poses that were found."""
    start = solution.start
    lost = {item.name for item in start.left_out if item.kind == "point"}
    found: dict[str, FloatArray] = {}
    for part in solution.block.sets if lost else ():
        rays = part.measures.of_points(sorted(lost & {*part.measures.point_names}))
        if not len(rays):
            continue
        cameras = [solution.cameras[name] for name in solution.poses.cameras]
        met = intersect(rays, solution.poses, cameras)
        off = np.zeros(len(met.names))
        np.maximum.at(off, rays.point, np.nan_to_num(np.linalg.norm(met.residuals, axis=1), nan=np.inf))
        for k in np.flatnonzero(met.is_placed & (off <= ROUGH)):
            found[met.names[k]] = met.coordinates[k]
    return found


def _switch_off(equations: Equations, points: BoolArray) -> None:
    for item in equations.measures:
        own = equations.start.sets[item.part].point[item.rows]
        item.batch.active = item.batch.active & ~points[own]
    equations.system.freeze(equations.points[points])


def _weighs(equations: Equations, item: MeasureBatch) -> BoolArray:
    """(n,) measures of a batch that its loss leaves some weight."""
    if item.batch.loss is None:
        return np.ones(len(item.rows), dtype=bool)
    sigmas = equations.start.sets[item.part].given.measures.sigmas[item.rows]
    norms = np.linalg.norm(equations.system.residuals(item.batch) / sigmas, axis=1)
    return np.asarray(item.batch.loss.weights(norms) > 0.0)
