"""Sigmas of one kind that are far too small: its misfits are noise, only larger than announced."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.screening.findings import Cause, GrossError
from obseq.survey.screening.robust import GROSS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.survey.screening.robust import Estimate
    from obseq.survey.screening.trials import Trials

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_LEAST = 6
"""Observations of which it can be said that they scatter."""
_SHARE = 0.25
"""Share of suspects from which a kind is thought of."""
_NOISE = 5.0
"""Noise has no misfit beyond so many times its spread; where one is, it is a gross error."""


def sigmas_cause(trials: Trials) -> tuple[GrossError, Estimate] | None:
    """The kind whose sigmas are too small, with the network with larger ones; None when there is none."""
    observations = trials.found.book.observations
    for kind, rows in _kinds(trials.found):
        ratios = trials.found.ratios[rows]
        larger = float(np.median(ratios[ratios > GROSS]))
        sigmas = observations.sigmas.copy()
        sigmas[rows] *= larger
        changed = replace(observations, sigmas=sigmas)
        corrected = trials.explaining(trials.found.points, replace(trials.found.book, observations=changed))
        if corrected is None:
            continue
        left = corrected.ratios[rows]
        spread = 1.4826 * float(np.median(left))
        if float(left.max()) > _NOISE * spread:
            continue
        name = f"all {len(rows)} {kind} observations (the first: {trials.found.book.label(int(rows[0]))})"
        text = (
            f"they scatter like noise about {larger * spread:.2g} times larger than their sigmas: likely the "
            "sigmas are too small, or in another unit"
        )
        size = float(ratios.max())
        return GrossError(name, Cause.SIGMAS, text, size, tuple(rows.tolist())), corrected
    return None


def _kinds(found: Estimate) -> Iterator[tuple[str, Rows]]:
    """Kinds of which many observations are suspects, and the observations."""
    observations = found.book.observations
    for code in np.unique(observations.types[found.suspects]).tolist():
        rows = np.flatnonzero((observations.types == code) & observations.active)
        if len(rows) >= _LEAST and float(np.mean(found.ratios[rows] > GROSS)) >= _SHARE:
            yield BY_CODE[code].name, rows
