"""One cause for many observations: all the angles of a file in degrees, all zenith angles elevations, ...

A whole group that is wrong leaves nothing to compare it with one by one. So each likely cause is tried: the
group is put right, the network is computed anew, and the cause that removes most contradictions is the likely
one.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import BY_CODE, IS_ANGLE, codes, codes_where
from obseq.survey.model import Orientation
from obseq.survey.screening.findings import Cause, GrossError
from obseq.survey.screening.robust import GROSS, Estimate
from obseq.survey.screening.values import GON, Mistake, in_unit_of, mistakes_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from obseq.arrays import BoolArray, FloatArray
    from obseq.survey.kinds.kind import ObservationKind
    from obseq.survey.model import FieldBook
    from obseq.survey.screening.trials import Trials

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]
    Part = Callable[[FieldBook, Rows], Iterator[tuple[str, Rows]]]

_SUSPECT = 0.4
"""Share of suspects from which a group is tried as a whole."""
_FEW, _SUSPECT_OF_FEW = 300, 0.15
"""Observations up to which a group is small, and the share of suspects from which small ones are tried."""
_SAME = 1e-9
"""Difference of angles (rad) that is rounding."""
_SEVERAL = 4
"""Suspects from which small groups are tried whatever that share."""


@dataclass(frozen=True, eq=False)
class Group:
    """Observations that may share one mistake, and what they are called.

    Attributes:
        rows: of the observations, ascending.
        name: what they are called.
        source: all that comes from where they come from: a file, a point, or everything.
    """

    rows: Rows
    name: str
    source: Rows


def group_cause(trials: Trials) -> tuple[GrossError, Estimate] | None:
    """The mistake of a group that explains most, with the network without it; None when there is none."""
    found = trials.found
    best: tuple[float, int, Group, str, Cause, Estimate] | None = None
    for number, (group, mistake, values) in enumerate(_trials(trials)):
        if number == trials.most:
            trials.untried.append(f"groups from {group.name} on")
            break
        observations = replace(found.book.observations, values=values)
        corrected = trials.explaining(found.points, replace(found.book, observations=observations))
        if corrected is None or not trials.is_more_than_scaled(corrected, mistake.factor):
            continue
        left = corrected.disagreement(GROSS)
        key = (round(left, 1), -len(group.rows))
        if best is None or key < best[:2]:
            best = (*key, group, mistake.text, mistake.cause, corrected)
        if trials.is_decisive(corrected):
            break
    if best is None:
        return None
    _, _, group, text, cause, corrected = best
    names = tuple(found.book.label(int(row)) for row in group.rows[:1])
    what = f"{group.name} (the first: {names[0]})"
    size = float(found.ratios[group.rows].max(initial=0.0))
    rows = tuple(int(row) for row in group.rows)
    return GrossError(what, cause, f"they look like {text}", size, rows), corrected


def _trials(trials: Trials) -> Iterator[tuple[Group, Mistake, FloatArray]]:
    """Groups, mistakes, and the values of all observations with that mistake put right."""
    found = trials.found
    for group in _groups(found, by_share=trials.is_mostly_right):
        if not (trials.may_be_among(group.source) and trials.may_be_of(group.rows)):
            continue
        kinds = {BY_CODE[kind] for kind in found.book.observations.types[group.rows].tolist()}
        for mistake in (in_unit_of(one, found.units) for one in _shared_mistakes(kinds)):
            values = found.book.observations.values.copy()
            read = values[group.rows]
            right = np.array([mistake.right(value) for value in read.tolist()])
            if _is_plausible(kinds, mistake, read, right) and _may_fit(found.book, group, right):
                values[group.rows] = right
                yield group, mistake, values
        if {kind.start for kind in kinds} == {Start.HZ, Start.ZENITH}:
            yield from _degrees_and_elevations(found, group)


def _degrees_and_elevations(found: Estimate, group: Group) -> Iterator[tuple[Group, Mistake, FloatArray]]:
    """All angles in degrees, the zenith angles being elevations too."""
    values = found.book.observations.values.copy()
    in_degrees = values[group.rows] * 10.0 / 9.0
    right = np.where(_are_zeniths(found.book, group), math.pi / 2.0 - in_degrees, in_degrees)
    if _may_fit(found.book, group, right):
        values[group.rows] = right
        text = "degrees instead of gon, and elevations instead of zenith angles"
        yield group, Mistake(Cause.ELEVATION, text, lambda v: v), values


def _shared_mistakes(kinds: set[ObservationKind]) -> list[Mistake]:
    """The mistakes that all these kinds can have."""
    first, *others = sorted(kinds, key=lambda kind: kind.code)
    found = list(mistakes_of(first))
    for kind in others:
        texts = {mistake.text for mistake in mistakes_of(kind)}
        found = [mistake for mistake in found if mistake.text in texts]
    return found


def _is_plausible(
    kinds: set[ObservationKind],
    mistake: Mistake,
    values: FloatArray,
    right: FloatArray,
) -> bool:
    """Whether values look as they would with a mistake: what is cheap to see is not tried."""
    written = np.abs(values) * GON
    if mistake.text.startswith("radians"):
        return bool(written.max() <= 2.0 * math.pi)
    if mistake.text.startswith("degrees, minutes"):
        return bool((written % 1.0 < 0.6001).all() and written.max() < 360.0)
    if mistake.text.startswith("degrees") and written.max() > 360.0:
        return False
    if {kind.start for kind in kinds} == {Start.ZENITH} and mistake.cause is not Cause.SENSE:
        level = math.pi / 2.0
        return bool(abs(np.median(right) - level) < abs(np.median(values) - level))
    return True


def _may_fit(book: FieldBook, group: Group, right: FloatArray) -> bool:
    """Whether values put right can fit better, wherever the points are.

    Not so when most zenith angles are below 0 or above 200 gon then, nor when whole set-ups turn, which their
    unknown zeros take up.
    """
    zeniths = right[_are_zeniths(book, group)]
    if len(zeniths) and not 0.0 <= np.median(zeniths) <= math.pi:
        return False
    turns = np.ptp(right - book.observations.values[group.rows]) <= _SAME
    return not (turns and _are_whole_set_ups(book, group))


def _are_zeniths(book: FieldBook, group: Group) -> BoolArray:
    """Which observations of a group are zenith angles."""
    return np.isin(book.observations.types[group.rows], codes_where(lambda kind: kind.is_refracted))


def _are_whole_set_ups(book: FieldBook, group: Group) -> bool:
    """Whether a group is all that orients some set-ups whose zero is unknown."""
    rows, stations = book.observations, book.observations.stations[group.rows]
    if not np.isin(rows.types[group.rows], codes_where(lambda kind: kind.is_of_circle)).all():
        return False
    orienting = rows.active & np.isin(rows.types, codes_where(lambda kind: bool(kind.orients)))
    whole = np.flatnonzero(orienting & np.isin(rows.stations, stations))
    turns = np.isin(book.stations.orientations[stations], (Orientation.VERT, Orientation.BASC))
    return bool(turns.all()) and np.array_equal(whole, np.sort(group.rows))


def _groups(found: Estimate, *, by_share: bool) -> Iterator[Group]:
    """Groups with many suspects: of all files and of one file, the largest first; then those of one point.

    By their share, those with the most suspects come first; else large ones do with nearly as many.
    """
    seen: set[bytes] = set()
    parts = (_files_of, _origins_of)
    groups = [group for part in parts for group in _possible_groups(found.book, part)]
    groups.sort(key=lambda group: -_share(found, group) * _weight(found, group, by_share=by_share))
    for group in groups:
        key = group.rows.tobytes()
        is_new = len(group.rows) >= 2 and key not in seen
        if is_new and _share(found, group) > _least_share(found, group):
            seen.add(key)
            yield group


def _share(found: Estimate, group: Group) -> float:
    """Share of suspects in a group."""
    return float(np.mean(found.ratios[group.rows] > GROSS)) if len(group.rows) else 0.0


def _weight(found: Estimate, group: Group, *, by_share: bool) -> float:
    """What the share of suspects in a group is multiplied by, where groups are put in order."""
    return 1.0 if by_share else float(np.count_nonzero(found.ratios[group.rows] > GROSS))


def _least_share(found: Estimate, group: Group) -> float:
    """Share of suspects beyond which a group is tried.

    Wrong angles contradict each other; lengths in another unit may contradict nothing but what is known.
    """
    if len(group.rows) > _FEW:
        return _SUSPECT
    is_angle = IS_ANGLE[found.book.observations.types[group.rows]].any()
    return _SUSPECT_OF_FEW if is_angle and len(found.suspects) < _SEVERAL else 0.0


def _possible_groups(book: FieldBook, part: Part) -> Iterator[Group]:
    """Parts of all angles, all lengths and each kind: all and each file of them, or those from each point."""
    observations = book.observations
    kinds = [BY_CODE[kind] for kind in np.unique(observations.types[observations.active]).tolist()]
    angles = [kind for kind in kinds if kind.is_angle]
    lengths = [kind for kind in kinds if not kind.is_angle]
    sets = [("angles", angles), ("lengths", lengths)]
    sets = [(name, chosen) for name, chosen in sets if len(chosen) > 1]
    sets += [(f"{kind.name} observations", [kind]) for kind in kinds]
    sources = list(part(book, np.flatnonzero(observations.active)))
    for name, chosen in sets:
        is_one = np.isin(observations.types, codes(*chosen))
        for where, source in sources:
            rows = source[is_one[source]]
            yield Group(rows, f"all {len(rows)} {name}{where}", source)


def _files_of(book: FieldBook, every: Rows) -> Iterator[tuple[str, Rows]]:
    """Everything, then what is of each file, and how that is said."""
    yield "", every
    for number, file in enumerate(book.files):
        yield f" of {file}", every[book.observations.file_indices[every] == number]


def _origins_of(book: FieldBook, every: Rows) -> Iterator[tuple[str, Rows]]:
    """What is from each point, and how that is said."""
    origins = book.observations.from_points[every]
    order = np.argsort(origins, kind="stable")
    starts = np.flatnonzero(np.diff(origins[order], prepend=-1))
    for rows in np.split(every[order], starts[1:]) if len(every) else ():
        yield f" from {book.point_names[book.observations.from_points[rows[0]]]}", rows
