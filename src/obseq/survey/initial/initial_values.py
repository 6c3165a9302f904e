"""Initial values of a network: coordinates of all points and orientations of all stations.

Points with coordinates in the files keep them. The others are placed, the strongest geometry first, by: a
complete vector from an oriented station, azimuth and distance, intersection of directions (in plan or in
space), free station, resection from three directions, directions combined with distances, trilateration,
isometry of a #BASC station on three points, heights by levelling, by zenith angles or by distances, and local
frames tied by common points; repeated until nothing more can be placed.

MMVII (`src/Topo/topoinit.cpp`) only knows the complete vector and the isometry. We also differ where it is
wrong: the isometry is composed with the vertical (its rotation is the one the adjustment starts with), the
vertical is that of the computed origin, distances count in both directions, and nothing depends on memory
addresses.
"""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field, replace
from functools import partial

import numpy as np

from obseq.arguments import FUNCTION, NOTHING, TRUTH, expecting, instance
from obseq.arrays import BoolArray, FloatArray, FloatRows
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.survey.initial.approximations import Approximations, replaced
from obseq.survey.initial.closed_forms import Space
from obseq.survey.initial.known import Known, Vertical
from obseq.survey.initial.local_frames import LocalFrames
from obseq.survey.initial.orienting import g0_of, plumb_rotation, reconcile, verticals_of_stations
from obseq.survey.initial.placement import GOOD, REST, Placement
from obseq.survey.initial.rivals import Choice, Contest, contest_of, start_rivals
from obseq.survey.initial.unplaced import Unplaced, explain_points, explain_stations
from obseq.survey.model import FieldBook, Orientation, Points, automatic_fix
from obseq.survey.sights.graph_building import Graphs, is_large
from obseq.survey.sights.sight_graph import SightGraph
from obseq.survey.sights.sights import GIVEN, Cause, Step, Steps
from obseq.survey.sights.ways import PlumbWays

_MOST_LISTED = 20
_SIGMA_OF_APPROXIMATE = 10.0
"""Expected error (m) of a coordinate that is given and not constrained."""


@dataclass(frozen=True, eq=False)
class InitialValues:
    """Where the adjustment starts.

    Attributes:
        coordinates: (n, 3) metres in the frame; NaN for points that could not be placed.
        rotations: (m, 3, 3) R0 of each station, instrument -> frame; NaN where unknown.
        g0: (m,) azimuth of the zero of the circle, radians, read as MMVII does; NaN where unknown.
        orientations: (m,) int8 values of `Orientation`, after the automatic-FIX rule.
        point_steps: how each point was placed ("given" for coordinates of the file), None if it was not.
        station_steps: how each station was oriented, None if it was not.
        unplaced: the points without position and the stations without orientation, with the reasons.
        expected_sigmas: (n,) expected errors of the coordinates (m).
        replaced: rows of the points whose approximate coordinates the observations contradict: others stand
            in `coordinates`.
        rivals: places that the observations of a point give it equally well, by its row; it starts at one.
    """

    coordinates: FloatArray
    rotations: FloatArray
    g0: FloatArray
    orientations: np.ndarray[tuple[int], np.dtype[np.int8]]
    point_steps: Sequence[Step | None]
    station_steps: Sequence[Step | None]
    unplaced: tuple[Unplaced, ...]
    expected_sigmas: FloatArray
    replaced: tuple[int, ...] = ()
    rivals: Mapping[int, tuple[Space, ...]] = field(default_factory=dict)

    def require_complete(self) -> None:
        """Refuses to go on while something has no initial value.

        Raises:
            InputError: listing the points and stations, each with its reason.
        """
        if not self.unplaced:
            return
        listed = [f"  {item.what}: {item.reason}" for item in self.unplaced[:_MOST_LISTED]]
        more = len(self.unplaced) - len(listed)
        if more > 0:
            listed.append(f"  and {more} more")
        raise InputError(
            "no initial value could be computed for:\n"
            + "\n".join(listed)
            + "\nadd the observations that are missing, or approximate coordinates (flag 0) to the point file"
        )


@expecting(
    points=instance(Points), book=instance(FieldBook), vertical=FUNCTION | NOTHING, recompute_free=TRUTH
)
def initial_values(
    points: Points, book: FieldBook, vertical: Vertical | None, *, recompute_free: bool = False
) -> InitialValues:
    """Computes initial values as far as the observations allow.

    Args:
        points: in the frame of the computation, completed by `join`.
        book: the field book renumbered by `join`.
        vertical: points (n, 3) -> R_(frame -> vertical) (n, 3, 3), east north up; None for a frame without
            vertical, where only #FIX stations (axes of the frame) and #BASC stations have a meaning.
        recompute_free: compute also the points that are free but have coordinates; these then only decide
            between two solutions, and serve where the observations place nothing. Without it this is done for
            coordinates that the observations contradict.

    Raises:
        InputError: a #VERT station in a frame without vertical, or a point where the frame has no vertical.
    """
    return values_by(Graphs(), points, book, vertical, recompute_free=recompute_free)


def values_by(
    graphs: Graphs,
    points: Points,
    book: FieldBook,
    vertical: Vertical | None,
    *,
    recompute_free: bool = False,
    choice: Choice | None = None,
) -> InitialValues:
    """`initial_values` of networks that differ in little, one after the other: they share their graphs.

    Args:
        graphs: what they have in common.
        points: as of `initial_values`.
        book: as of `initial_values`.
        vertical: as of `initial_values`.
        recompute_free: as of `initial_values`.
        choice: where points start that have several places; None: nowhere.
    """
    with collector_at_rest():
        found = _all_values(graphs, points, book, vertical, recompute_free, choice)
    if is_large(book):
        gc.collect()  # empties Python's stores of small objects, which hold the memory around them
    return found


@contextmanager
def collector_at_rest() -> Iterator[None]:
    """Looks for no circles among the many small objects that are made: there are few, and it takes long."""
    was_at_work = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_at_work:
            gc.enable()


def _all_values(
    graphs: Graphs,
    points: Points,
    book: FieldBook,
    vertical: Vertical | None,
    recompute_free: bool,
    choice: Choice | None,
) -> InitialValues:
    orientations = automatic_fix(book)
    if vertical is None:
        _refuse_plumb_stations(book, orientations)
    graph, ways = graphs.of(book, len(points), orientations, is_level=_is_level(points))
    free = points.is_free.any(axis=1) & points.has_coordinates & ~points.in_datum.any(axis=1)
    contest = contest_of(points, book, orientations, choice)
    compute = partial(_computed, points, book, graph, ways, vertical, contest)
    if recompute_free:
        return compute(points.is_free.all(axis=1) & free)
    approximations = Approximations(book, orientations, vertical)
    return _checked(points, compute, approximations, free)


def _is_level(points: Points) -> bool:
    """Whether the heights are all given, and the same, or have no part: a plane network."""
    has_part = ~points.is_invented[:, 2]
    heights = points.coordinates[has_part, 2]
    return len(points) > 0 and bool(points.is_held[has_part, 2].all() and (heights == heights[:1]).all())


def _checked(
    points: Points,
    compute: Callable[[BoolArray], InitialValues],
    approximations: Approximations,
    free: BoolArray,
) -> InitialValues:
    """Initial values that start from the approximate coordinates, but for those that are far off."""
    book, given = approximations.book, points.coordinates
    before = approximations.contradictions(given, free)
    hidden = before > 0
    found = compute(hidden)
    if not hidden.any():
        return found
    after = approximations.contradictions(found.coordinates, free)
    if (after[~hidden] > 0).any():  # what the others were placed with is wrong too: trust no approximation
        found = compute(free)
        before, hidden = np.maximum(before, 1), free
        after = approximations.contradictions(found.coordinates, free)
    better = hidden & (after < before)
    if (better != hidden).any():
        found = compute(better)
    moved = replaced(given, book, found.coordinates, better)
    return replace(found, replaced=tuple(moved.tolist()))


def _computed(
    points: Points,
    book: FieldBook,
    graph: SightGraph,
    ways: PlumbWays,
    vertical: Vertical | None,
    contest: Contest | None,
    hidden: BoolArray,
) -> InitialValues:
    """Initial values without the coordinates of hidden points, as far as the observations place these."""
    known = Known(points.names, len(graph.origins), vertical)
    hints = _take_given(known, points, hidden)
    _take_parts(known, points, hidden)
    known.origins = graph.origins
    placement = Placement(known, graph, ways, hints)
    frames = LocalFrames(known, graph, ways)
    _work(placement, frames)
    rivals = start_rivals(placement, contest, partial(_start_at, placement, frames)) if contest else {}
    coordinates = known.coordinates()
    verticals = verticals_of_stations(known)
    reconcile(known, graph, coordinates, verticals)
    reasons = explain_points(known, graph, placement.best_positions, book) + explain_stations(
        known, graph, book
    )
    found = _result(known, graph, coordinates, verticals[: len(book.stations)], tuple(reasons))
    return replace(found, rivals=rivals) if rivals else found


def _refuse_plumb_stations(book: FieldBook, orientations: np.ndarray[tuple[int], np.dtype[np.int8]]) -> None:
    plumb = np.flatnonzero(orientations == Orientation.VERT.value)
    if len(plumb):
        first = int(book.stations.observations(int(plumb[0]))[0])
        raise InputError(
            f"{book.label(first)}: a #VERT station needs a frame in which the vertical is defined; "
            "compute in an RTL frame, or declare the station #FIX"
        )


def _take_given(known: Known, points: Points, hidden: BoolArray) -> dict[int, Space]:
    """Takes coordinates of the files as known; returns the hidden ones, which are only hints."""
    hints: dict[int, Space] = {}
    point_sigmas = np.where(points.is_free, _SIGMA_OF_APPROXIMATE, points.sigmas).max(axis=1, initial=0.0)
    rows = np.flatnonzero(points.has_coordinates)
    columns = (rows, points.coordinates[rows], hidden[rows], point_sigmas[rows])
    for row, xyz, is_hidden, point_sigma in zip(*(column.tolist() for column in columns), strict=True):
        position = (xyz[0], xyz[1], xyz[2])
        if is_hidden:
            hints[row] = position
        else:
            _take(known, row, position, point_sigma)
    return hints


def _take_parts(known: Known, points: Points, hidden: BoolArray) -> None:
    """Points of which the file gives the plan or the height only, or of which only these are not hidden."""
    given = _parts_given(known, points, hidden)
    heights = given[:, 2]
    has_plan = np.isfinite(given[:, :2]).all(axis=1)
    has_height = np.isfinite(heights)
    flat = np.flatnonzero(has_plan & ~has_height)
    if len(flat):
        middle = float(heights[has_height].mean()) if has_height.any() else 0.0
        for row, (x, y) in zip(flat.tolist(), given[flat, :2].tolist(), strict=True):
            known.positions[row], known.point_steps[row] = (x, y, middle), GIVEN
            known.has_height[row] = bool(points.is_invented[row, 2])
    rows = np.flatnonzero(has_height & ~has_plan)
    known.given_heights = dict(zip(rows.tolist(), heights[rows].tolist(), strict=True))
    known.level = frozenset(np.flatnonzero(points.is_invented[:, 2]).tolist())


def _parts_given(known: Known, points: Points, hidden: BoolArray) -> FloatArray:
    """(n, 3) coordinates, NaN where none is given or hidden; those that are not free stay."""
    is_open = points.is_free & (hidden & ~points.is_free.all(axis=1))[:, None]
    is_open[:, :2] |= is_open[:, :2].any(axis=1, keepdims=True)
    return np.where(is_open, np.nan, points.coordinates)


def _take(known: Known, row: int, position: Space, point_sigma: float) -> None:
    known.positions[row], known.has_height[row], known.point_steps[row] = position, 1, GIVEN
    known.point_sigmas[row] = point_sigma


def _work(placement: Placement, frames: LocalFrames) -> None:
    """Everything that the observations place, then hints where they place nothing, and so on."""
    known = placement.known
    located = [point for point, position in enumerate(known.positions) if position is not None]
    placement.start(sorted(located, key=lambda point: not known.has_height[point]))
    _place_all(placement, frames)
    _take_heights(placement)
    left = [p for p in placement.hints if _needs_hint(known, p) and not placement.is_ambiguous(p)]
    if left:
        for point in left:
            _take(known, point, placement.hints[point], _SIGMA_OF_APPROXIMATE)
        placement.start(left)
        _place_all(placement, frames)


def _take_heights(placement: Placement) -> None:
    """Gives points of which the observations give the plan alone the heights of their coordinates."""
    known, lifted = placement.known, []
    for point, hint in placement.hints.items():
        position = known.positions[point]
        if position is not None and not known.has_height[point] and known.point_steps[point] is not GIVEN:
            from obseq.survey.initial.best_position import along_plumb_line

            known.positions[point] = along_plumb_line(known, position, hint)
            known.has_height[point] = 1
            lifted.append(point)
    placement.start(lifted)


def _start_at(placement: Placement, frames: LocalFrames, point: int, place: Space) -> None:
    """Goes on from a point that starts at a place."""
    _take(placement.known, point, place, _SIGMA_OF_APPROXIMATE)
    placement.start([point])
    _place_all(placement, frames)


def _needs_hint(known: Known, point: int) -> bool:
    """Whether the observations place nothing of a point, or not the height over its given plan."""
    is_given = known.point_steps[point] is GIVEN
    return known.positions[point] is None or (is_given and not known.has_height[point])


def _place_all(placement: Placement, frames: LocalFrames) -> None:
    """Good positions, then local frames, then the rest; again while something is placed."""
    while True:
        placement.run(GOOD)
        tied = frames.place()
        placement.start(tied)
        if not tied and not placement.run(REST):
            break


def _result(
    known: Known,
    graph: SightGraph,
    coordinates: FloatArray,
    verticals: FloatRows,
    unplaced: tuple[Unplaced, ...],
) -> InitialValues:
    m, is_placed = len(verticals), known.are_placed()
    g0 = np.array([math.nan if angle is None else angle for angle in known.g0[:m]])
    rotations = plumb_rotation(verticals, g0)
    for station, rotation in enumerate(known.rotations[:m]):
        origin = graph.origins[station]
        if rotation is not None and known.is_settled[origin]:
            rotations[station], g0[station] = rotation, g0_of(rotation, known.vertical_of(origin))
    return InitialValues(
        coordinates if is_placed.all() else np.where(is_placed[:, None], coordinates, np.nan),
        rotations,
        g0,
        np.array(graph.orientations[:m], np.int8),
        Steps(_of_placed(known.point_steps, is_placed), graph.sights.rows),
        Steps(known.station_steps[:m], graph.sights.rows),
        unplaced,
        np.array(known.point_sigmas, np.float64),
    )


def _of_placed(causes: list[Cause | None], is_placed: BoolArray) -> list[Cause | None]:
    """The causes, of points that are placed only."""
    if is_placed.all():
        return causes
    return [cause if placed else None for placed, cause in zip(is_placed.tolist(), causes, strict=True)]
