"""Mistakes that whole groups of values share, and that no column shows: units, senses, elevations.

They are tried as what they are: the values are written anew, and the network is computed from the beginning.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.diagnosis.policy import POLICY
from obseq.errors import ObseqError
from obseq.survey.causes.cause import Groups, Rewritten, Scope, grouped
from obseq.survey.causes.notes import Notes
from obseq.survey.causes.other_system import other_system
from obseq.survey.causes.scopes import ALL, FILE, FROM
from obseq.survey.equations.point_system import PointSystem
from obseq.survey.kinds.registry import BY_CODE, IS_ANGLE
from obseq.survey.model import Points

_TURN, _FEET = 2.0 * math.pi, 0.3048


@dataclass(frozen=True, eq=False)
class Rewriting:
    """A way in which values of a group are written wrong.

    Attributes:
        code: Stable code, such as "S200".
        slip: Code of the slip, as of single values.
        name: In one or two words.
        text: In words, as slips say it.
        takes: Which observations it changes.
        right: Values as written -> as they should be; with them, whether each is a zenith angle.
    """

    code: str
    slip: str
    name: str
    text: str
    takes: Callable[[Notes], BoolArray]
    right: Callable[[FloatArray, BoolArray], FloatArray]


_SEEN_OUTSIDE = "S202", "S203", "S204"
"""Of all values they leave a network in order, but larger or mirrored: known points alone contradict them.

Those of zenith angles do not: each is seen from both ends."""
SCOPES = (ALL, FILE, FROM)
"""Where they may be: first of all it is tried, then of some."""


def _angles(notes: Notes) -> BoolArray:
    return np.asarray(IS_ANGLE[notes.book.observations.types])


def _scaled(factor: float) -> Callable[[FloatArray, BoolArray], FloatArray]:
    return lambda values, _: factor * values


REWRITINGS = (
    Rewriting("S200", "W100", "unit of angles", "degrees read as gon", _angles, _scaled(10.0 / 9.0)),
    Rewriting("S200", "W101", "unit of angles", "gon read as degrees", _angles, _scaled(0.9)),
    Rewriting(
        "S200",
        "W100",
        "unit of zenith angles",
        "degrees read as gon",
        lambda notes: notes.is_zenith & (_angles(notes) & ~notes.is_zenith).any(),
        _scaled(10.0 / 9.0),
    ),
    Rewriting(
        "S201",
        "W103",
        "elevations",
        "elevations in place of zenith angles",
        lambda notes: notes.is_zenith,
        lambda values, _: math.pi / 2.0 - values,
    ),
    Rewriting(
        "S201",
        "W132",
        "elevations in degrees",
        "elevations in degrees in place of zenith angles, angles in degrees",
        _angles,
        lambda values, is_zenith: (
            np.where(is_zenith, math.pi / 2.0, 0.0) + np.where(is_zenith, -1.0, 1.0) * values * 10.0 / 9.0
        ),
    ),
    Rewriting(
        "S202",
        "W131",
        "sense of directions",
        "counted anticlockwise",
        lambda notes: notes.is_direction,
        lambda values, _: -values % _TURN,
    ),
    Rewriting(
        "S201",
        "W102",
        "face of zenith angles",
        "read in the other face, or with the wrong sign",
        lambda notes: notes.is_zenith,
        lambda values, _: -values % _TURN,
    ),
    Rewriting(
        "S202", "W131", "sense of angles", "with the wrong sign", _angles, lambda values, _: -values % _TURN
    ),
    Rewriting(
        "S203",
        "W126",
        "unit of distances",
        "millimetres read as metres",
        lambda notes: notes.is_length,
        _scaled(1e-3),
    ),
    Rewriting(
        "S203",
        "W106",
        "unit of distances",
        "feet read as metres",
        lambda notes: notes.is_length,
        _scaled(_FEET),
    ),
    Rewriting(
        "S203",
        "W107",
        "unit of distances",
        "metres read as feet",
        lambda notes: notes.is_length,
        _scaled(1.0 / _FEET),
    ),
    Rewriting(
        "S204",
        "W126",
        "unit of height differences",
        "millimetres read as metres",
        lambda notes: notes.is_levelled,
        _scaled(1e-3),
    ),
    Rewriting(
        "S204",
        "W106",
        "unit of height differences",
        "feet read as metres",
        lambda notes: notes.is_levelled,
        _scaled(_FEET),
    ),
)


def rewritten(
    notes: Notes, system: PointSystem, off: FloatArray, off_points: IntArray
) -> Iterator[Iterator[Rewritten]]:
    """The networks without one such mistake, in parts: those of all values first, of single points last.

    Of one part may be as good as each other what is in no other part.

    Args:
        notes: The network.
        system: Of the coordinates of points.
        off: (n,) 1 for what contradicts at a robust place, else 0; NaN where that is not asked.
        off_points: (k,) how many contradictions each point has.
    """
    known = _known(notes.points)
    worst = known[np.argsort(-off_points[known], kind="stable")][:_MOST_KNOWN]
    outside: list[Rewritten] = []
    inside: list[Rewritten] = []
    for one in of_all_values(notes):
        is_outside = one.code in _SEEN_OUTSIDE and not notes.is_zenith[one.rows].any()
        (outside if is_outside else inside).append(one)
    yield chain(outside, _of_all_points(notes, system))
    yield chain(inside, _horizontal(notes))
    yield other_system(notes, known)
    yield _of_values(notes, SCOPES[1:], off)
    yield _of_single_points(notes.points, notes, system, worst, len(known))


def _worst(groups: Groups, off: FloatArray) -> list[int]:
    """Numbers of the groups most of which contradicts, the worst first: as many as are tried."""
    asked = np.append(0.0, np.cumsum(np.isfinite(off[groups.rows])))[groups.starts]
    wrong = np.append(0.0, np.cumsum(np.nan_to_num(off[groups.rows])))[groups.starts]
    asked, wrong = np.diff(asked), np.diff(wrong)
    found = np.flatnonzero((asked >= _LEAST) & (wrong >= POLICY.whole * asked))
    return list(map(int, found[np.argsort(-wrong[found], kind="stable")][: POLICY.trials]))


def of_all_values(notes: Notes) -> Iterator[Rewritten]:
    """The networks in which all values of a group of kinds are written anew."""
    return _of_values(notes, SCOPES[:1], None)


def _of_values(notes: Notes, scopes: tuple[Scope, ...], off: FloatArray | None) -> Iterator[Rewritten]:
    """The networks in which the values of one group, all of a kind or some, are written anew."""
    observations = notes.book.observations
    is_known = ~notes.points.is_free
    n_known = {
        "S203": np.count_nonzero(is_known[:, :2].all(axis=1)),
        "S204": np.count_nonzero(is_known[:, 2]),
    }
    for one in REWRITINGS:
        if n_known.get(one.code, 2) < 2:  # where nothing says how large a network is, any factor fits
            continue
        mask = observations.active & one.takes(notes)
        seen = set[bytes]()
        for scope in scopes:
            groups = grouped(scope, scope.labels(notes), mask, _LEAST)
            for k in range(len(groups)) if off is None else _worst(groups, off):
                rows, label = groups.of(k), int(groups.labels[k])
                is_all = off is not None and len(rows) == np.count_nonzero(mask)
                if is_all or rows.tobytes() in seen:
                    continue
                seen.add(rows.tobytes())
                values = observations.values.copy()
                values[rows] = one.right(values[rows], notes.is_zenith[rows])
                if BY_CODE[int(observations.types[rows[0]])].problem(float(values[rows[0]])):
                    continue
                book = replace(notes.book, observations=replace(observations, values=values))
                what = f"{one.name}, {scope.words(notes, label, rows)}, {len(rows)} observations"
                yield Rewritten(one.code, one.slip, what, one.text, rows, _NONE, notes.points, book)


_NONE = np.zeros(0, np.int64)


def _horizontal(notes: Notes) -> Iterator[Rewritten]:
    """Horizontal distances that were written as slope distances."""
    observations = notes.book.observations
    rows = np.flatnonzero(notes.is_slope & observations.active)
    kinds = {code: BY_CODE[code].horizontal for code in set(observations.types[rows].tolist())}
    if not rows.size or any(kind is None for kind in kinds.values()):
        return
    types = observations.types.copy()
    for code, kind in kinds.items():
        assert kind is not None
        types[rows[observations.types[rows] == code]] = kind.code
    book = replace(notes.book, observations=replace(observations, types=types))
    what = f"kind of distances, all, {len(rows)} observations"
    text = "horizontal distances in place of slope distances"
    yield Rewritten("S205", "W108", what, text, rows, _NONE, notes.points, book)


def _known(points: Points) -> IntArray:
    return np.flatnonzero((~points.is_free).any(axis=1) & points.has_coordinates)


def _of_all_points(notes: Notes, system: PointSystem) -> Iterator[Rewritten]:
    """Coordinates of all points: easting and northing exchanged, heights, plan or all in feet."""
    points, known = notes.points, _known(notes.points)
    placed = np.flatnonzero(points.has_coordinates)
    if not known.size:
        return
    names = [points.names[row] for row in placed.tolist()]
    given = system.coordinates(points.coordinates[placed], names)

    whole, plan, heights = [1.0, 1.0, 1.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]
    feet = ((_FEET, "W106", "feet read as metres"), (1.0 / _FEET, "W107", "metres read as feet"))
    of_all = f"of all {len(known)} known points"
    changes = [("S210", "W123", "coordinates", "easting and northing are exchanged", given[:, [1, 0, 2]])]
    changes += [
        (code, slip, what, text, given * (1.0 + (factor - 1.0) * np.array(axes)))
        for code, what, axes, factors in (
            ("S211", "heights", heights, feet),
            ("S212", "plan", plan, feet),
            ("S212", "coordinates", whole, (*feet, (1e-3, "W126", "millimetres read as metres"))),
        )
        for factor, slip, text in factors
    ]
    for code, slip, what, text, changed in changes:
        other = _moved(points, placed, changed, system)
        if other is not None:
            yield Rewritten(code, slip, f"{what} {of_all}", text, _NONE, known, other, notes.book)


def _moved(points: Points, rows: IntArray, given: FloatArray, system: PointSystem) -> Points | None:
    """The points, some with other coordinates in their system; None where these are outside of it."""
    coordinates = points.coordinates.copy()
    try:
        coordinates[rows] = system.placed(given, [points.names[row] for row in rows.tolist()])
    except ObseqError:
        return None
    return replace(points, coordinates=coordinates)


_MOST_KNOWN = 8
"""Known points that are tried one by one, and each pair of them exchanged: those that most contradicts."""
_LEAST = 3
"""Observations that a group has at least."""


def _of_single_points(
    points: Points, notes: Notes, system: PointSystem, known: IntArray, count: int
) -> Iterator[Rewritten]:
    """One known point: easting and northing exchanged, or unknown; two with each other's coordinates."""
    book = notes.book
    for row in known.tolist():
        name = points.names[row]
        what = f"known point {name} ({points.place(row)})"
        text, only = "easting and northing are exchanged", np.array([row])
        own = system.coordinates(points.coordinates[only], [name])
        changed = _moved(points, only, own[:, [1, 0, 2]], system)
        if changed is not None:
            yield Rewritten("S111", "W123", what, text, _NONE, only, changed, book)
        if count > 2:
            unknown, sigmas = points.coordinates.copy(), points.sigmas.copy()
            unknown[row], sigmas[row] = np.nan, np.nan
            freed = replace(points, coordinates=unknown, sigmas=sigmas)
            yield Rewritten("S112", "", what, "nothing fits its coordinates", _NONE, only, freed, book)
    for k, row in enumerate(known.tolist()):
        for other in known[k + 1 :].tolist():
            coordinates = points.coordinates.copy()
            coordinates[[row, other]] = coordinates[[other, row]]
            names = f"{points.names[row]} and {points.names[other]}"
            both, renamed = np.array([row, other]), replace(points, coordinates=coordinates)
            what = f"known points {names} ({points.place(row)})"
            text = "the names of these two points are exchanged"
            yield Rewritten("S113", "W133", what, text, _NONE, both, renamed, book)
