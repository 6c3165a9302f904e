"""Readings in both faces of the telescope: folded into the first one, reduced to means, compared.

A zenith angle beyond half a turn is one of the second face: a full turn less it is that of the first. A
direction on its line is half a turn from that of the first face. Where lines hold single angles, two or more
targets of one point whose directions come half a turn apart are sights in both faces; one may be a slip.

Half of first minus second face is the collimation error over the sine of the zenith angle, and the index
error of the vertical circle. Means are free of both, so means are adjusted.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.printable import listed
from obseq.survey.kinds.directions import HZ, ZEN

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from obseq.arrays import BoolArray, FloatArray
    from obseq.survey.model import FieldBook

MEAN, ALL = "mean", "all"
"""What becomes of readings in both faces."""
FULL_TURN = 2.0 * math.pi
CLOSE = 0.5 * math.pi / 200.0
"""Errors of an instrument between its faces, generously (rad)."""
MOST = 4
LIMIT = 3.29
"""Standardised difference beyond which a pair is named: a chance of 0.1 %."""
CC = math.pi / 2_000_000.0


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Sights of one kind that were read in both faces, folded into the first one.

    Attributes:
        rows: (n, 2) of the field book: first and second face.
        halves: (n,) half of second minus first face (rad).
        sigmas: (n,) standard deviation of each half.
        apart: Pairs that no error of an instrument explains: both readings stay.
    """

    rows: list[tuple[int, int]]
    halves: FloatArray
    sigmas: FloatArray
    apart: list[tuple[int, int]]


def reduced_faces(book: FieldBook, faces: str = MEAN) -> FieldBook:
    """The field book with all sights in the first face.

    Args:
        book: As it was read.
        faces: "mean" for the means of both faces, the second reading of a pair being switched off; "all" to
            keep all readings, as they are. Correlated readings are folded, and not reduced.

    Raises:
        InputError: `faces` is another word.
    """
    if faces not in (MEAN, ALL):
        raise InputError(f"faces: {faces!r} is neither {MEAN!r} (means of both faces) nor {ALL!r} readings")
    rows = book.observations
    directions, zeniths = rows.types == HZ.code, rows.types == ZEN.code
    turned = zeniths & (np.remainder(rows.values, FULL_TURN) > math.pi)
    other = turned | _second_directions(book, directions & rows.active, turned)
    if not (other & rows.active).any():
        return book
    values = rows.values.copy()
    values[turned] = FULL_TURN - np.remainder(values[turned], FULL_TURN)
    folded = other & directions
    values[folded] = np.remainder(values[folded] - math.pi, FULL_TURN)
    book = replace(book, observations=replace(rows, values=values))
    kinds = {"directions": directions, "zenith angles": zeniths}
    found = {kind: _pairs(book, chosen & rows.active, other) for kind, chosen in kinds.items()}
    told = tuple(_told(book, other, found, faces))
    return (_with_means(book, found) if faces == MEAN else book).warned(*told)


def _second_directions(book: FieldBook, directions: BoolArray, turned: BoolArray) -> BoolArray:
    """(n,) which directions are of the second face."""
    rows = book.observations
    columns = (rows.file_indices, rows.lines, rows.from_points, rows.to_points)
    lines = list(zip(*(column.tolist() for column in columns), strict=True))
    on_lines: dict[tuple[int, ...], list[bool]] = defaultdict(list)
    for row in np.flatnonzero(rows.types == ZEN.code).tolist():
        on_lines[lines[row]].append(bool(turned[row]))
    met: dict[tuple[int, ...], int] = defaultdict(int)
    second = np.zeros(len(rows), np.bool_)
    sights: dict[tuple[int, int], list[int]] = defaultdict(list)
    known: dict[int, bool] = {}
    stations = rows.stations.tolist()
    for row in np.flatnonzero(directions).tolist():
        line = lines[row]
        if faces := on_lines.get(line):  # a line of a stream holds several sights of a target
            second[row] = known[row] = faces[min(met[line], len(faces) - 1)]
            met[line] += 1
        sights[stations[row], line[-1]].append(row)
    apart: dict[int, list[int]] = defaultdict(list)
    for alike in sights.values():
        for row in alike[1:]:
            if row not in known and _is_near(rows.values[row] - rows.values[alike[0]], math.pi):
                apart[int(rows.from_points[row])].append(row)
    for several in apart.values():
        second[several] = len(several) > 1
    return second


def _pairs(book: FieldBook, chosen: BoolArray, second: BoolArray) -> _Pairs:
    """The n-th sight of a target in the first face with the n-th in the second one, set-up by set-up."""
    rows = book.observations
    sights: dict[tuple[float, ...], tuple[list[int], list[int]]] = defaultdict(lambda: ([], []))
    correlated = {row for cluster in book.clusters for row in cluster.rows.tolist()}
    columns = (rows.stations, rows.from_points, rows.to_points, rows.from_heights, rows.to_heights, second)
    taken = np.flatnonzero(chosen)
    for row, *sight, face in zip(
        taken.tolist(), *(column[taken].tolist() for column in columns), strict=True
    ):
        if row not in correlated:
            sights[tuple(sight)][face].append(row)
    pairs = np.array([pair for faces in sights.values() for pair in zip(*faces, strict=False)], np.int64)
    first, last = pairs.reshape(-1, 2).T
    halves = (np.remainder(rows.values[last] - rows.values[first] + math.pi, FULL_TURN) - math.pi) / 2.0
    alike = np.abs(halves) <= CLOSE
    apart = [(int(a), int(b)) for a, b in zip(first[~alike], last[~alike], strict=True)]
    first, last = first[alike], last[alike]
    sigmas = np.hypot(rows.sigmas[first], rows.sigmas[last]) / 2.0
    return _Pairs(list(zip(first.tolist(), last.tolist(), strict=True)), halves[alike], sigmas, apart)


def _with_means(book: FieldBook, found: dict[str, _Pairs]) -> FieldBook:
    """The first reading of each pair becomes the mean; the second one is switched off."""
    rows = book.observations
    values, sigmas, active = rows.values.copy(), rows.sigmas.copy(), rows.active.copy()
    for pairs in found.values():
        first, last = np.array(pairs.rows, np.int64).reshape(-1, 2).T
        values[first] += pairs.halves
        sigmas[first] = np.hypot(rows.sigmas[first], rows.sigmas[last]) / 2.0
        active[last] = False
    return replace(book, observations=replace(rows, values=values, sigmas=sigmas, active=active))


def _told(book: FieldBook, second: BoolArray, found: dict[str, _Pairs], faces: str) -> Iterator[str]:
    """What was folded and reduced; collimation and index errors by instrument; pairs that differ."""
    rows = np.flatnonzero(second).tolist()
    origins = dict.fromkeys(book.point_names[book.observations.from_points[row]] for row in rows)
    counts = ", ".join(f"{len(pairs.rows)} pairs of {kind}" for kind, pairs in found.items() if pairs.rows)
    yield (
        f"sights in both faces of the telescope, from {listed(list(origins), MOST)}: {len(rows)} readings of "
        f"the second face are folded into the first one ({book.label(rows[0])} is the first)"
        + (f"; {counts} are reduced to their means" if counts and faces == MEAN else "")
    )
    for kind, pairs in found.items():
        if pairs.apart:
            shown = listed([book.label(row) for row, _ in pairs.apart], MOST)
            what = f"{len(pairs.apart)} pairs of {kind} are too far apart to be of one sight"
            yield f"{what}: both readings stay ({shown})"
    names = {"directions": "collimation error", "zenith angles": "index error"}
    for kind, pairs in found.items():
        for instrument, chosen in _by_instrument(book, pairs):
            yield from _compared(book, pairs, chosen, names[kind], instrument)


def _by_instrument(book: FieldBook, pairs: _Pairs) -> Iterable[tuple[str, list[int]]]:
    """The pairs of each instrument that files name; "" for those of none."""
    groups: dict[str, list[int]] = defaultdict(list)
    for k, (row, _) in enumerate(pairs.rows):
        group = int(book.observations.groups[row])
        groups[book.groups[group].name if group >= 0 else ""].append(k)
    return groups.items()


def _compared(book: FieldBook, pairs: _Pairs, chosen: list[int], name: str, instrument: str) -> Iterator[str]:
    """An error of the instrument with its precision, and the pairs that differ from it."""
    halves, sigmas = pairs.halves[chosen], pairs.sigmas[chosen]
    weights = 1.0 / sigmas**2
    mean = float(np.sum(weights * halves) / np.sum(weights))
    if len(chosen) < 2:
        return
    spread = math.sqrt(float(np.sum(weights * (halves - mean) ** 2)) / (len(chosen) - 1))
    of = f" of {instrument}" if instrument else ""
    precision = spread / math.sqrt(float(np.sum(weights)))
    text = f"{name}{of} from {len(chosen)} pairs: {-mean / CC:+.1f} cc, sigma {precision / CC:.1f} cc"
    odd = np.flatnonzero(np.abs(halves - mean) > LIMIT * np.sqrt(sigmas**2 - 1.0 / np.sum(weights)))
    if odd.size:
        worst = sorted(odd.tolist(), key=lambda k: -abs(float(halves[k] - mean) / sigmas[k]))
        shown = [
            f"{book.label(pairs.rows[chosen[k]][0])} by {2.0 * (halves[k] - mean) / CC:+.0f} cc"
            for k in worst
        ]
        text += f"; faces differ by more than their sigmas in {len(odd)}: {listed(shown, MOST)}"
    if others := list(_other_set_ups(book, pairs, chosen, mean)):
        text += f"; other in {len(others)} set-ups: {listed(others, MOST)}"
    yield text


def _other_set_ups(book: FieldBook, pairs: _Pairs, chosen: list[int], mean: float) -> Iterator[str]:
    """Set-ups whose error is another than that of their instrument, each with its own, in words."""
    set_ups: dict[tuple[int, int], list[int]] = defaultdict(list)
    for k in chosen:
        row = pairs.rows[k][0]
        set_ups[int(book.observations.from_points[row]), int(book.observations.stations[row])].append(k)
    whole = float(np.sum(pairs.sigmas[chosen] ** -2.0))
    for (origin, _), own in set_ups.items():
        weights = pairs.sigmas[own] ** -2.0
        share = float(np.sum(weights))
        error = float(np.sum(weights * pairs.halves[own])) / share
        if (
            len(own) > 1
            and share < whole
            and abs(error - mean) > LIMIT * math.sqrt(1.0 / share - 1.0 / whole)
        ):
            yield f"{book.point_names[origin]} ({-error / CC:+.1f} cc)"


def _is_near(angle: float, other: float) -> bool:
    return abs(math.remainder(angle - other, FULL_TURN)) < CLOSE
