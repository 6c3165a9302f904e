"""What a comparison rests on: what forbids a verdict, and with which reservations one is given."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np
from msgspec import structs

from obseq.printable import listed
from obseq.survey.adjustment.adjusted import Adjustment
from obseq.survey.adjustment.adjusted_records import global_test_record
from obseq.survey.model import Observations

MOST = 8
"""Names that one sentence lists."""


def obstacles(epochs: Sequence[Adjustment]) -> Iterator[str]:
    """Why nothing can be said about movements, one sentence per reason; none where a verdict is possible."""
    for number, epoch in enumerate(epochs, 1):
        if not epoch.converged:
            yield f"epoch {number} did not converge: adjust it first"
        for error in epoch.gross_errors:
            yield f"epoch {number} holds a gross error, adjust it first: {error.what}: {error.text}"


def without_explained(epoch: Adjustment, moved: Collection[str], reference: Collection[str]) -> Adjustment:
    """An epoch without the errors of points that are no errors of its observations.

    Where it rests on inner constraints and its observations agree, they contradicted coordinates of old.

    Args:
        epoch: The adjustment.
        moved: Reference points that were found to have moved: that their coordinates of old, or those of
            other reference points with them, contradict the observations is what was looked for.
        reference: All reference points.
    """
    agrees = bool(epoch.undetermined) and fits(epoch)
    if epoch.diagnosis is None:
        return epoch
    errors = tuple(
        error
        for error, names in ((one, {point.name for point in one.points}) for one in epoch.gross_errors)
        if not (names and agrees) and not (names & set(moved) and names <= set(reference))
    )
    return replace(epoch, diagnosis=structs.replace(epoch.diagnosis, accused=errors))


def at_odds(known: Sequence[str]) -> tuple[str, ...]:
    """Why there is no verdict where known points have moved, and nothing says which."""
    return (
        f"known points have moved against each other, by what the observations alone say: one or more of "
        f"{listed(known, MOST)}, and nothing tells which; name points that have stayed (--reference)",
    )


def undecided(sets: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Why there is no verdict where each of some sets of points explains why the others do not agree."""
    return (
        f"of the reference points {_or(sets)} moved, and nothing tells which: without any of these the "
        "others agree; name more points that have stayed (--reference), or measure between them",
    )


def told_by_others(
    sets: Sequence[Sequence[str]], rejected: Sequence[Sequence[str]], moving: int, others: int
) -> tuple[str, ...]:
    """What weakens a verdict where other points tell which of some sets of reference points has moved.

    Args:
        sets: by which most of the other points have stayed.
        rejected: by which most of them have moved; an empty one where the reference points agree.
        moving: how many at least.
        others: how many other points there are.
    """
    if not rejected:
        return ()
    if () in map(tuple, rejected):
        told = f"agree; that {_or(sets)} moved is"
    else:
        told = f"do not tell whether {_or([*sets, *rejected])} moved; that {_or(sets)} is"
    return (
        f"between themselves the reference points {told} told by the other points: {moving} of {others} "
        "would have moved otherwise",
    )


def _or(sets: Sequence[Sequence[str]]) -> str:
    """Points of which one, or one set, has moved."""
    names = [" and ".join(one) for one in sets]
    return f"{_any(names)} {'has' if max(map(len, sets)) == 1 else 'have'}"


def _any(names: Sequence[str]) -> str:
    """One of the names, of many the first few."""
    more = [f"one of {len(names) - MOST} more"] if len(names) > MOST else []
    return " or ".join([*names[:MOST], *more])


def taken_for_granted(known: Sequence[str]) -> tuple[str, ...]:
    """What weakens a verdict where the observations alone do not form the network."""
    return (
        f"what seems to have moved, or one of the known points ({listed(known, MOST)}): the observations "
        "alone do not form the network, and cannot say whether these have stayed",
    )


def fits(epoch: Adjustment) -> bool:
    """Whether its residuals are no larger than their sigmas explain."""
    test = global_test_record(epoch.solution)
    return test is None or test.sigma0 <= test.upper


def reservations(epochs: Sequence[Adjustment], *, trusted: bool) -> Iterator[str]:
    """What weakens a verdict, one sentence per reason.

    Args:
        epochs: The adjustments.
        trusted: Whether the given sigmas are trusted, instead of being scaled by sigma0.
    """
    for number, epoch in enumerate(epochs, 1):
        if epoch.left_out:
            names = listed([item.what for item in epoch.left_out], MOST)
            yield f"epoch {number} leaves out {names}: the verdict is about the rest"
        for unused in epoch.book.unused:
            names = listed(unused.observations, MOST)
            yield f"epoch {number} does not use {names}: {unused.reason}"
        yield from (f"epoch {number}: {doubtful.sentence}" for doubtful in epoch.doubtful)
        yield from _about_sigma0(number, epoch, trusted=trusted)
    if _is_same(epochs[0].book.observations, epochs[1].book.observations):
        yield "both epochs hold the same observations, to the last digit: nothing can have moved between them"


def _is_same(first: Observations, second: Observations) -> bool:
    """Whether two epochs have equal values in the same order: what nobody measures twice."""
    parts = ((one.types, one.values, one.sigmas) for one in (first, second))
    return all(np.array_equal(one, other) for one, other in zip(*parts, strict=True))


def _about_sigma0(number: int, epoch: Adjustment, *, trusted: bool) -> Iterator[str]:
    test = global_test_record(epoch.solution)
    if test is None or test.passed:
        return
    is_large = test.sigma0 > test.upper
    if trusted:
        rests = "given sigmas, which its residuals contradict"
        effect = "movements may be found that are none" if is_large else "movements may be missed"
    else:
        rests = "precisions scaled by it"
        effect = "smaller movements may hide" if is_large else "small movements may look significant"
    limits = f"{test.lower:.4g} to {test.upper:.4g} is expected"
    yield (
        f"sigma0 of epoch {number} is too {'large' if is_large else 'small'} ({test.sigma0:.4g}; {limits}): "
        f"the verdict rests on {rests}, and {effect}"
    )
