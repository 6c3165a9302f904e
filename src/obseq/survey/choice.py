"""The best position of one point among its candidates, or why there is none."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from obseq.survey.candidates import (
    Candidate,
    Surroundings,
    heights_at,
    paired_positions,
    survey_surroundings,
    unique_positions,
)
from obseq.survey.constraints import Constraint, disagreement, refine
from obseq.survey.placement_state import minus, plus, times, transposed_times

if TYPE_CHECKING:
    from obseq.survey.closed_forms import Space
    from obseq.survey.placement_state import State

_MARGIN = 0.3
"""Disagreement by which a position must be worse than another to be set aside."""
_MOST_REFINED = 4
_MOST_NEIGHBOURS = 30
_SAME = 0.02
"""Candidates nearer to each other than this part of their distance to the neighbours are one solution."""


@dataclass(frozen=True)
class Choice:
    """A position and how it was found; or none.

    `alternatives` holds the positions that fit equally well when there are several; `strength` is that of the
    best geometry seen (0: the constraints determine no position).
    """

    candidate: Candidate | None
    strength: float
    alternatives: tuple[Space, ...] = ()


def choose(
    state: State, constraints: list[Constraint], least_strength: float, hint: Space | None = None
) -> Choice:
    """The position that the constraints agree on.

    Args:
        state: known points.
        constraints: of the point.
        least_strength: geometries weaker than this are not used (see `constraints.Refined`).
        hint: an approximate position that decides between two solutions.
    """
    around = survey_surroundings(state, thinned(constraints))
    if around is None:
        return Choice(None, 0.0)
    strongest = 0.0
    for generate in (unique_positions, paired_positions):
        choice = _best(around, list(generate(around)), least_strength, hint)
        if choice.candidate is not None or choice.alternatives:
            return choice
        strongest = max(strongest, choice.strength)
    return Choice(None, strongest)


def thinned(constraints: list[Constraint]) -> list[Constraint]:
    """The constraints with at most `_MOST_NEIGHBOURS` known points, spread evenly."""
    others = list(dict.fromkeys(c.other for c in constraints))
    if len(others) <= _MOST_NEIGHBOURS:
        return constraints
    kept = {others[k * len(others) // _MOST_NEIGHBOURS] for k in range(_MOST_NEIGHBOURS)}
    return [c for c in constraints if c.other in kept]


def _best(
    around: Surroundings, candidates: list[Candidate], least_strength: float, hint: Space | None
) -> Choice:
    """The least contradicted of the candidates that are well determined."""
    complete = [c for c in candidates if c.has_height] or candidates
    kept, strongest = _well_determined(around, complete, least_strength)
    return _decide(around, kept, strongest, hint)


def _decide(
    around: Surroundings, kept: list[tuple[float, Candidate, float]], strongest: float, hint: Space | None
) -> Choice:
    """The least contradicted position, unless another fits as well."""
    if not kept:
        return Choice(None, strongest)
    kept.sort(key=lambda item: item[0])
    lowest, best, strength = kept[0]
    rivals = [item for item in kept if item[0] - lowest < _MARGIN and not _is_same(around, item[1], best)]
    if not rivals:
        return Choice(best, strength)
    return _by_hint([best, *(item[1] for item in rivals)], strength, hint)


def _well_determined(
    around: Surroundings, candidates: list[Candidate], least_strength: float
) -> tuple[list[tuple[float, Candidate, float]], float]:
    """(disagreement, refined candidate, strength) of the few best, and the greatest strength seen."""
    kept: list[tuple[float, Candidate, float]] = []
    strongest = 0.0
    ranked = sorted(
        ((_disagreement(around, candidate), k, candidate) for k, candidate in enumerate(candidates)),
        key=lambda item: item[:2],
    )
    tried: list[Candidate] = []
    for _, _, candidate in ranked:
        if any(_is_same(around, candidate, other) for other in tried):
            continue
        refined = refine(
            around.state,
            candidate.used,
            candidate.position,
            axes=(0, 1, 2) if candidate.has_height else (0, 1),
        )
        strongest = max(strongest, refined.strength)
        if refined.strength < least_strength:
            continue
        better = Candidate(refined.position, candidate.method, candidate.used, candidate.has_height)
        kept.append((_disagreement(around, better), better, refined.strength))
        tried.append(candidate)
        if len(tried) == _MOST_REFINED:
            break
    return kept, strongest


def _disagreement(around: Surroundings, candidate: Candidate) -> float:
    return disagreement(around.state, around.constraints, candidate.position, around.vertical)


def _is_same(around: Surroundings, a: Candidate, b: Candidate) -> bool:
    apart = math.hypot(*minus(a.position, b.position))
    return apart <= _SAME * max(math.hypot(*minus(a.position, around.origin)), 1e-3)


def _by_hint(candidates: list[Candidate], strength: float, hint: Space | None) -> Choice:
    """The candidate clearly nearest to the hint; without one, the alternatives."""
    positions = tuple(candidate.position for candidate in candidates)
    if hint is not None:
        ranked = sorted(candidates, key=lambda c: math.hypot(*minus(c.position, hint)))
        first, second = (math.hypot(*minus(c.position, hint)) for c in ranked[:2])
        if first < 0.5 * second:
            return Choice(ranked[0], strength)
    return Choice(None, strength, positions)


def choose_height(
    state: State, constraints: list[Constraint], position: Space, least_strength: float
) -> Choice:
    """The height of a point whose plumb line is known; two heights that fit equally well are left open."""
    around = survey_surroundings(state, thinned(constraints))
    if around is None:
        return Choice(None, 0.0)
    east, north, _ = times(around.vertical, minus(position, around.origin))
    found, strongest = [], 0.0
    for height, constraint in heights_at(around, (east, north)):
        start = along_plumb_line(state, position, around.to_frame((east, north, height)))
        refined = refine(state, (constraint,), start, axes=(2,))
        strongest = max(strongest, refined.strength)
        if refined.strength >= least_strength:
            candidate = Candidate(refined.position, "height", (constraint,))
            found.append((_disagreement(around, candidate), candidate, refined.strength))
    return _decide(around, found, strongest, None)


def along_plumb_line(state: State, position: Space, other: Space) -> Space:
    """The point of the plumb line of `position` at the height of `other`."""
    vertical = state.vertical_at(position)
    rise = times(vertical, minus(other, position))[2]
    return plus(position, transposed_times(vertical, (0.0, 0.0, rise)))
