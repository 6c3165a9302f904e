"""How well targets of known places are found: recall, accuracy, and whether the stated one is true."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from obseq.targets.finding.finder import Found, Target
    from obseq.targets.simulation import Truth

SIZES = (0.0, 20.0, 30.0, 45.0, 70.0, 120.0, math.inf)
"""Classes of sizes, pixels."""
NEAR = 3.0
"""Pixels within which a target is the one that it is called."""


@dataclass(frozen=True, eq=False)
class Trial:
    """What is seen in an image, and what was found there."""

    truths: Sequence[Truth]
    found: Found


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        visible: targets of which nothing is hidden.
        found: of these, under their names.
        hidden: targets of which a part is hidden.
        uncovered: of these, under their names.
        wrong: names that are not where they were found.
        rms: of the distance to the true centre, pixels.
        stated: the same as the covariances state it.
        ratio: mean of the squared error over the stated one: 1 where the covariances are true.
    """

    visible: int
    found: int
    hidden: int
    uncovered: int
    wrong: int
    rms: float
    stated: float
    ratio: float


def summary(trials: Sequence[Trial], sizes: tuple[float, float] = (0.0, math.inf)) -> Row:
    """The statistics of the targets of some sizes."""
    errors: list[float] = []
    stated: list[float] = []
    ratios: list[float] = []
    visible = hidden = uncovered = wrong = 0
    for trial in trials:
        names = {target.name: target for target in trial.found.targets}
        mine = [one for one in trial.truths if sizes[0] <= one.size < sizes[1]]
        hidden += sum(one.hidden > 0.0 for one in mine)
        visible += sum(one.hidden == 0.0 for one in mine)
        for one in mine:
            target = names.get(one.name)
            if target is None or not _is_at(target, one):
                continue
            if one.hidden:
                uncovered += 1
                continue
            error = target.centre - one.centre
            errors.append(float(error @ error))
            stated.append(float(np.trace(target.covariance)))
            ratios.append(float(error @ np.linalg.solve(target.covariance, error)) / 2.0)
        wrong += sum(_is_wrong(target, trial.truths) for target in _of_sizes(names.values(), sizes))
    rms = math.sqrt(float(np.mean(errors))) if errors else math.nan
    said = math.sqrt(float(np.mean(stated))) if stated else math.nan
    ratio = float(np.mean(ratios)) if ratios else math.nan
    return Row(visible, len(errors), hidden, uncovered, wrong, rms, said, ratio)


def _of_sizes(targets: Iterable[Target], sizes: tuple[float, float]) -> list[Target]:
    return [target for target in targets if sizes[0] <= target.size < sizes[1]]


def _is_wrong(target: Target, truths: Sequence[Truth]) -> bool:
    return not any(one.name == target.name and _is_at(target, one) for one in truths)


def _is_at(target: Target, truth: Truth) -> bool:
    return math.hypot(*(truth.centre - target.centre)) <= NEAR


def statistics_text(trials: Sequence[Trial]) -> str:
    """The table by sizes, and of all."""
    lines = ["size px      visible  found  hidden  found  wrong names  rms px  stated px  (error / stated)^2"]
    for low, high in itertools.pairwise(SIZES):
        row = summary(trials, (low, high))
        if row.visible or row.hidden:
            label = f"{low:.0f} to {high:.0f}" if math.isfinite(high) else f"{low:.0f} and more"
            lines.append(_line(label, row))
    return "\n".join([*lines, _line("all", summary(trials))]) + "\n"


def _line(label: str, row: Row) -> str:
    return (
        f"{label:12s} {row.visible:7d} {row.found:6d} {row.hidden:7d} {row.uncovered:6d} {row.wrong:12d}  "
        f"{row.rms:6.4f}  {row.stated:9.4f}  {row.ratio:18.2f}"
    )
