"""Observations by their names: switched off, with other sigmas, or with robust weights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import PurePath

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.errors import InputError
from obseq.leastsquares.problem.losses import named_loss
from obseq.printable import listed
from obseq.survey.adjustment.adjusted import Adjustment
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.model import FieldBook

ARROWS = ("->", "\u2192")
MOST_NAMES = 8
LEAST = 1e-6
"""Weight below which an observation has no influence that anybody reads."""
MOST_ROUNDS = 30
SETTLED = 1e-3
"""Change of a weight from which on another adjustment changes no result that anybody reads."""


def chosen(book: FieldBook, what: tuple[str, ...], kind: str | None) -> BoolArray:
    """(n,) observations that a person means.

    Args:
        book: The observations.
        what: Each one a sight "S6 -> P05", a point "S6" (all that name it), or a place "survey.obs:185"; none
            for all.
        kind: "Hz", "Dist", ...; None for all.

    Raises:
        InputError: Nothing is called so.
    """
    rows = np.ones(len(book.observations), np.bool_)
    if what:
        rows = np.logical_or.reduce([_named(book, name) for name in what])
    if kind is not None:
        rows = rows & _of_kind(book, kind)
    if not rows.any():
        raise InputError(f"no observation is {' '.join(filter(None, (kind, *what)))}")
    return rows


def _named(book: FieldBook, name: str) -> BoolArray:
    for arrow in ARROWS:
        if arrow in name:
            origin, target = (_point(book, part.strip()) for part in name.split(arrow, 1))
            found = book.observations
            return np.asarray((found.from_points == origin) & (found.to_points == target))
    file, _, line = name.rpartition(":")
    if line.isdecimal() and file:
        files = [k for k, path in enumerate(book.files) if file in (path, PurePath(path).name)]
        found = book.observations
        return np.asarray(np.isin(found.file_indices, files) & (found.lines == int(line)))
    mask = np.zeros(len(book.point_names), np.bool_)
    mask[_point(book, name)] = True
    return np.asarray(book.naming(mask))


def _point(book: FieldBook, name: str) -> int:
    if name not in book.point_names:
        some = listed(sorted(book.point_names), MOST_NAMES)
        raise InputError(
            f'no observation names a point {name}; write "S6 -> P05", "S6" or "file:line" ({some})'
        )
    return book.point_names.index(name)


def _of_kind(book: FieldBook, kind: str) -> BoolArray:
    codes = sorted(set(book.observations.types.tolist()))
    names = {BY_CODE[code].name: code for code in codes}
    if kind not in names:
        raise InputError(f"no observation is of kind {kind}; there are {', '.join(sorted(names))}")
    return np.asarray(book.observations.types == names[kind])


def with_sigmas(
    book: FieldBook, rows: BoolArray, factor: FloatArray | float, sigma: float | None
) -> FieldBook:
    """The observations, some of which have other sigmas: multiplied by a factor, or all the same one."""
    found = book.observations
    sigmas, relative = found.sigmas.copy(), found.relative_sigmas.copy()
    sigmas[rows] *= factor
    relative[rows] *= factor
    if sigma is not None:
        sigmas[rows], relative[rows] = sigma, 0.0
    return replace(book, observations=replace(found, sigmas=sigmas, relative_sigmas=relative))


def robust(book: FieldBook, loss: str, adjust: Callable[[FieldBook], Adjustment]) -> Adjustment:
    """The adjustment with robust weights: sigmas grow by the root of what a loss leaves of each weight.

    Args:
        book: The observations.
        loss: "huber", "l1", "cauchy" or "tukey" (`obseq.leastsquares`).
        adjust: Of other observations.

    Raises:
        InputError: There is no such loss.
    """
    chosen_loss = named_loss(loss)
    weights, every = np.ones(len(book.observations)), np.ones(len(book.observations), np.bool_)
    found = adjust(book)
    for step in (named_loss("huber"), chosen_loss):  # what gives no weight at all must begin where most fits
        for _ in range(MOST_ROUNDS):
            normalised = np.nan_to_num(np.abs(found.residuals) / (found.sigmas * np.sqrt(weights)))
            normalised[~book.observations.active] = 0.0
            now = np.maximum(step.weights(normalised), LEAST)
            if np.abs(now - weights).max(initial=0.0) < SETTLED:
                break
            weights = now
            found = adjust(with_sigmas(book, every, weights**-0.5, None))
    weaker, weak = (int(np.count_nonzero(weights < limit)) for limit in (1.0 - SETTLED, 0.5))
    return found.warned(
        f"robust weights ({loss}): {weaker} observations have less than their full weight, {weak} of them "
        "less than half; the tests hold for full weights only"
    )
