"""Why a point has no position, or a station no orientation."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from obseq.survey.initial.relations import Constraint, Kind, collect
from obseq.survey.model import Orientation

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from obseq.survey.initial.best_position import Choice
    from obseq.survey.initial.known import State
    from obseq.survey.initial.sights import Graph
    from obseq.survey.model import FieldBook

_WORDS = {
    Kind.AZIMUTH: ("direction from", "directions from"),
    Kind.ZENITH: ("zenith angle from", "zenith angles from"),
    Kind.DISTANCE: ("distance to", "distances to"),
    Kind.LEVEL: ("height difference to", "height differences to"),
    Kind.READING_AT: ("reading to", "readings to"),
    Kind.ZENITH_AT: ("zenith angle to", "zenith angles to"),
    Kind.HORIZONTAL: ("DX, DY from", "DX, DY from"),
    Kind.HORIZONTAL_AT: ("DX, DY to", "DX, DY to"),
    Kind.RISE: ("DZ from", "DZ from"),
    Kind.RISE_AT: ("DZ to", "DZ to"),
    Kind.EAST: ("DX of zero with", "DX of zero with"),
    Kind.NORTH: ("DY of zero with", "DY of zero with"),
}
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
    """

    what: str
    reason: str
    point: int
    station: int | None = None
    directions: tuple[tuple[float, ...], ...] | None = None


def explain_points(
    state: State, graph: Graph, choices: Mapping[int, tuple[object, Choice]], book: FieldBook
) -> list[Unplaced]:
    """The points without position, in the order of the table."""
    missing = [point for point in range(len(state.names)) if not state.is_placed(point)]
    if not missing:
        return []
    linked = _linked_to_known(state, graph)
    return [
        Unplaced(
            f"point {state.names[p]}",
            _reason(state, graph, choices[p][1] if p in choices else None, linked, p),
            p,
        )
        for p in missing
    ]


def _linked_to_known(state: State, graph: Graph) -> set[int]:
    """Points that a chain of observations links to a located point."""
    reached = {point for point, vertical in enumerate(state.verticals) if vertical is not None}
    waiting = deque(reached)
    while waiting:
        for other in _neighbours(graph, waiting.popleft()):
            if other not in reached:
                reached.add(other)
                waiting.append(other)
    return reached


def _neighbours(graph: Graph, point: int) -> Iterable[int]:
    for station in graph.stations_at[point]:
        for number in graph.sights_from[station]:
            yield graph.sights[number].target
    for number in graph.sights_to[point]:
        yield graph.sights[number].origin
    for other, _, _ in graph.distances[point]:
        yield other
    for other, _, _ in graph.height_differences[point]:
        yield other
    for other, _, _ in graph.flats[point]:
        yield other


def _reason(state: State, graph: Graph, choice: Choice | None, linked: set[int], point: int) -> str:
    neighbours = list(dict.fromkeys(_neighbours(graph, point)))
    if not neighbours:
        return "no active observation names it, and it has no coordinates"
    if point not in linked:
        return "not connected to any known point by a chain of observations"
    if choice is not None and choice.alternatives:
        places = " or ".join(f"({x:.3f}, {y:.3f}, {z:.3f})" for x, y, z in choice.alternatives[:3])
        return f"its observations fit several positions equally well: {places}; one more observation decides"
    constraints = collect(state, graph, point)
    if not constraints:
        return _unhelpful_neighbours(state, graph, point, neighbours)
    has = listed(state, constraints)
    if state.positions[point] is not None:
        return (
            f"its horizontal position is found, not its height (it has {has}); a zenith angle, a height "
            "difference or a distance is needed"
        )
    if (choice is not None and choice.strength > 0.0) or _are_enough(constraints):
        return (
            f"the geometry is too weak (it has {has}): sights nearly parallel, or a point near the circle "
            "through the targets; an observation in another direction is needed"
        )
    return f"it has only {has}; {_advice(constraints)}"


def _are_enough(constraints: list[Constraint]) -> bool:
    """Enough observations for a position, in number."""
    readings = Counter(c.station for c in constraints if c.kind == Kind.READING_AT)
    rays = {c.other for c in constraints if c.kind == Kind.AZIMUTH}
    spheres = {c.other for c in constraints if c.kind == Kind.DISTANCE}
    return max(readings.values(), default=0) >= 3 or len(rays) >= 2 or len(spheres) >= 3


def _unhelpful_neighbours(state: State, graph: Graph, point: int, neighbours: list[int]) -> str:
    unplaced = [state.names[other] for other in neighbours if not state.is_placed(other)]
    if len(unplaced) == len(neighbours):
        return f"observed only with points that have no position either: {_names(unplaced)}"
    known = [state.names[other] for other in neighbours if state.is_placed(other)]
    return f"its observations with {_names(known)} cannot be used: the orientation of the station is unknown"


def _names(names: list[str]) -> str:
    shown = ", ".join(names[:_MOST_NAMES])
    return shown if len(names) <= _MOST_NAMES else f"{shown} and {len(names) - _MOST_NAMES} more"


def listed(state: State, constraints: list[Constraint]) -> str:
    """The constraints in words: `one direction and one zenith angle from S1`."""
    others: dict[Kind, list[str]] = {}
    for constraint in constraints:
        others.setdefault(constraint.kind, []).append(state.names[constraint.other])
    parts = []
    for kind, names in others.items():
        number = _NUMBERS[len(names)] if len(names) < len(_NUMBERS) else str(len(names))
        parts.append(f"{number} {_WORDS[kind][len(names) > 1]} {_names(list(dict.fromkeys(names)))}")
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _advice(constraints: list[Constraint]) -> str:
    kinds = {constraint.kind for constraint in constraints}
    if kinds <= {Kind.LEVEL, Kind.ZENITH, Kind.ZENITH_AT, Kind.RISE, Kind.RISE_AT}:
        return "nothing gives its horizontal position"
    if Kind.AZIMUTH in kinds and not kinds & {Kind.DISTANCE, Kind.HORIZONTAL}:
        return "a distance, or a direction from another point, is needed"
    if kinds <= {Kind.READING_AT, Kind.ZENITH_AT}:
        return "a resection needs directions to three known points"
    return "more observations from known points are needed"


def explain_stations(state: State, graph: Graph, book: FieldBook) -> list[Unplaced]:
    """The stations without orientation, except those whose origin is already listed."""
    found = []
    for station, origin in enumerate(graph.origins[: len(book.stations)]):
        if state.station_steps[station] is None and state.is_placed(origin):
            place = book.place(int(book.stations.observations(station)[0]))
            what = f"station {state.names[origin]} ({place})"
            found.append(Unplaced(what, _station_reason(state, graph, station), origin, station))
    return found


def _station_reason(state: State, graph: Graph, station: int) -> str:
    if graph.orientations[station] == Orientation.BASC:
        return "a #BASC station is oriented by two directions to placed points, or placed by three vectors"
    targets = [graph.sights[number].target for number in graph.sights_from[station]]
    known = [state.names[target] for target in targets if state.is_placed(target)]
    if known:
        return f"the placed points that it sees ({_names(known)}) are on its vertical, or have no reading"
    return "none of its targets has a position, so nothing gives the azimuth of its zero"
