"""The best position of one point among its candidates, or why there is none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

from obseq.survey.initial.candidates import (
    Candidate,
    Surroundings,
    heights_at,
    paired_positions,
    survey_surroundings,
    unique_positions,
)
from obseq.survey.initial.closed_forms import Space, minus, plus
from obseq.survey.initial.known import Known, times, transposed_times
from obseq.survey.initial.refinement import Refined, agreeing, contradictions, refine
from obseq.survey.initial.relations import Relation, disagreement

_MARGIN = 0.3
"""Disagreement by which a position must be worse than another to be set aside."""
_MOST_REFINED = 4
_MOST_NEIGHBOURS = 12
_FARTHEST = 10.0
"""Expected errors by which averaging may move a position."""
_SAME = 0.02
"""Candidates nearer to each other than this part of their distance to the neighbours are one solution."""


class Fit(NamedTuple):
    """A candidate made to fit its relations."""

    candidate: Candidate
    refined: Refined


class BestPosition(NamedTuple):
    """The position that the relations agree on, or none.

    `alternatives` holds the positions that fit equally well when there are several; `strength` is that of the
    best geometry seen (0: the relations determine no position).
    """

    fit: Fit | None
    strength: float
    alternatives: tuple[Space, ...] = ()


def best_position(
    known: Known,
    relations: list[Relation],
    sigmas: Sequence[float],
    least_strength: float,
    hint: Space | None = None,
) -> BestPosition:
    """The position that the relations agree on.

    Args:
        known: known points.
        relations: of the point.
        sigmas: of all observations (m, rad).
        least_strength: geometries weaker than this are not used (see `relations.Refined`).
        hint: an approximate position that decides between two solutions.
    """
    around = survey_surroundings(known, thinned(known, relations))
    if around is None:
        return BestPosition(None, 0.0)
    strongest = 0.0
    for generate in (unique_positions, paired_positions):
        found = list(generate(around))
        complete = [candidate for candidate in found if candidate.has_height] or found
        fits, strength = _fits(around, complete, sigmas, least_strength)
        best = _decide(around, fits, max(strength, strongest), hint, sigmas)
        if best.fit is not None or best.alternatives:
            return best
        strongest = best.strength
    return BestPosition(None, strongest)


def thinned(known: Known, relations: list[Relation]) -> list[Relation]:
    """The relations with the `_MOST_NEIGHBOURS` points that are known best."""
    others = dict.fromkeys(c.other for c in relations)
    if len(others) <= _MOST_NEIGHBOURS:
        return relations
    kept = set(sorted(others, key=lambda other: known.point_sigmas[other])[:_MOST_NEIGHBOURS])
    return [c for c in relations if c.other in kept]


def _fits(
    around: Surroundings, candidates: list[Candidate], sigmas: Sequence[float], least_strength: float
) -> tuple[list[Fit], float]:
    """The few least contradicted candidates that are well determined, and the greatest strength seen."""
    fits: list[Fit] = []
    strongest = 0.0
    if len(candidates) > 1:
        candidates = sorted(candidates, key=partial(_disagreement, around))
    for candidate in candidates:
        if any(_is_same(around, candidate, fit.candidate) for fit in fits):
            continue
        axes = (0, 1, 2) if candidate.has_height else (0, 1)
        refined = refine(around.known, candidate.used, candidate.position, sigmas, axes)
        strongest = max(strongest, refined.strength)
        if refined.strength >= least_strength:
            fits.append(_fit(candidate, refined))
        if len(fits) == _MOST_REFINED:
            break
    return fits, strongest


def _fit(candidate: Candidate, refined: Refined) -> Fit:
    return Fit(Candidate(refined.position, candidate.method, candidate.used, candidate.has_height), refined)


def _disagreement(around: Surroundings, candidate: Candidate) -> float:
    return disagreement(around.known, around.relations, candidate.position, around.vertical)


def _is_same(around: Surroundings, a: Candidate, b: Candidate) -> bool:
    """Whether two candidates are one solution; of two without height, in plan."""
    offset = times(around.vertical, minus(a.position, b.position))
    apart = math.hypot(*(offset if a.has_height or b.has_height else offset[:2]))
    return apart <= _SAME * max(math.dist(a.position, around.origin), 1e-3)


def _decide(
    around: Surroundings,
    fits: list[Fit],
    strongest: float,
    hint: Space | None,
    sigmas: Sequence[float],
) -> BestPosition:
    """The least contradicted position, unless another fits as well."""
    if not fits:
        return BestPosition(None, strongest)
    rivals = fits
    if len(rivals) > 1:
        rivals = _rivals(around, fits, [_disagreement(around, fit.candidate) for fit in fits])
    if len(rivals) > 1:
        counts = [contradictions(around.known, around.relations, fit.refined, sigmas) for fit in rivals]
        rivals = _rivals(around, rivals, counts)
    return _by_hint(rivals, strongest, hint) if len(rivals) > 1 else BestPosition(rivals[0], strongest)


def _rivals(around: Surroundings, fits: list[Fit], counts: list[float]) -> list[Fit]:
    """The position with the least count, and the others whose counts are hardly worse."""
    ordered = sorted(zip(counts, range(len(fits)), strict=True))
    least, first = ordered[0]
    best = fits[first]
    return [best] + [
        fits[k]
        for count, k in ordered[1:]
        if count - least < _MARGIN and not _is_same(around, fits[k].candidate, best.candidate)
    ]


def averaged(known: Known, relations: list[Relation], sigmas: Sequence[float], fit: Fit) -> Fit:
    """The fit made to all relations that agree with it, weighted; itself when no further one does."""
    candidate = fit.candidate
    chosen = agreeing(known, thinned(known, relations), candidate.used, fit.refined, sigmas)
    if len(chosen) == len(candidate.used) or not candidate.has_height:
        return fit
    refined = refine(known, chosen, candidate.position, sigmas, weighted=True)
    moved = math.dist(refined.position, candidate.position)
    if not (refined.point_sigma <= fit.refined.point_sigma and moved <= _FARTHEST * fit.refined.point_sigma):
        return fit
    better = Candidate(refined.position, candidate.method, tuple(chosen))
    return Fit(better, refined)


def _by_hint(fits: list[Fit], strongest: float, hint: Space | None) -> BestPosition:
    """The position clearly nearest to the hint; without one, the alternatives."""
    positions = tuple(fit.candidate.position for fit in fits)
    if hint is not None:
        distances = [math.dist(position, hint) for position in positions]
        nearest, second = sorted(distances)[:2]
        if nearest < 0.5 * second:
            return BestPosition(fits[distances.index(nearest)], strongest)
    return BestPosition(None, strongest, positions)


def best_height(
    known: Known,
    relations: list[Relation],
    sigmas: Sequence[float],
    least_strength: float,
    position: Space,
) -> BestPosition:
    """The height of a point whose plumb line is known; two heights that fit equally well are left open.

    Args:
        known: known points.
        relations: of the point.
        sigmas: of all observations (m, rad).
        least_strength: geometries weaker than this are not used.
        position: the point at a provisional height.
    """
    around = survey_surroundings(known, thinned(known, relations))
    if around is None:
        return BestPosition(None, 0.0)
    east, north, _ = times(around.vertical, minus(position, around.origin))
    fits, strongest = [], 0.0
    for height, relation in heights_at(around, (east, north)):
        start = along_plumb_line(known, position, around.to_frame((east, north, height)))
        refined = refine(known, (relation,), start, sigmas, axes=(2,))
        strongest = max(strongest, refined.strength)
        if refined.strength >= least_strength:
            fits.append(_fit(Candidate(start, "height", (relation,)), refined))
    return _decide(around, fits, strongest, None, sigmas)


def along_plumb_line(known: Known, position: Space, other: Space) -> Space:
    """The point of the plumb line of `position` at the height of `other`."""
    vertical = known.vertical_at(position)
    rise = times(vertical, minus(other, position))[2]
    return plus(position, transposed_times(vertical, (0.0, 0.0, rise)))
