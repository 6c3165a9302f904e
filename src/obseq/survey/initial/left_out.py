"""A network without the points and stations that nothing determines, and without their observations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from obseq.arrays import BoolArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.records.adjustment import LeftOutRecord
from obseq.survey.initial.initial_values import InitialValues
from obseq.survey.initial.plan_only import are_in_plan_only
from obseq.survey.initial.rivals import unknown_zeros
from obseq.survey.initial.unplaced import Unplaced
from obseq.survey.kinds.registry import codes_where
from obseq.survey.model import FieldBook, IntArray, Points, group_by_station

_ONLY_LEVELLED = (
    ", or, if it is only levelled, give it flag 4 in its COR file (5 when its height is known), which holds "
    "its plan"
)

_LEVELLING = (
    "Plain levelling needs no plan: list each new point with flag 4 (4 NAME 0 0 0), each benchmark with flag "
    "5 and its height (5 NAME 0 0 HEIGHT SIGMA)"
)


@dataclass(frozen=True, eq=False)
class Determined:
    """What is left of a network: points, observations and initial values that belong together."""

    points: Points
    book: FieldBook
    initial: InitialValues
    left_out: tuple[LeftOutRecord, ...] = ()


def leave_out(given: Determined, undetermined: Sequence[Unplaced]) -> Determined:
    """The network without some points and stations, and without those that this leaves undetermined.

    Points with fewer observations than free coordinates go too. What had been left out before stays so.

    Args:
        given: a network.
        undetermined: points and stations (rows in it) with the reasons.

    Raises:
        InputError: nothing that is unknown would remain; the message lists everything with its reason.
    """
    found = list(undetermined)
    bad_points, bad_stations = _masks(given, found)
    while True:
        lacking = _lacking(given, bad_points, bad_stations)
        if not lacking:
            break
        found += lacking
        bad_points[[item.point for item in lacking]] = True
        bad_stations |= bad_points[given.book.stations.origins]
    if not found:
        return given
    active = _still_active(given.book, bad_points, bad_stations)
    _refuse_nothing(given, bad_points, active, found)
    of_point = _lost_by_point(given.book, given.book.observations.active & ~active)
    alone = [item for item in found if _stands_alone(given, item, bad_points)]
    named = tuple(_described(given, item, _lost(given.book, item, active, of_point)) for item in alone)
    return _without(given, bad_points, active, named)


def part_of(points: Points, book: FieldBook, kept: BoolArray) -> tuple[Points, FieldBook]:
    """Some of the points (a mask), as if they were not correlated, and nothing but what joins them."""
    active = _still_active(book, ~kept, ~kept[book.stations.origins])
    own = book.only(active)
    subset = replace(points.subset(np.flatnonzero(kept)), covariance=None)
    stations = _used_stations(own, own.observations.active)
    return subset, _book_without(own, ~kept, stations, own.observations.active)


def in_plan(given: Determined) -> Determined:
    """The network, with the heights as invented of points that are left with observations of their plan.

    What may see their heights goes to points that nothing places.

    Args:
        given: a network in a frame with heights, and initial values with the reasons for what they lack.
    """
    unplaced = given.initial.unplaced
    flat = {item.point: item.plan for item in unplaced if item.plan is not None}
    if not flat:
        return given
    others = [item for item in unplaced if item.point not in flat]
    rows = replace(given.book.observations, active=_still_active(given.book, *_masks(given, others)))
    found = are_in_plan_only(given.points, replace(given.book, observations=rows))
    coordinates, invented = given.initial.coordinates.copy(), given.points.is_invented.copy()
    for row, place in flat.items():
        if found[row]:
            coordinates[row], invented[row, 2] = place, True
    left = tuple(item for item in unplaced if item.point not in flat or not found[item.point])
    initial = replace(given.initial, coordinates=coordinates, unplaced=left)
    return replace(given, points=replace(given.points, invented=invented), initial=initial)


def _masks(given: Determined, found: Sequence[Unplaced]) -> tuple[BoolArray, BoolArray]:
    bad_points = np.zeros(len(given.points), np.bool_)
    bad_stations = np.zeros(len(given.book.stations), np.bool_)
    bad_points[[item.point for item in found if item.station is None]] = True
    bad_stations[[item.station for item in found if item.station is not None]] = True
    return bad_points, bad_stations | bad_points[given.book.stations.origins]


def _still_active(book: FieldBook, bad_points: BoolArray, bad_stations: BoolArray) -> BoolArray:
    rows = book.observations
    padded = np.append(bad_points, np.zeros(len(book.point_names) - len(bad_points), np.bool_))
    touched = book.naming(padded)
    if len(bad_stations):
        touched |= (rows.stations >= 0) & bad_stations[rows.stations]
    return np.asarray(rows.active & ~touched)


def _lacking(given: Determined, bad_points: BoolArray, bad_stations: BoolArray) -> list[Unplaced]:
    """Points that have fewer observations left than free coordinates."""
    rows, n = given.book.observations, len(given.points)
    active = _still_active(given.book, bad_points, bad_stations)
    count = given.book.counts(active, n)
    free = given.points.is_unknown.sum(axis=1)
    zeros = unknown_zeros(given.points, given.book, given.initial.orientations, active)
    lacking = np.flatnonzero((count < free + zeros) & ~bad_points).tolist()
    if not lacking:
        return []
    numbers = np.column_stack((count, free, zeros))
    levelled = np.isin(rows.types, codes_where(lambda kind: kind.is_levelled))
    others = rows.counts(active & ~levelled, n)
    hints = np.where((count > 0) & (others == 0) & (free == 3), _ONLY_LEVELLED, "")
    return [
        Unplaced(f"point {given.points.names[row]}", _too_few(*map(int, numbers[row])) + hints[row], row)
        for row in lacking
    ]


def _too_few(count: int, free: int, zeros: int) -> str:
    if count == 0:
        return "no usable observation names it; observe it, or remove it from the point file"
    plural = "" if count == 1 else "s"
    if zeros:
        missing = free + zeros - count
        more = "one more direction is" if missing == 1 else f"{missing} more observations are"
        return (
            f"it has {count} usable observation{plural} for {free} unknown coordinates and {zeros} unknown "
            f"orientation{'' if zeros == 1 else 's'}; {more} needed"
        )
    return f"it has {count} usable observation{plural} for {free} unknown coordinates; observe it more"


def _used_stations(book: FieldBook, active: BoolArray) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Stations of which an observation is active."""
    used = np.zeros(len(book.stations), np.bool_)
    used[book.observations.stations[active & (book.observations.stations >= 0)]] = True
    return np.flatnonzero(used)


def _refuse_nothing(
    given: Determined, bad_points: BoolArray, active: BoolArray, found: Sequence[Unplaced]
) -> None:
    """Raises when no unknown or no observation remains."""
    unknown = given.points.is_unknown.any(axis=1) & ~bad_points
    if active.any() and (unknown.any() or not given.points.is_unknown.any()):
        return
    listed = [f"  {item.what}: {item.reason}" for item in found[:20]]
    rows = given.book.observations
    is_levelled = (
        rows.active.any()
        and np.isin(rows.types[rows.active], codes_where(lambda kind: kind.is_levelled)).all()
    )
    hint = ". " + _LEVELLING if is_levelled else ""
    if len(found) > len(listed):
        listed.append(f"  and {len(found) - len(listed)} more")
    raise InputError(
        "nothing remains to be adjusted: no initial value could be computed, or too few observations, for:\n"
        + "\n".join(listed)
        + "\nadd the observations that are missing, or approximate coordinates (flag 0) to the point file"
        + hint
    )


def _stands_alone(given: Determined, item: Unplaced, bad_points: BoolArray) -> bool:
    """Whether a station is left out for its own sake, not because all its targets are."""
    if item.station is None:
        return True
    book = given.book
    mine = book.stations.observations(item.station)
    return not bad_points[book.observations.to_points[mine[book.observations.active[mine]]]].all()


def _lost_by_point(book: FieldBook, lost: BoolArray) -> Callable[[int], IntArray]:
    """Gives the lost observations (a mask) that name a point, or whose group does, in their order."""
    rows, which = book.observations, np.flatnonzero(lost)
    ends = [end[which] for end in (rows.from_points, rows.to_points, rows.backsights)]
    members = [(row, member) for row, members in book.barycentres if lost[row] for member in members]
    of_groups, named = np.array(members, np.int32).reshape(-1, 2).T
    lines = np.concatenate([which, which, which, of_groups])
    starts, places = group_by_station(np.concatenate([*ends, named]), len(book.point_names))
    return lambda point: np.unique(lines[places[starts[point] : starts[point + 1]]]).astype(np.int32)


def _lost(
    book: FieldBook, item: Unplaced, active: BoolArray, of_point: Callable[[int], IntArray]
) -> IntArray:
    """The observations that are left out with a point, or with a station."""
    if item.station is None:
        return of_point(item.point)
    mine = book.stations.observations(item.station)
    return np.sort(mine[book.observations.active[mine] & ~active[mine]])


def _described(given: Determined, item: Unplaced, lost: IntArray) -> LeftOutRecord:
    labels = tuple(given.book.label(row) for row in lost.tolist())
    name = given.points.names[item.point]
    return LeftOutRecord(item.what, name, item.reason, labels, _place(given, item), item.directions)


def _place(given: Determined, item: Unplaced) -> tuple[float, ...] | None:
    """Where a point would be drawn."""
    if item.station is not None:
        return None
    coordinates = given.points.coordinates[item.point]
    if np.isfinite(coordinates).all():
        return tuple(coordinates.tolist())
    return None if item.directions is None else tuple(given.initial.coordinates[item.point].tolist())


def _without(
    given: Determined,
    bad_points: BoolArray,
    active: BoolArray,
    named: tuple[LeftOutRecord, ...],
) -> Determined:
    initial = given.initial
    stations, points = _used_stations(given.book, active), np.flatnonzero(~bad_points)
    kept = replace(
        initial,
        coordinates=initial.coordinates[points],
        rotations=initial.rotations[stations],
        g0=initial.g0[stations],
        orientations=initial.orientations[stations],
        point_steps=tuple(initial.point_steps[row] for row in points.tolist()),
        station_steps=tuple(initial.station_steps[row] for row in stations.tolist()),
        unplaced=(),
        expected_sigmas=initial.expected_sigmas[points],
    )
    book = _book_without(given.book, bad_points, stations, active)
    return Determined(given.points.subset(points), book, kept, (*given.left_out, *named))


def _book_without(
    book: FieldBook,
    bad_points: BoolArray,
    stations: np.ndarray[tuple[int], np.dtype[np.intp]],
    active: BoolArray,
) -> FieldBook:
    """The book with fewer points and stations; what needs the others is inactive."""
    n, rows = len(book.point_names), book.observations
    bad = np.append(bad_points, np.ones(n - len(bad_points), np.bool_))
    order = np.argsort(bad, kind="stable")
    numbers: IntArray = np.empty(n, np.int32)
    numbers[order] = np.arange(n, dtype=np.int32)
    new_station = np.full(len(book.stations) + 1, -1, np.int32)
    new_station[stations] = np.arange(len(stations), dtype=np.int32)
    of_rows = new_station[rows.stations]
    starts, members = group_by_station(of_rows, len(stations))
    return replace(
        book,
        point_names=tuple(book.point_names[row] for row in order.tolist()),
        groups=tuple(group.renumbered(numbers) for group in book.groups),
        observations=replace(
            rows,
            from_points=numbers[rows.from_points],
            to_points=numbers[rows.to_points],
            backsights=np.where(rows.backsights < 0, np.int32(-1), numbers[rows.backsights]),
            active=active,
            stations=of_rows,
        ),
        stations=replace(
            book.stations,
            origins=numbers[book.stations.origins[stations]],
            orientations=book.stations.orientations[stations],
            starts=starts,
            members=members,
        ),
    )
