"""A set-up that is not where it is written to be: on another point, or beside its own.

Its sights agree with each other and contradict all others at its point. So the instrument gets a place of its
own, and the network is computed anew: its place then tells whether the name of the station is wrong.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import codes_for
from obseq.survey.model import Stations, group_by_station, join
from obseq.survey.points import merge_points
from obseq.survey.screening.field_blocks import blocks_of
from obseq.survey.screening.findings import Cause, GrossError, coordinates_told
from obseq.survey.screening.known_points import sought_at
from obseq.survey.screening.robust import GROSS, QUICK
from obseq.survey.screening.target_names import target_name_cause
from obseq.survey.screening.trials import Trials, estimated

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import FloatArray
    from obseq.survey.adjustment.point_system import PointSystem
    from obseq.survey.model import FieldBook, Points
    from obseq.survey.screening.robust import Estimate

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_LEAST = 3
"""Suspects at a point from which its set-ups are thought of."""
_SPARE = 3
"""Observations that a set-up needs beyond those that give it its place and its turn."""
_MOST = 4
"""Set-ups that are tried, those with the most suspects."""
_GAIN = 0.65
"""Contradictions, for each suspect at its point, that another place of a set-up must remove."""
_SAME = 0.5
"""Distance (m) from a point within which a set-up is tried on it."""
_EQUAL = 0.1
"""Contradictions by which two explanations may differ that are as good."""
_BESIDE = 5.0
"""Distance (m) up to which an instrument is said to stand beside its point."""


@dataclass(frozen=True, eq=False)
class _SetUp:
    """Observations that follow each other from one point, of one station at most, and the suspects there."""

    point: int
    rows: Rows
    suspects: Rows


@dataclass(frozen=True, eq=False)
class _Moved:
    """A set-up with a place of its own: the place (3,), the network with it, and what this leaves."""

    set_up: _SetUp
    place: FloatArray
    estimate: Estimate
    left: float


def standpoint_cause(trials: Trials, system: PointSystem) -> tuple[GrossError, Estimate] | None:
    """The set-up that stands elsewhere, with the network in which it does; None when there is none."""
    found: list[_Moved] = []
    set_ups = sorted(_set_ups(trials.found), key=lambda one: -len(one.suspects))
    for one in set_ups[: min(_MOST, trials.most)]:
        moved = _moved(trials, one)
        if moved is not None:
            found.append(moved)
        if moved is not None and trials.is_decisive(moved.estimate):
            break
    if not found:
        return None
    best = min(found, key=lambda one: one.left)
    return _on_another_point(trials, best) or _seen_wrongly(trials, best) or _described(trials, system, best)


def _set_ups(found: Estimate) -> Iterator[_SetUp]:
    """Set-ups at points with many suspects, which have observations to spare."""
    observations = found.book.observations
    ends = observations.from_points, observations.to_points
    suspects = observations.active & (found.ratios > found.limit)
    named = np.concatenate([end[suspects] for end in ends])
    count = np.bincount(named, minlength=len(found.book.point_names))
    read = codes_for(Start.HZ, Start.ZENITH, Start.DISTANCE, Start.FLAT, Start.ANGLE)
    chosen = observations.active & np.isin(observations.types, read) & (count[ends[0]] >= _LEAST)
    for rows in blocks_of(found.book, np.flatnonzero(chosen)):
        point = int(ends[0][rows[0]])
        mine = suspects & (ends[1] == point)
        mine[rows] = suspects[rows]
        spare = len(rows) - int(sought_at(found.points, point).sum()) - 1
        if mine.sum() >= _LEAST and spare >= _SPARE:
            yield _SetUp(point, rows, np.flatnonzero(mine))


def _moved(trials: Trials, one: _SetUp) -> _Moved | None:
    """A set-up with a place of its own, where that explains what contradicts at its point."""
    points, name = _with_another(trials.found.points, one.point)
    points, book = join(points, renamed(trials.found.book, one.rows, name))
    estimate = trials.explaining(points, book)
    if estimate is None or (estimate.ratios[one.rows] > estimate.limit).any():
        return None
    place, left = estimate.coordinates[points.index[name]], estimate.disagreement(GROSS)
    if not np.isfinite(place).all() or trials.before - left < _GAIN * len(one.suspects):
        return None
    return _Moved(one, place, estimate, left)


def _with_another(points: Points, row: int) -> tuple[Points, str]:
    """The points with one more, which is known as far as all are, and its name."""
    name = f"{points.names[row]}, where it stands"
    other = replace(points.subset(np.array([row])), names=(name,), covariance=None)
    wanted = sought_at(points, row)[None, :]
    coordinates, sigmas = (np.where(wanted, np.nan, part) for part in (other.coordinates, other.sigmas))
    return merge_points([points, replace(other, coordinates=coordinates, sigmas=sigmas)]), name


def renamed(book: FieldBook, rows: Rows, name: str) -> FieldBook:
    """The observations, with some of one station made at another point, in a set-up of their own."""
    names = book.point_names if name in book.point_names else (*book.point_names, name)
    observations, number, n = book.observations, names.index(name), len(book.stations)
    origins, stations = observations.from_points.copy(), observations.stations.copy()
    origins[rows] = number
    mine = rows[stations[rows] >= 0]
    station = int(stations[mine[0]]) if len(mine) else -1
    all_origins, orientations = book.stations.origins.copy(), book.stations.orientations
    if station >= 0 and np.isin(book.stations.observations(station), rows).all():
        all_origins[station] = number
    elif station >= 0:
        stations[mine] = n
        all_origins = np.append(all_origins, np.int32(number))
        orientations = np.append(orientations, orientations[station])
    grouped = Stations(all_origins, orientations, *group_by_station(stations, len(all_origins)))
    changed = replace(observations, from_points=origins, stations=stations)
    return replace(book, point_names=names, observations=changed, stations=grouped)


def _on_another_point(trials: Trials, moved: _Moved) -> tuple[GrossError, Estimate] | None:
    """The point on which a set-up stands instead, with the network in which it does."""
    found, one = trials.found, moved.set_up
    away = np.linalg.norm(moved.estimate.coordinates[: len(found.points)] - moved.place, axis=1)
    seen = found.book.observations.to_points[one.rows]
    for row in np.flatnonzero(away < _SAME).tolist():
        if row == one.point or row in seen:
            continue
        fits = trials.explaining(found.points, renamed(found.book, one.rows, found.points.names[row]))
        if fits is not None and not (fits.ratios[one.rows] > fits.limit).any():
            names = found.points.names[one.point], found.points.names[row]
            text = f"they fit {names[1]}, not {names[0]}: the name of the station is wrong"
            return _error(found, one, Cause.WRONG_POINT, text, names), fits
    return None


def _seen_wrongly(trials: Trials, moved: _Moved) -> tuple[GrossError, Estimate] | None:
    """The sights to the point of a set-up that are to another, where it is they that put it elsewhere."""
    found = trials.found
    start = trials.start(found.points, found.book)
    if start is None:
        return None
    start = found.places_in(start)
    start.initial.coordinates[start.points.index[found.points.names[moved.set_up.point]]] = moved.place
    there = estimated(trials.model, found.points, found.book, QUICK, start)
    step = None if there is None else target_name_cause(Trials(trials.model, there))
    return step if step and step[1].disagreement(GROSS) <= moved.left + _EQUAL else None


def _described(trials: Trials, system: PointSystem, moved: _Moved) -> tuple[GrossError, Estimate]:
    found, one = trials.found, moved.set_up
    name = found.points.names[one.point]
    away = float(np.linalg.norm(moved.estimate.coordinates[one.point] - moved.place))
    given = system.coordinates(moved.place[None, :])[0].tolist()
    shown = [next(coordinates_told(found.units, system, k, value)) for k, value in enumerate(given)]
    where = f"they fit an instrument at ({', '.join(shown)}), {found.units.length.text(away)} from {name}"
    if away > _BESIDE:
        return _error(
            found, one, Cause.WRONG_POINT, f"{where}: likely another station", (name,)
        ), moved.estimate
    text = f"{where}: likely an eccentric set-up, or one that was not centred"
    return _error(found, one, Cause.ECCENTRIC, text, (name,)), moved.estimate


def _error(found: Estimate, one: _SetUp, cause: Cause, text: str, points: tuple[str, ...]) -> GrossError:
    name, label = found.points.names[one.point], found.book.label(int(one.rows[0]))
    what = f"the {len(one.rows)} observations of a set-up of {name} (the first: {label})"
    rows = tuple(np.union1d(one.rows, one.suspects).tolist())
    return GrossError(what, cause, text, float(found.ratios[one.suspects].max()), rows, points)
