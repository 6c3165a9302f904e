"""Why a point has no position, or a station no orientation."""

from __future__ import annotations

from collections import Counter, deque
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.initial.relations import Measured, Relation, collect
from obseq.survey.model import Orientation

if TYPE_CHECKING:
    from collections.abc import Mapping

    from obseq.survey.initial.best_position import BestPosition
    from obseq.survey.initial.closed_forms import Space
    from obseq.survey.initial.known import Known
    from obseq.survey.model import FieldBook
    from obseq.survey.sights.sight_graph import SightGraph

_WORDS = {
    Measured.AZIMUTH: ("direction from", "directions from"),
    Measured.ZENITH: ("zenith angle from", "zenith angles from"),
    Measured.DISTANCE: ("distance to", "distances to"),
    Measured.LEVEL: ("height difference to", "height differences to"),
    Measured.READING_AT: ("reading to", "readings to"),
    Measured.ZENITH_AT: ("zenith angle to", "zenith angles to"),
    Measured.HORIZONTAL: ("DX, DY from", "DX, DY from"),
    Measured.HORIZONTAL_AT: ("DX, DY to", "DX, DY to"),
    Measured.RISE: ("DZ from", "DZ from"),
    Measured.RISE_AT: ("DZ to", "DZ to"),
    Measured.EAST: ("DX of zero with", "DX of zero with"),
    Measured.NORTH: ("DY of zero with", "DY of zero with"),
}
ISOLATED = "not connected to any known point by a chain of observations"
_NUMBERS = ("no", "one", "two", "three", "four", "five")
_MOST_NAMES = 4


@dataclass(frozen=True)
class Unplaced:
    """A point or a station without initial value.

    Attributes:
        what: "point T4", or "station S1 (survey.obs:12)".
        reason: why, and what would help.
        point: row of the point, or of the origin of the station.
        station: number of the station; None for a point.
        directions: unit vectors along which its observations let the point move; None where they leave more.
        plan: where it is on a plumb line, at a provisional height (m); None where not even this is known.
    """

    what: str
    reason: str
    point: int
    station: int | None = None
    directions: tuple[tuple[float, ...], ...] | None = None
    plan: Space | None = None


def explain_points(
    known: Known,
    graph: SightGraph,
    best_positions: Mapping[int, tuple[object, BestPosition]],
    book: FieldBook,
) -> list[Unplaced]:
    """The points without position, in the order of the table."""
    missing = np.flatnonzero(~known.are_placed()).tolist()
    if not missing:
        return []
    linked = _linked_to_known(known, graph)
    return [
        Unplaced(
            f"point {known.names[p]}",
            _reason(known, graph, best_positions[p][1] if p in best_positions else None, linked, p),
            p,
            plan=known.positions[p],
        )
        for p in missing
    ]


def _linked_to_known(known: Known, graph: SightGraph) -> set[int]:
    """Points that a chain of observations links to a located point."""
    reached = {point for point, is_settled in enumerate(known.is_settled) if is_settled}
    waiting = deque(reached)
    while waiting:
        for other in graph.neighbours(waiting.popleft()):
            if other not in reached:
                reached.add(other)
                waiting.append(other)
    return reached


def _reason(known: Known, graph: SightGraph, best: BestPosition | None, linked: set[int], point: int) -> str:
    neighbours = list(dict.fromkeys(graph.neighbours(point)))
    if not neighbours:
        return "no active observation names it, and it has no coordinates"
    if point not in linked:
        return ISOLATED
    if best is not None and best.alternatives:
        places = " or ".join(f"({x:.3f}, {y:.3f}, {z:.3f})" for x, y, z in best.alternatives[:3])
        return f"its observations fit several positions equally well: {places}; one more observation decides"
    relations = [relation for relation in collect(known, graph, point) if relation.rows]
    if not relations:
        return _unhelpful_neighbours(known, graph, point, neighbours)
    has = listed(known, relations)
    if known.positions[point] is not None:
        return (
            f"its horizontal position is found, not its height (it has {has}); a zenith angle, a height "
            "difference or a distance is needed"
        )
    if (best is not None and best.strength > 0.0) or _are_enough(relations):
        return (
            f"the geometry is too weak (it has {has}): sights nearly parallel, or a point near the circle "
            "through the targets; an observation in another direction is needed"
        )
    return f"it has only {has}; {_advice(relations, _unoriented(known, graph, point))}"


def _unoriented(known: Known, graph: SightGraph, point: int) -> list[str]:
    """Names of placed points from which only stations without orientation read a point."""
    return [
        known.names[origin]
        for station, origin in enumerate(graph.origins)
        if known.is_placed(origin)
        and known.station_steps[station] is None
        and graph.orientations[station] == Orientation.VERT.value
        and np.isfinite(graph.reading_between(station, point))
    ]


def _are_enough(relations: list[Relation]) -> bool:
    """Enough observations for a position, in number."""
    readings = Counter(c.station for c in relations if c.kind == Measured.READING_AT)
    rays = {c.other for c in relations if c.kind == Measured.AZIMUTH}
    spheres = {c.other for c in relations if c.kind == Measured.DISTANCE}
    return max(readings.values(), default=0) >= 3 or len(rays) >= 2 or len(spheres) >= 3


def _unhelpful_neighbours(known: Known, graph: SightGraph, point: int, neighbours: list[int]) -> str:
    unplaced = [known.names[other] for other in neighbours if not known.is_placed(other)]
    if len(unplaced) == len(neighbours):
        return f"observed only with points that have no position either: {_names(unplaced)}"
    placed = [known.names[other] for other in neighbours if known.is_placed(other)]
    return f"its observations with {_names(placed)} cannot be used: the orientation of the station is unknown"


def _names(names: list[str]) -> str:
    shown = ", ".join(names[:_MOST_NAMES])
    return shown if len(names) <= _MOST_NAMES else f"{shown} and {len(names) - _MOST_NAMES} more"


def listed(known: Known, relations: list[Relation]) -> str:
    """The relations in words: `one direction and one zenith angle from S1`."""
    others: dict[Measured, list[str]] = {}
    for relation in relations:
        others.setdefault(relation.kind, []).append(known.names[relation.other])
    parts = []
    for kind, names in others.items():
        number = _NUMBERS[len(names)] if len(names) < len(_NUMBERS) else str(len(names))
        parts.append(f"{number} {_WORDS[kind][len(names) > 1]} {_names(list(dict.fromkeys(names)))}")
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _advice(relations: list[Relation], unoriented: list[str]) -> str:
    kinds = {relation.kind for relation in relations}
    if kinds <= {
        Measured.LEVEL,
        Measured.ZENITH,
        Measured.ZENITH_AT,
        Measured.RISE,
        Measured.RISE_AT,
    }:
        return "nothing gives its horizontal position"
    if Measured.AZIMUTH in kinds and not kinds & {Measured.DISTANCE, Measured.HORIZONTAL}:
        return "a distance, or a direction from another point, is needed"
    if kinds <= {Measured.READING_AT, Measured.ZENITH_AT}:
        return "a resection needs directions to three known points"
    if unoriented:
        return f"an azimuth (Azim, code 8) or a reading of a known point is needed at {_names(unoriented)}"
    return "more observations from known points are needed"


def explain_stations(known: Known, graph: SightGraph, book: FieldBook) -> list[Unplaced]:
    """The stations without orientation, except those whose origin is already listed."""
    found = []
    for station, origin in enumerate(graph.origins[: len(book.stations)]):
        if known.station_steps[station] is None and known.is_placed(origin):
            place = book.place(int(book.stations.observations(station)[0]))
            what = f"station {known.names[origin]} ({place})"
            found.append(Unplaced(what, _station_reason(known, graph, station), origin, station))
    return found


def _station_reason(known: Known, graph: SightGraph, station: int) -> str:
    if graph.orientations[station] == Orientation.BASC.value:
        return (
            "a #BASC station is oriented by two directions to placed points, or placed by three vectors; "
            "where fewer points are placed, by heights of its targets and an azimuth"
        )
    placed = [known.names[target] for target in graph.targets(station) if known.is_placed(target)]
    if placed:
        return f"the placed points that it sees ({_names(placed)}) are on its vertical, or have no reading"
    return (
        "none of its targets has a position, so nothing gives the azimuth of its zero; an azimuth (Azim, "
        "code 8) from there, or a reading of a known point, does"
    )
