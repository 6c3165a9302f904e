"""Known points that are wrong: easting and northing swapped, names exchanged, a digit mistyped.

As for groups, each cause is tried: the point is put right, or taken as unknown, and the network is computed
anew.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.dataclass import dataclass
from obseq.errors import ObseqError
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.screening.findings import Cause, GrossError, any_of, coordinates_told, units_of_coordinate
from obseq.survey.screening.robust import GROSS, Estimate, solved
from obseq.survey.screening.substitutes import End, tolerance_of, with_every_point
from obseq.survey.screening.values import COORDINATE, FEET, are_feet, difference, explain

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import BoolArray, FloatArray
    from obseq.report.units import Units
    from obseq.survey.adjustment.point_system import PointSystem
    from obseq.survey.model import Points
    from obseq.survey.screening.trials import Trials

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_MOST_POINTS = 8
_MOST_EXCHANGED, _SMALL = 4, 60
"""Known points of which each two may be exchanged; all of them in a network of so few observations."""
_ASTRAY = 100.0
"""How many times farther from the others a point is not when it is put right."""
_NEAR = 0.05
"""Distance (m), beyond the sigmas, at which two places are the same."""
_LEAST_NEAR, _SIGMAS = 0.005, 3.0
"""How near (m, sigmas of the place) a slip of the pen must come to the observations."""
_SHARES = (1.0 / _SIGMAS, 1.0, 4.0)
"""What fits nearer is thought of first; what fits less well says less, and is believed of large errors only:
the other known points have errors too."""
_AXES = ("easting (x)", "northing (y)", "height")


@dataclass(frozen=True, eq=False)
class _Trial:
    cause: Cause
    text: str
    points: Points
    rows: tuple[int, ...]


def known_point_cause(trials: Trials, system: PointSystem) -> tuple[GrossError, Estimate] | None:
    """The wrong known point that explains most contradictions, with the network without it."""
    found, all_trials = trials.found, list(_trials(system, trials.found))
    best: tuple[float, _Trial, Estimate] | None = None
    if len(all_trials) > trials.most:
        trials.untried.append(f"{len(all_trials) - trials.most} more mistakes of known points")
    for trial in all_trials[: trials.most]:
        if not _may_be(trials, trial):
            continue
        corrected = trials.explaining(trial.points, found.book)
        if corrected is None or not np.isfinite(corrected.coordinates[list(trial.rows)]).all():
            continue
        left = corrected.disagreement(GROSS)
        if best is None or left < best[0] - 0.3:
            best = (left, trial, corrected)
        if trials.is_decisive(corrected):
            break
    if best is None:
        return None
    equal = _as_good(trials, best, all_trials)
    told = [(*_described(trials, system, trial, there), there) for trial, there in equal]
    likely = [one for one in told if one[1]] or told
    return any_of([error for error, *_ in likely]), likely[0][2]


def swapped_point_cause(trials: Trials, system: PointSystem) -> tuple[GrossError, Estimate] | None:
    """The known point whose swapped easting and northing one observation alone contradicts; None for none.

    A point at about the same distance when they are swapped shows it in one direction only.
    """
    found, row = trials.found, int(trials.found.suspects[0])
    observations, value = found.book.observations, float(found.book.observations.values[row])
    kind = BY_CODE[int(observations.types[row])]
    if kind.start not in (Start.HZ, Start.ANGLE, Start.DISTANCE, Start.FLAT):
        return None
    for end, which in ((End.TARGET, observations.to_points), (End.ORIGIN, observations.from_points)):
        point = int(which[row])
        is_known = not found.points.is_free[point].all() and found.points.has_coordinates[point]
        for trial in _swapped(system, found.points, np.array([point]), "") if is_known else ():
            there = replace(found, coordinates=found.coordinates.copy())
            there.coordinates[point] = trial.points.coordinates[point]
            expected = float(with_every_point(there, row, end)[point])
            if not abs(difference(kind, value, expected)) <= 2.0 * tolerance_of(found, row):
                continue
            corrected = trials.explaining(trial.points, found.book)
            if corrected is not None and trials.is_decisive(corrected):
                return _described(trials, system, trial, corrected)[0], corrected
    return None


def _may_be(trials: Trials, trial: _Trial) -> bool:
    """Whether the others agree without what sees one or two points that may be wrong; yes for more points."""
    if len(trial.rows) > 2:
        return True
    book, points = trials.found.book, np.zeros(len(trials.found.book.point_names), np.bool_)
    points[list(trial.rows)] = True
    return trials.may_be_of(np.flatnonzero(book.naming(points)).astype(np.int32))


def _as_good(
    trials: Trials, best: tuple[float, _Trial, Estimate], all_trials: list[_Trial]
) -> list[tuple[_Trial, Estimate]]:
    """The best trial, and that of the other known point where there are two: it may explain as much."""
    left, trial, corrected = best
    equal = [(trial, corrected)]
    if trial.cause is not Cause.MISTYPED:
        return equal
    points, sought = trials.found.points, sought_at(trials.found.points, trial.rows[0])
    known = np.flatnonzero(~points.is_free[:, sought].any(axis=1)).tolist()
    for other in all_trials:
        if len(known) == 2 and other.cause is trial.cause and other is not trial and other.rows[0] in known:
            found = trials.explaining(other.points, trials.found.book)
            if found is not None and found.disagreement(GROSS) < left + 0.3:
                equal.append((other, found))
    return equal


def _trials(system: PointSystem, found: Estimate) -> Iterator[_Trial]:
    """What may be wrong, the most particular first."""
    yield from _swapped(system, found.points, np.flatnonzero(found.points.has_coordinates), "all points")
    yield from _in_other_units(system, found.points, found.units)
    candidates = _candidates(found)
    for row in candidates:
        alone = _swapped(system, found.points, np.array([row]), "")
        yield from (trial for trial in alone if not _strays(found.points, trial))
    pairs = list(itertools.combinations(candidates, 2))
    likely = [pair for pair in pairs if set(pair) <= set(candidates[:_MOST_EXCHANGED])]
    yield from (_exchanged(found, pair) for pair in likely)
    yield from _unknown(found, candidates)
    if np.count_nonzero(found.book.observations.active) <= _SMALL:
        yield from (_exchanged(found, pair) for pair in pairs if pair not in likely)


def _exchanged(found: Estimate, pair: tuple[int, int]) -> _Trial:
    coordinates = found.points.coordinates.copy()
    coordinates[list(pair)] = coordinates[list(pair[::-1])]
    text = "the coordinates of these two points are exchanged, or their names"
    return _Trial(Cause.SWAPPED_NAMES, text, replace(found.points, coordinates=coordinates), pair)


def _unknown(found: Estimate, candidates: list[int]) -> Iterator[_Trial]:
    """Known points taken as unknown, where places in plan are sought and something is spare.

    Of two known points each explains as much as the other, also one that its observations just determine.
    """
    counts, is_pair = _observation_counts(found), np.count_nonzero(~found.points.is_free.all(axis=1)) == 2
    for row in candidates:
        sought = sought_at(found.points, row)
        if sought[0] and counts[row] + is_pair > sought.sum():
            yield _Trial(Cause.MISTYPED, "", _without(found.points, row, sought), (row,))


def _swapped(system: PointSystem, points: Points, rows: Rows, who: str) -> Iterator[_Trial]:
    """Points with their first two coordinates exchanged."""
    coordinates = points.coordinates.copy()
    given = system.coordinates(coordinates[rows])
    try:
        coordinates[rows] = system.placed(given[:, [1, 0, 2]])
    except ObseqError:
        return
    if np.isfinite(coordinates[rows]).all() and np.abs(given[:, 0] - given[:, 1]).max() > _NEAR:
        text = f"easting and northing of {who or 'the point'} look swapped"
        which = tuple(rows.tolist())
        yield _Trial(Cause.SWAPPED_COORDINATES, text, replace(points, coordinates=coordinates), which)


def _strays(points: Points, trial: _Trial) -> bool:
    """Whether a point put right is far off all others, and it is among them as it is."""
    row = trial.rows[0]
    others = points.coordinates[points.has_coordinates & (np.arange(len(points)) != row)]
    before, after = (np.linalg.norm(others - one.coordinates[row], axis=1) for one in (points, trial.points))
    return bool(len(others) and after.min() > _ASTRAY * before.max())


def _in_other_units(system: PointSystem, points: Points, units: Units) -> Iterator[_Trial]:
    """All points with heights, or all coordinates, in feet where metres are meant, and the reverse.

    Where the files are in feet only the reverse.
    """
    mistakes = [(FEET, "feet where metres are meant"), (1.0 / FEET, "metres read as feet")]
    if are_feet(units):
        mistakes = [(units.written.length.factor, "metres read as feet")]
    rows = np.flatnonzero(points.has_coordinates)
    given = system.coordinates(points.coordinates[rows])
    is_plane = system.system.kind is crs.Kind.LOCAL
    for axes, what in (((2,), "heights"), ((0, 1, 2), "coordinates"))[: 2 if is_plane else 1]:
        for factor, unit in mistakes:
            right = given.copy()
            right[:, axes] *= factor
            coordinates = points.coordinates.copy()
            coordinates[rows] = system.placed(right)
            text = f"{what} of all points look like {unit}"
            yield _Trial(Cause.UNITS, text, replace(points, coordinates=coordinates), tuple(rows.tolist()))


def _candidates(found: Estimate) -> list[int]:
    """Known points, those with the most suspects first."""
    observations = found.book.observations
    known = np.flatnonzero(~found.points.is_free.all(axis=1) & found.points.has_coordinates)
    count = np.zeros(len(found.book.point_names))
    weights = np.minimum(found.ratios / GROSS, 1.0) * observations.active
    for ends in (observations.from_points, observations.to_points):
        count += np.bincount(ends, weights, minlength=len(count))
    ordered = known[np.argsort(-count[known], kind="stable")]
    return [int(row) for row in ordered[:_MOST_POINTS] if count[row] > 0.0]


def _observation_counts(found: Estimate) -> FloatArray:
    observations, n = found.book.observations, len(found.book.point_names)
    active = observations.active
    return np.asarray(
        np.bincount(observations.from_points[active], minlength=n)
        + np.bincount(observations.to_points[active], minlength=n)
    )


def sought_at(points: Points, row: int) -> BoolArray:
    """(3,) the coordinates that a point lacks when it is not known: in plan, in height, as other points."""
    others = points.is_free[np.arange(len(points)) != row]
    return np.repeat([others[:, :2].any(), others[:, 2].any()], (2, 1))


def _without(points: Points, row: int, sought: BoolArray) -> Points:
    """The points with some coordinates of one of them unknown."""
    coordinates, sigmas = points.coordinates.copy(), points.sigmas.copy()
    coordinates[row, sought] = sigmas[row, sought] = np.nan
    return replace(points, coordinates=coordinates, sigmas=sigmas)


def _described(
    trials: Trials, system: PointSystem, trial: _Trial, corrected: Estimate
) -> tuple[GrossError, bool]:
    """What is wrong, and whether it is a usual slip."""
    found, rows = trials.found, list(trial.rows)
    points = found.points
    names = tuple(points.names[row] for row in rows)
    mine = np.isin(found.book.observations.from_points, rows) | np.isin(
        found.book.observations.to_points, rows
    )
    explains = np.flatnonzero(mine & (found.ratios > GROSS))
    size = float(found.ratios[explains].max(initial=0.0))
    cause, text, is_slip = trial.cause, trial.text, True
    if cause is Cause.MISTYPED:
        near = _precisions(trials, system, rows[0], corrected)
        cause, text, is_slip = _of_coordinates(system, found, rows[0], corrected, near)
    listed = [f"{points.names[row]} ({points.place(row)})" for row in rows[:6]]
    what = f"known point {' and '.join(listed)}" if len(rows) <= 2 else f"points {', '.join(listed)}"
    return GrossError(what, cause, text, size, tuple(explains.tolist()), names), is_slip


def _precisions(trials: Trials, system: PointSystem, row: int, corrected: Estimate) -> FloatArray:
    """(3,) how near the observations place a point, in units of its coordinates; NaN where nothing says."""
    place, name = corrected.coordinates[[row]], corrected.points.names[row]
    axes, units = system.axes(place)
    try:
        equations = trials.model.equations(corrected.end)
        at = equations.points[[corrected.end.points.index[name]]]
        solution = solved(equations, max_iterations=0, covariance=True)
        covariance = axes[0] @ solution.covariance(at, a_priori=True)[0] @ axes[0].T
    except ObseqError:
        return np.full(3, np.nan)
    near = np.maximum(_LEAST_NEAR, _SIGMAS * corrected.scale * np.sqrt(np.diagonal(covariance)))
    return np.asarray(near / units[0])


def _of_coordinates(
    system: PointSystem, found: Estimate, row: int, corrected: Estimate, near: FloatArray
) -> tuple[Cause, str, bool]:
    """What is wrong with the coordinates of a point that the observations place elsewhere; is it a slip?"""
    there = corrected.coordinates[row]
    known = np.flatnonzero(~found.points.is_free.all(axis=1) & found.points.has_coordinates)
    for other in known.tolist():
        if other != row and np.linalg.norm(found.points.coordinates[other] - there) < 10.0 * _NEAR:
            return (
                Cause.SWAPPED_NAMES,
                f"the observations place it at {found.points.names[other]}: wrong name",
                True,
            )
    given = system.coordinates(found.points.coordinates[[row]])[0]
    right = system.coordinates(there[None, :])[0]
    told = [coordinates_told(found.units, system, k, right[k], given[k] - right[k]) for k in range(3)]
    (x, off_x), (y, off_y), (z, off_z) = told
    place, gaps = f"{x}, {y}, {z}", (off_x, off_y, off_z)
    text = f"its coordinates are wrong; the observations place it at ({place})"
    off = [k for k in range(3) if abs(given[k] - right[k]) > 2.0 * _NEAR]
    if len(off) == 1:
        k = off[0]
        tolerances = (share * float(near[k]) for share in _SHARES if np.isfinite(near[k]))
        written = float(given[k]), float(right[k])
        units = units_of_coordinate(found.units, system, k)
        tried = (explain(COORDINATE, *written, tolerance, units) for tolerance in tolerances)
        explanation = next(filter(None, tried), None)
        if explanation is not None:
            return explanation.cause, f"{text}; {_AXES[k]}: {explanation.text}", True
        return Cause.MISTYPED, f"{text}; only the {_AXES[k]} differs, by {gaps[k]}", False
    return Cause.MISTYPED, text, False
