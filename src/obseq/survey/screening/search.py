"""The search for gross errors: causes of many observations first, then known points, then single values."""

from __future__ import annotations

from typing import TYPE_CHECKING, NoReturn

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError, ObseqError
from obseq.survey.adjustment.equations import sigmas_of
from obseq.survey.kinds.registry import IS_ANGLE
from obseq.survey.screening.aims import aim_cause
from obseq.survey.screening.ambiguous import Ambiguity
from obseq.survey.screening.beyond_nadir import beyond_nadir, lone_beyond, put_right, told_alone, with_signs
from obseq.survey.screening.coordinate_system import coordinate_system_cause
from obseq.survey.screening.distances import distances_cause
from obseq.survey.screening.exchanged import exchanged_readings
from obseq.survey.screening.findings import Cause, GrossError, any_of
from obseq.survey.screening.groups import group_cause
from obseq.survey.screening.half_turns import half_turn_cause
from obseq.survey.screening.known_points import known_point_cause, swapped_point_cause
from obseq.survey.screening.known_scale import known_scale_cause
from obseq.survey.screening.mirrored import mirrored_cause
from obseq.survey.screening.offsets import offset_cause
from obseq.survey.screening.robust import GROSS, WHOLE, Estimate, Model, estimate
from obseq.survey.screening.setups import setup_cause
from obseq.survey.screening.sight import sight_cause
from obseq.survey.screening.sights import single_errors
from obseq.survey.screening.sigmas import sigmas_cause
from obseq.survey.screening.standpoints import standpoint_cause
from obseq.survey.screening.station_names import station_name_cause
from obseq.survey.screening.target_names import is_told_by_names_alone, target_name_cause
from obseq.survey.screening.trials import Trials, estimated
from obseq.survey.screening.vector_systems import vector_system_cause

if TYPE_CHECKING:
    from obseq.survey.adjustment.equations import Equations
    from obseq.survey.adjustment.point_system import PointSystem
    from obseq.survey.initial.left_out import Determined
    from obseq.survey.model import FieldBook, Points

_MOST_CAUSES = 3
_MOST_SINGLE = 0.25
"""Share of suspects beyond which they are not taken one by one."""

_MOST_SINGLES = 300
"""Suspects that are taken one by one, the worst of them."""

_MOST_NAMED = 5
_FAR = 1e3
"""Sigmas beyond which an error is far from small, as tests of residuals suppose."""

_EQUAL = 0.1
"""Contradictions by which two causes may differ that explain a network equally well."""


@dataclass(frozen=True, eq=False)
class Search:
    """What was found.

    Attributes:
        errors: the gross errors with their likely causes, the worst first; none for an honest network.
        places: the network as it is, where it contradicts itself least; None where it was not looked for.
    """

    errors: tuple[GrossError, ...] = ()
    places: Estimate | None = None

    @property
    def wrong(self) -> tuple[int, ...]:
        """Rows of single observations that are wrong by so much that no iteration with them leads near."""
        return tuple(
            error.rows[0]
            for error in self.errors
            if len(error.rows) == 1 and not error.points and not error.is_one and error.size > _FAR
        )


def search(model: Model, system: PointSystem, points: Points, book: FieldBook) -> Search:
    """The gross errors of a network.

    Args:
        model: how initial values and equations are made.
        system: the coordinates of the point files.
        points: of the network, as `join` made them.
        book: its observations.
    """
    model, beyond = model.for_trials(), beyond_nadir(book)
    lone = np.setdiff1d(lone_beyond(book, flat=True), beyond)
    wrong = np.union1d(beyond, lone)
    try:
        found = estimate(model, points, put_right(book, wrong) if len(wrong) else book)
    except ObseqError:
        return Search()
    told, places = _errors(model, system, found, are_right=not len(beyond))
    if found.control <= 0.0:  # nothing is spare that would contradict an elevation
        lone = np.setdiff1d(lone_beyond(book, flat=False), beyond)
    errors = [*with_signs(book, beyond, found, told), *told_alone(book, lone, found)]
    return Search(tuple(sorted(errors, key=lambda error: -error.size)), places)


def _errors(
    model: Model, system: PointSystem, found: Estimate, *, are_right: bool
) -> tuple[list[GrossError], Estimate]:
    """The gross errors of an estimated network whose zenith angles are right, or have been put right.

    With them the network as it is where it contradicts itself least, which may be far from where its initial
    values lead.
    """
    errors: list[GrossError] = []
    untried: list[str] = []
    if found.suspects.size and (together := _cause_of_all(Trials(model, found), system)):
        turned = half_turn_cause(Trials(model, found))  # which explains as much with nothing to choose
        if turned is None:
            return [together], found
        errors, found = [turned[0]], turned[1]
    places = found
    if (found.suspects.size or not are_right) and (mirrored := mirrored_cause(Trials(model, found))):
        errors, found = [mirrored[0]], mirrored[1]
    for _ in range(_MOST_CAUSES):  # finding other places is one of them: what is settled may move back
        step = _cause_of_many(model, system, found, untried)
        if step is None:
            break
        error, found = step[0], _settled(model, step[1])
        untried.clear()
        if error is None:
            places = found
        else:
            errors.append(error)
    exchanged, suspects = exchanged_readings(found, found.suspects.tolist())
    ambiguous, suspects = _ambiguous(model, system, found, suspects)
    singles = _left_over(found, suspects, untried)
    return [*errors, *exchanged, *ambiguous, *singles], places


def _settled(model: Model, found: Estimate) -> Estimate:
    """A network of a trial, which takes few iterations, estimated to the end where something contradicts."""
    if not found.suspects.size:
        return found
    return estimated(model, found.points, found.book, WHOLE, found.end) or found


def _cause_of_all(trials: Trials, system: PointSystem) -> GrossError | None:
    """A wrong coordinate system of all known points; None where something else is wrong."""
    wrong = coordinate_system_cause(trials, system) or vector_system_cause(trials, system)
    return wrong or known_scale_cause(trials, system)


def _ambiguous(
    model: Model, system: PointSystem, found: Estimate, suspects: list[int]
) -> tuple[list[GrossError], list[int]]:
    """Errors whose place is not known, or shared, and the suspects that they leave; none among too many."""
    errors, left = Ambiguity(system, found).errors(model, suspects)
    if _are_too_many(found, suspects) and (len(errors) > _MOST_CAUSES or _are_too_many(found, left)):
        return [], suspects
    return errors, left


def _are_too_many(found: Estimate, suspects: list[int]) -> bool:
    """Whether suspects are too many to be taken one by one."""
    return len(suspects) > max(3.0, _MOST_SINGLE * _count(found))


def _count(found: Estimate) -> int:
    return int(np.count_nonzero(found.book.observations.active))


def _left_over(found: Estimate, suspects: list[int], untried: list[str]) -> list[GrossError]:
    """The remaining suspects one by one; together when they are too many for that."""
    if _are_too_many(found, suspects):
        limits = f" (not tried, since the network is large: {' and '.join(untried)})" if untried else ""
        return [_together(found, suspects, f"no single cause explains them{limits}")]
    singles = single_errors(found, suspects[:_MOST_SINGLES])
    rest = suspects[_MOST_SINGLES:]
    text = f"only the {_MOST_SINGLES} worst are explained one by one"
    return [*singles, _together(found, rest, text)] if rest else singles


def _together(found: Estimate, rows: list[int], text: str) -> GrossError:
    """Observations, the worst first, of which no cause is known."""
    worst = ", ".join(found.book.label(row) for row in rows[:_MOST_NAMED])
    what = f"{len(rows)} of {_count(found)} observations"
    size = float(found.ratios[rows[0]])
    return GrossError(what, Cause.UNKNOWN, f"{text}; the worst are {worst}", size, tuple(rows))


def _cause_of_many(
    model: Model, system: PointSystem, found: Estimate, untried: list[str]
) -> tuple[GrossError | None, Estimate] | None:
    """The one mistake that removes most contradictions; of equal ones the first, which estimates nothing.

    No mistake, and the network found anew, where it is the places that it gives which remove them.
    """
    if not len(found.suspects):
        return None
    trials = Trials(model, found, untried)
    best = _tried(trials, system)
    if best is None and Ambiguity(system, found).levelling(model):
        return None  # these are told as they are
    if best is None and len(found.suspects) > 1:
        best = standpoint_cause(trials, system) or sight_cause(trials)
    if best is None:
        return sigmas_cause(trials)
    elsewhere = _from_places(trials, best[1])
    return best if elsewhere is None else (None, elsewhere)


def _tried(trials: Trials, system: PointSystem) -> tuple[GrossError, Estimate] | None:
    """The mistake of names, of a group, of a known point, ... that explains most; None where none does."""
    steps: list[tuple[GrossError, Estimate] | None] = []
    for of_names in (target_name_cause, station_name_cause):
        step = of_names(trials)
        if step is not None and is_told_by_names_alone(trials, step):
            return step
        steps += [step]
    steps += [group_cause(trials)]
    if len(trials.found.suspects) == 1:
        steps += [swapped_point_cause(trials, system)]
    else:
        steps += [known_point_cause(trials, system), setup_cause(trials), distances_cause(trials, system)]
        steps += [offset_cause(trials)]
        if not any(step and trials.explains(step[1]) for step in steps):
            steps += [aim_cause(trials)]
    return _best([step for step in steps if step is not None]) or half_turn_cause(trials)


def _from_places(trials: Trials, corrected: Estimate) -> Estimate | None:
    """The network as it is, from the places that it has without a mistake; None where that explains nothing.

    Where initial values follow an observation that is wrong, iterations may end far off, and good
    observations contradict it there: any trial that starts elsewhere then looks as if it were right.
    """
    found = trials.found
    return trials.explaining(found.points, found.book, corrected.places_in(found.start))


def _best(steps: list[tuple[GrossError, Estimate]]) -> tuple[GrossError, Estimate] | None:
    """The mistake that leaves least; others that leave as little are told with it."""
    if not steps:
        return None
    left = [step[1].disagreement(GROSS) for step in steps]
    equal = [step for step, one in zip(steps, left, strict=True) if one <= min(left) + _EQUAL]
    return any_of([error for error, _ in equal]), equal[0][1]


def is_doubtful(start: Determined, equations: Equations) -> bool:
    """Whether some observation is farther from the initial values than these explain: a first look."""
    observations, initial = start.book.observations, start.initial
    for rows, batch in equations.batches.values():
        misfits = np.abs(equations.system.residuals(batch)[:, 0])
        ends = observations.from_points[rows], observations.to_points[rows]
        moved = np.hypot(initial.expected_sigmas[ends[0]], initial.expected_sigmas[ends[1]])
        lengths = np.linalg.norm(initial.coordinates[ends[1]] - initial.coordinates[ends[0]], axis=1)
        is_angle = IS_ANGLE[observations.types[rows]]
        moved = np.where(is_angle, moved / np.maximum(lengths, 1e-3), moved)
        if (misfits > GROSS * np.hypot(sigmas_of(batch), moved)).any():
            return True
    return False


def refuse(errors: tuple[GrossError, ...]) -> NoReturn:
    """Raises InputError that lists gross errors."""
    raise InputError(_listed(errors))


def blame(error: ObseqError, errors: tuple[GrossError, ...]) -> NoReturn:
    """Raises an error of the adjustment again, with the gross errors that may be the reason."""
    if errors:
        reason = f"the adjustment fails, which may follow from them: {error}"
        raise InputError(f"{_listed(errors)}\n{reason}") from error
    raise error


def _listed(errors: tuple[GrossError, ...]) -> str:
    listed = [f"  {error.sentence()}" for error in errors[:_MOST_NAMED]]
    more = len(errors) - len(listed)
    listed += [f"  and {more} more"] if more > 0 else []
    return "gross errors are suspected, the worst first:\n" + "\n".join(listed)
