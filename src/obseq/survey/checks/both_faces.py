"""Readings in both faces of the telescope: folded into the first one, reduced to means, compared.

A zenith angle beyond half a turn is one of the second face: a full turn less it is that of the first. A
direction on its line is half a turn from that of the first face. Negative ones near zero are elevations below
the horizon: they stay, and the search for errors tells them. Where lines hold single angles, two or more
targets of one point whose directions come half a turn apart are sights in both faces; one may be a slip.

Half of first minus second face is the collimation error over the sine of the zenith angle, and the index
error of the vertical circle. Means are free of both, so means are adjusted.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from obseq.arrays import Array, BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.printable import listed
from obseq.survey.kinds.directions import HZ, ZEN
from obseq.survey.model import FieldBook

MEAN, ALL = "mean", "all"
"""What becomes of readings in both faces."""
FULL_TURN = 2.0 * math.pi
CLOSE = 0.5 * math.pi / 200.0
"""Errors of an instrument between its faces, generously (rad)."""
FLAT = math.pi / 4.0
"""Negative values nearer to zero are elevations below the horizon: in the other face, such a sight would be
steeper than any that is not to a plumb point (rad)."""
MOST = 4
LIMIT = 3.29
"""Standardised difference beyond which a pair is named: a chance of 0.1 %."""
CC = math.pi / 2_000_000.0


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Sights of one kind that were read in both faces, folded into the first one.

    Attributes:
        rows: (n, 2) of the field book, first and second face; by the first one.
        halves: (n,) half of second minus first face (rad).
        sigmas: (n,) standard deviation of each half.
        apart: Pairs that no error of an instrument explains: both readings stay.
    """

    rows: IntArray
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
    below = zeniths & (rows.values < 0.0) & (rows.values > -FLAT)
    if (rows.values[below] < -CLOSE).any():  # those nearly level, too
        turned &= ~below
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
    rows, second = book.observations, np.zeros(len(book.observations), np.bool_)
    chosen, zeniths = np.flatnonzero(directions), np.flatnonzero(rows.types == ZEN.code)
    lines = _numbered(rows.file_indices, rows.lines, rows.from_points, rows.to_points)
    zeniths = zeniths[np.argsort(lines[zeniths], kind="stable")]
    begins = np.searchsorted(lines[zeniths], lines[chosen])
    counts = np.searchsorted(lines[zeniths], lines[chosen], "right") - begins
    known = counts > 0  # a line of a stream holds several sights of a target: the n-th with the n-th
    nth = np.minimum(_occurrences(lines[chosen]), counts - 1)
    second[chosen[known]] = turned[zeniths[(begins + nth)[known]]]
    sights = _numbered(rows.stations[chosen], rows.to_points[chosen])
    _, first, which = np.unique(sights, return_index=True, return_inverse=True)
    difference = rows.values[chosen] - rows.values[chosen][first[which]]
    is_apart = np.abs(np.remainder(difference, FULL_TURN) - math.pi) < CLOSE
    apart = chosen[~known & is_apart]
    origins = rows.from_points[apart]
    second[apart[np.bincount(origins, minlength=1)[origins] > 1]] = True
    return second


def _pairs(book: FieldBook, chosen: BoolArray, second: BoolArray) -> _Pairs:
    """The n-th sight of a target in the first face with the n-th in the second one, set-up by set-up."""
    rows, chosen = book.observations, chosen.copy()
    for cluster in book.clusters:
        chosen[cluster.rows] = False
    taken = np.flatnonzero(chosen)
    columns = (rows.stations, rows.from_points, rows.to_points, rows.from_heights, rows.to_heights)
    sights = _numbered(*(column[taken] for column in columns))
    nth = _occurrences(2 * sights + second[taken])
    pairs = _numbered(sights, nth)
    order = np.lexsort((second[taken], pairs))
    is_pair = np.flatnonzero(np.diff(pairs[order]) == 0)
    first, last = taken[order[is_pair]], taken[order[is_pair + 1]]
    in_file = np.argsort(first)
    first, last = first[in_file], last[in_file]
    halves = (np.remainder(rows.values[last] - rows.values[first] + math.pi, FULL_TURN) - math.pi) / 2.0
    alike = np.abs(halves) <= CLOSE
    apart = [(int(a), int(b)) for a, b in zip(first[~alike], last[~alike], strict=True)]
    first, last = first[alike], last[alike]
    sigmas = np.hypot(rows.sigmas[first], rows.sigmas[last]) / 2.0
    return _Pairs(np.column_stack([first, last]), halves[alike], sigmas, apart)


def _numbered(*columns: Array) -> IntArray:
    """(n,) a number for each row of columns (n,), from 0, the same where all of them are alike."""
    order = np.lexsort(columns)
    is_new = np.zeros(len(order), np.bool_)
    for column in columns:
        is_new[1:] |= np.diff(column[order]) != 0
    numbers = np.empty(len(order), np.int64)
    numbers[order] = np.cumsum(is_new)
    return numbers


def _occurrences(numbers: IntArray) -> IntArray:
    """(n,) how many of the numbers before each are the same."""
    order = np.argsort(numbers, kind="stable")
    placed, counts = numbers[order], np.empty(len(order), np.int64)
    counts[order] = np.arange(len(order)) - np.searchsorted(placed, placed)
    return counts


def _with_means(book: FieldBook, found: dict[str, _Pairs]) -> FieldBook:
    """The first reading of each pair becomes the mean; the second one is switched off."""
    rows = book.observations
    values, sigmas, active = rows.values.copy(), rows.sigmas.copy(), rows.active.copy()
    for pairs in found.values():
        first, last = pairs.rows.T
        values[first] += pairs.halves
        sigmas[first] = np.hypot(rows.sigmas[first], rows.sigmas[last]) / 2.0
        active[last] = False
    return replace(book, observations=replace(rows, values=values, sigmas=sigmas, active=active))


def _told(book: FieldBook, second: BoolArray, found: dict[str, _Pairs], faces: str) -> Iterator[str]:
    """What was folded and reduced; collimation and index errors by instrument; pairs that differ."""
    rows = np.flatnonzero(second).tolist()
    origins = dict.fromkeys(book.point_names[book.observations.from_points[row]] for row in rows)
    counts = ", ".join(
        f"{len(pairs.rows)} pairs of {kind}" for kind, pairs in found.items() if len(pairs.rows)
    )
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


def _by_instrument(book: FieldBook, pairs: _Pairs) -> Iterator[tuple[str, IntArray]]:
    """The pairs of each instrument that files name; "" for those of none."""
    groups = book.observations.groups[pairs.rows[:, 0]]
    for group in np.unique(groups).tolist():
        yield book.groups[group].name if group >= 0 else "", np.flatnonzero(groups == group)


def _compared(book: FieldBook, pairs: _Pairs, chosen: IntArray, name: str, instrument: str) -> Iterator[str]:
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


def _other_set_ups(book: FieldBook, pairs: _Pairs, chosen: IntArray, mean: float) -> Iterator[str]:
    """Set-ups whose error is another than that of their instrument, each with its own, in words."""
    rows, weights = pairs.rows[chosen, 0], pairs.sigmas[chosen] ** -2.0
    origins = book.observations.from_points[rows]
    _, first, which = np.unique(
        _numbered(book.observations.stations[rows], origins), return_index=True, return_inverse=True
    )
    shares, whole = np.bincount(which, weights), float(np.sum(weights))
    errors = np.bincount(which, weights * pairs.halves[chosen]) / shares
    several = (np.bincount(which) > 1) & (shares < whole)
    limits = LIMIT * np.sqrt(np.maximum(1.0 / shares - 1.0 / whole, 0.0))
    for k in sorted(np.flatnonzero(several & (np.abs(errors - mean) > limits)), key=first.__getitem__):
        yield f"{book.point_names[origins[first[k]]]} ({-errors[k] / CC:+.1f} cc)"
