"""One offset that several sights share: of a height, of an index, the constant or scale of distances.

Each group of sights that may share one is corrected by the offset that fits it best, and the network is
computed anew. A height changes zenith angles by its share across the sight and distances by that along it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.screening.distances import LARGEST_CONSTANT
from obseq.survey.screening.findings import Cause, GrossError, any_of
from obseq.survey.screening.offset_effects import Sights, What, slopes, zenith_angles
from obseq.survey.screening.robust import GROSS
from obseq.survey.screening.substitutes import sigma_of
from obseq.survey.screening.values import COORDINATE, explain

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from obseq.arrays import BoolArray, FloatArray
    from obseq.survey.model import FieldBook
    from obseq.survey.screening.offset_effects import Change
    from obseq.survey.screening.robust import Estimate
    from obseq.survey.screening.trials import Trials

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_HIT = 5.0
"""Sigmas of an offset within which an explanation must hit."""
_LEAST_SHOWN = 2
"""Observations that must show the offset: one alone says nothing of where it comes from."""
_SHARE = 0.8
"""Share of a group that an offset must fit."""
_ROUNDS, _STEP = 4, 1e-3
"""How often an offset is improved, and by what its effect is found (m)."""
_EQUAL = 0.1
"""Contradictions by which two offsets may differ that explain a network equally well."""
_HIGHEST = 10.0
"""Height of an instrument or a target (m) above which none is thought of where none is written."""
_GAIN = 0.65
"""Contradictions, for each suspect of a group, that its offset must remove."""


LARGEST = {What.CONSTANT: LARGEST_CONSTANT, What.SCALE: 3e-3, What.INDEX: 0.5 * math.pi}
"""Constants (m), scales less 1 and indices (rad) beyond which something else is wrong: a unit, the face."""


_INDEX = "an error of the index"


@dataclass(frozen=True, eq=False)
class Offset:
    """An offset of a group.

    Attributes:
        what: what is off.
        rows: the observations that share it.
        size: m, to be added; of a scale, parts; of an index, rad.
        sigma: its standard deviation, as the size.
        suspects: the suspects that it explains.
    """

    what: What
    rows: Rows
    size: float
    sigma: float
    suspects: Rows


def offset_cause(trials: Trials) -> tuple[GrossError, Estimate] | None:
    """The offset that explains most, with the network in which it is corrected; None when there is none."""
    offsets = sorted(_offsets(trials.found), key=lambda one: -len(one.suspects))
    offsets = _once(found for one in offsets for found in _with_equals(trials.found, one))
    offsets = [one for one in offsets if is_possible(trials.found, one)]
    explaining: list[tuple[float, Offset, Estimate]] = []
    for number, one in enumerate(offsets):
        if number == trials.most:
            trials.untried.append("heights and constants of more set-ups")
            break
        corrected = _explaining(trials, one)
        if corrected is not None:
            explaining.append((corrected.disagreement(GROSS), one, corrected))
    if not explaining:
        return None
    least = min(left for left, _, _ in explaining)
    equal = [(one, corrected) for left, one, corrected in explaining if left <= least + _EQUAL]
    return any_of([described(trials.found, one) for one, _ in equal]), equal[0][1]


def _explaining(trials: Trials, one: Offset) -> Estimate | None:
    """The network without an offset, where that explains its suspects: from where it was found, else anew."""
    found, book = trials.found, corrected_by(trials.found.book, one)
    for start in (replace(found.end, book=corrected_by(found.end.book, one)), None):
        corrected = trials.tried(found.points, book, start)
        contradictions = float(found.contradictions(GROSS)[one.suspects].sum())
        if corrected and trials.before - corrected.disagreement(GROSS) >= _GAIN * contradictions:
            return corrected
    return None


def _once(offsets: Iterator[Offset]) -> list[Offset]:
    return list({(one.what, one.rows.tobytes()): one for one in offsets}.values())


def is_possible(found: Estimate, one: Offset) -> bool:
    """Whether heights would be such as others of the network are, or upright and some metres at most."""
    if not one.what.is_height:
        return True
    written, margin = _heights(found, one.what), _HIT * one.sigma
    right = written[one.rows] + one.size
    lowest, highest = min(0.0, float(written.min())), max(_HIGHEST, float(written.max()))
    return bool((right >= lowest - margin).all() and (right <= highest + margin).all())


def _heights(found: Estimate, what: What) -> FloatArray:
    observations = found.book.observations
    return observations.from_heights if what is What.INSTRUMENT else observations.to_heights


def _offsets(found: Estimate) -> Iterator[Offset]:
    """Offsets that would explain all suspects of a group, and fit the rest of it."""
    sights = Sights.of(found)
    seen: set[bytes] = set()
    for what, rows in _groups(found):
        key = what.value.encode() + rows.tobytes()
        if key not in seen and (offset := _fitted(found, what, rows, sights)) is not None:
            seen.add(key)
            yield offset


def _with_equals(found: Estimate, one: Offset) -> Iterator[Offset]:
    """An offset, and those that would do the same: of the other end, and of the sights the other way."""
    for same in (one, *_mirrored(found, one)):
        yield same
        yield from _of_the_other_end(found, same)


def _of_the_other_end(found: Estimate, one: Offset) -> Iterator[Offset]:
    """The height at the other end of sights that have both ends in common, and that no other sights share."""
    observations = found.book.observations
    if not one.what.is_height or not _has_one_way(found, one.rows):
        return
    if one.what is What.INSTRUMENT:
        yield replace(one, what=What.TARGET, size=-one.size)
        return
    first = one.rows[0]
    origin, height = observations.from_points[first], observations.from_heights[first]
    mine = _height_seeing(found) & (observations.from_points == origin)
    if np.array_equal(one.rows, _rows(mine & (observations.from_heights == height))):
        yield replace(one, what=What.INSTRUMENT, size=-one.size)


def _has_one_way(found: Estimate, rows: Rows) -> bool:
    observations = found.book.observations
    ends = (observations.from_points[rows], observations.to_points[rows])
    return all(bool((points == points[0]).all()) for points in ends)


def _height_seeing(found: Estimate) -> BoolArray:
    """(k,) the observations that heights of instrument and target change."""
    observations = found.book.observations
    is_used = observations.active & np.isfinite(found.misfits)
    return np.asarray(is_used & np.isin(observations.types, [*zenith_angles(), *slopes()]))


def _mirrored(found: Estimate, one: Offset) -> Iterator[Offset]:
    """The height of the sights the other way at a point, whose own height would take up the rest."""
    observations = found.book.observations
    ends = observations.from_points, observations.to_points
    mine, others = ends if one.what is What.INSTRUMENT else ends[::-1]
    point = mine[one.rows[0]]
    if not one.what.is_height or (mine[one.rows] != point).any():
        return
    rows = _rows(_height_seeing(found) & (others == point))
    if len(rows):
        what = What.TARGET if one.what is What.INSTRUMENT else What.INSTRUMENT
        yield replace(one, what=what, rows=rows, size=-one.size)


def _fitted(found: Estimate, what: What, rows: Rows, sights: Sights) -> Offset | None:
    """The offset that fits a group; None where it explains nothing, or not the whole group."""
    rows = sights.seeing(what, rows)
    suspects = rows[found.ratios[rows] > found.limit]
    if len(suspects) < _LEAST_SHOWN:
        return None
    sigmas = np.array([sigma_of(found, row) for row in rows.tolist()])
    changed = sights.change(what, rows)
    size, sigma = _size(found.misfits[rows], sigmas, changed)
    if abs(size) > LARGEST.get(what, math.inf):
        return None
    change = changed(size)
    fits = np.abs(found.misfits[rows] + change) / sigmas <= found.limit
    shown = np.abs(change) / sigmas > found.limit
    if not fits[np.isin(rows, suspects)].all() or fits.mean() < _SHARE or shown.sum() < _LEAST_SHOWN:
        return None
    return Offset(what, rows, size, sigma * found.scale, suspects)


def _size(misfits: FloatArray, sigmas: FloatArray, changed: Change) -> tuple[float, float]:
    """The offset that most of the observations want, and its standard deviation (m)."""
    size, shares = 0.0, np.ones(len(misfits))
    for _ in range(_ROUNDS):
        change = changed(size)
        shares = (changed(size + _STEP) - change) / _STEP
        shares = np.where(np.abs(shares) > 1e-9, shares, 1e-9)
        size += _weighted_median(-(misfits + change) / shares, np.abs(shares) / sigmas)
    return size, float(np.sum((shares / sigmas) ** 2) ** -0.5)


def _weighted_median(values: FloatArray, weights: FloatArray) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


def _groups(found: Estimate) -> Iterator[tuple[What, Rows]]:
    """Sights of suspects that may share an offset; those from a point to another, too."""
    observations = found.book.observations
    is_used = observations.active & np.isfinite(found.misfits)
    ends = observations.from_points, observations.to_points
    origins, targets = (np.unique(end[found.suspects]).tolist() for end in ends)
    yield from sharing(found, origins, targets)
    for target in targets:
        mine = is_used & (ends[1] == target)
        for origin in np.unique(ends[0][mine]).tolist():
            yield What.TARGET, _rows(mine & (ends[0] == origin))


def sharing(found: Estimate, origins: Iterable[int], targets: Iterable[int]) -> Iterator[tuple[What, Rows]]:
    """Sights from points with one height, and to points; distances and zenith angles from and to points.

    A scale is of the instrument, not of what it looks at.
    """
    observations = found.book.observations
    is_used = observations.active & np.isfinite(found.misfits)
    for origin in origins:
        mine = is_used & (observations.from_points == origin)
        for height in np.unique(observations.from_heights[mine]).tolist():
            yield What.INSTRUMENT, _rows(mine & (observations.from_heights == height))
        for what in (What.CONSTANT, What.SCALE, What.INDEX):
            yield what, _rows(mine)
    for target in targets:
        mine = is_used & (observations.to_points == target)
        for what in (What.TARGET, What.CONSTANT, What.INDEX):
            yield what, _rows(mine)


def _rows(mask: BoolArray) -> Rows:
    return np.flatnonzero(mask).astype(np.intp)


def corrected_by(book: FieldBook, one: Offset) -> FieldBook:
    """The observations with an offset added."""
    name = {What.INSTRUMENT: "from_heights", What.TARGET: "to_heights"}.get(one.what, "values")
    column = getattr(book.observations, name).copy()
    column[one.rows] += one.size * (column[one.rows] if one.what is What.SCALE else 1.0)
    return replace(book, observations=replace(book.observations, **{name: column}))


def described(found: Estimate, one: Offset) -> GrossError:
    """What is off, and by how much."""
    rows = one.rows
    label = found.book.label(int(rows[0]))
    size = float(found.ratios[one.suspects].max())
    if one.what.is_height:
        cause, text = _of_height(found, one)
        what = f"{one.what.value} of {len(rows)} observations{_between(found, rows)} (the first: {label})"
    elif one.what is What.INDEX:
        cause, text = Cause.INDEX, _of_index(found, one)
        what = f"the {len(rows)} zenith angles{_between(found, rows)} (the first: {label})"
    else:
        cause, text = Cause.DISTANCES, _of_distances(found, one)
        what = f"the {len(rows)} distances{_between(found, rows)} (the first: {label})"
    return GrossError(what, cause, text, size, tuple(one.suspects.tolist()), is_one=one.what.is_height)


def _of_index(found: Estimate, one: Offset) -> str:
    """What is to be added to zenith angles, in words."""
    added, targets = found.units.angle.number(one.size), found.book.observations.to_points[one.rows]
    is_of_target = bool((targets == targets[0]).all())
    likely = "another mark was aimed at, or its readings are of another kind" if is_of_target else _INDEX
    return f"{added} {found.units.angle.name} added to each of them fits: likely {likely}"


def _of_distances(found: Estimate, one: Offset) -> str:
    """What constant or scale distances want, in words."""
    if one.what is What.SCALE:
        return (
            f"{1e6 * one.size:+.0f} ppm added to each of them fits: likely a correction in ppm that is wrong"
        )
    return f"{_signed(found, one.size)} added to each of them fits: likely the constant of the prism"


def _between(found: Estimate, rows: Rows) -> str:
    """From and to where sights go that have a point in common, after a blank; else nothing."""
    observations, names = found.book.observations, found.book.point_names
    ends = (("from", observations.from_points), ("to", observations.to_points))
    common = [(word, points[rows[0]]) for word, points in ends if (points[rows] == points[rows[0]]).all()]
    return "".join(f" {word} {names[point]}" for word, point in common)


def _of_height(found: Estimate, one: Offset) -> tuple[Cause, str]:
    """What the height should have been, and what slip makes the one that is written of it."""
    written = np.unique(_heights(found, one.what)[one.rows])
    if len(written) > 1:
        return Cause.HEIGHT, f"{_signed(found, one.size)} added to each of them fits"
    height = float(written[0])
    is_written, fits = map(found.units.length.text, (height, height + one.size))
    text = f"{is_written} is written, {fits} fits"
    if height == 0.0:
        return Cause.HEIGHT, f"{text}: likely it was left out"
    why = explain(COORDINATE, height, height + one.size, _HIT * one.sigma, found.units)
    return Cause.HEIGHT, text if why is None else f"{text}; likely: {why.text}"


def _signed(found: Estimate, size: float) -> str:
    """A length (m) to be added, in the units of reports."""
    return f"{'+' if size >= 0.0 else ''}{found.units.length.text(size)}"
