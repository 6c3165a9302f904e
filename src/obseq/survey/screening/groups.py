"""One cause for many observations: all the angles of a file in degrees, all zenith angles elevations, and so on.

A whole group that is wrong leaves nothing to compare it with one by one. So each likely cause is tried: the group
is put right, the network is computed anew, and the cause that removes most contradictions is the likely one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import ObseqError
from obseq.survey.model import ObservationType
from obseq.survey.screening.findings import Cause, GrossError
from obseq.survey.screening.robust import GROSS, Estimate, Model, estimate
from obseq.survey.screening.values import GON, Mistake, mistakes_of

if TYPE_CHECKING:
    from obseq.survey.model import FieldBook

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

REMAINS = 0.35
"""Share of the contradictions that may remain once the right cause has been found."""
_SUSPECT = 0.4
"""Share of suspects from which a group is tried as a whole."""
_MOST_TRIALS = 60


@dataclass(frozen=True, eq=False)
class Group:
    """Observations that may share one mistake, and what they are called."""

    rows: Rows
    name: str


def group_cause(model: Model, found: Estimate) -> tuple[GrossError, Estimate] | None:
    """The mistake of a group that explains most, with the network without it; None when there is none."""
    before = found.disagreement(GROSS)
    best: tuple[float, int, Group, str, Cause, Estimate] | None = None
    for trial, (group, mistake, values) in enumerate(_trials(found)):
        if trial == _MOST_TRIALS:
            break
        corrected = _tried(model, found, values)
        if corrected is None:
            continue
        left = corrected.disagreement(GROSS)
        key = (round(left, 1), -len(group.rows))
        if best is None or key < best[:2]:
            best = (*key, group, mistake.text, mistake.cause, corrected)
    if best is None or best[0] > REMAINS * before or before - best[0] < 1.5:
        return None
    _, _, group, text, cause, corrected = best
    names = tuple(found.book.label(int(row)) for row in group.rows[:1])
    what = f"{group.name} (the first: {names[0]})"
    size = float(found.ratios[group.rows].max(initial=0.0))
    rows = tuple(int(row) for row in group.rows)
    return GrossError(what, cause, f"they look like {text}", size, rows), corrected


def _tried(
    model: Model, found: Estimate, values: np.ndarray[tuple[int], np.dtype[np.float64]]
) -> Estimate | None:
    """The network with other values; None when nothing of it can be computed."""
    observations = replace(found.book.observations, values=values)
    try:
        return estimate(model, found.points, replace(found.book, observations=observations), quick=True)
    except ObseqError:
        return None


def _trials(
    found: Estimate,
) -> Iterator[tuple[Group, Mistake, np.ndarray[tuple[int], np.dtype[np.float64]]]]:
    """Groups, mistakes, and the values of all observations with that mistake put right."""
    for group in _groups(found):
        kinds = {ObservationType(kind) for kind in found.book.observations.types[group.rows].tolist()}
        for mistake in _shared_mistakes(kinds):
            values = found.book.observations.values.copy()
            right = np.array([mistake.right(value) for value in values[group.rows].tolist()])
            if _is_plausible(kinds, mistake, values[group.rows], right):
                values[group.rows] = right
                yield group, mistake, values
        if kinds == {ObservationType.Hz, ObservationType.Zen}:
            yield from _degrees_and_elevations(found, group)


def _degrees_and_elevations(
    found: Estimate, group: Group
) -> Iterator[tuple[Group, Mistake, np.ndarray[tuple[int], np.dtype[np.float64]]]]:
    """All angles in degrees, the zenith angles being elevations too."""
    values = found.book.observations.values.copy()
    in_degrees = values[group.rows] * 10.0 / 9.0
    is_zenith = found.book.observations.types[group.rows] == ObservationType.Zen
    values[group.rows] = np.where(is_zenith, math.pi / 2.0 - in_degrees, in_degrees)
    text = "degrees instead of gon, and elevations instead of zenith angles"
    yield group, Mistake(Cause.ELEVATION, text, lambda v: v), values


def _shared_mistakes(kinds: set[ObservationType]) -> list[Mistake]:
    """The mistakes that all these kinds can have."""
    first, *others = sorted(kinds)
    found = list(mistakes_of(first))
    for kind in others:
        texts = {mistake.text for mistake in mistakes_of(kind)}
        found = [mistake for mistake in found if mistake.text in texts]
    return found


def _is_plausible(
    kinds: set[ObservationType],
    mistake: Mistake,
    values: np.ndarray[tuple[int], np.dtype[np.float64]],
    right: np.ndarray[tuple[int], np.dtype[np.float64]],
) -> bool:
    """Whether values look as they would with a mistake: what is cheap to see is not tried."""
    written = np.abs(values) * GON
    if mistake.text.startswith("radians"):
        return bool(written.max() <= 2.0 * math.pi)
    if mistake.text.startswith("degrees, minutes"):
        return bool((written % 1.0 < 0.6001).all() and written.max() < 360.0)
    if mistake.text.startswith("degrees") and written.max() > 360.0:
        return False
    if kinds == {ObservationType.Zen} and mistake.cause is not Cause.SENSE:
        level = math.pi / 2.0
        return bool(abs(np.median(right) - level) < abs(np.median(values) - level))
    return True


def _groups(found: Estimate) -> Iterator[Group]:
    """Groups with many suspects: of all files, of one file, of one station or point; the largest first."""
    seen: set[bytes] = set()
    for group in _possible_groups(found.book):
        key = group.rows.tobytes()
        share = float(np.mean(found.ratios[group.rows] > GROSS)) if len(group.rows) else 0.0
        if len(group.rows) >= 2 and key not in seen and share >= _SUSPECT:
            seen.add(key)
            yield group


def _possible_groups(book: FieldBook) -> Iterator[Group]:
    observations = book.observations
    kinds = [ObservationType(kind) for kind in np.unique(observations.types[observations.active]).tolist()]
    angles = [kind for kind in kinds if kind.is_angle]
    lengths = [kind for kind in kinds if not kind.is_angle]
    for name, chosen in (("angles", angles), ("lengths", lengths)):
        if len(chosen) > 1:
            yield from _parts_of(book, name, chosen)
    for kind in kinds:
        yield from _parts_of(book, f"{kind.name} observations", [kind])


def _parts_of(book: FieldBook, name: str, kinds: list[ObservationType]) -> Iterator[Group]:
    observations = book.observations
    mine = np.flatnonzero(np.isin(observations.types, kinds) & observations.active)
    yield Group(mine, f"all {len(mine)} {name}")
    for number, file in enumerate(book.files):
        rows = mine[observations.file_indices[mine] == number]
        yield Group(rows, f"all {len(rows)} {name} of {file}")
    order = np.argsort(observations.from_points[mine], kind="stable")
    starts = np.flatnonzero(np.diff(observations.from_points[mine[order]], prepend=-1))
    for rows in np.split(mine[order], starts[1:]) if len(mine) else ():
        point = book.point_names[observations.from_points[rows[0]]]
        yield Group(np.sort(rows), f"all {len(rows)} {name} from {point}")
