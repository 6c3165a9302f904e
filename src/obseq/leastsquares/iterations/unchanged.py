"""What a solution takes for granted: what its callbacks may not change, and is refused by name."""

from __future__ import annotations

from collections.abc import Iterator
from operator import is_

import numpy as np

from obseq.errors import InputError
from obseq.leastsquares.problem.problem import Problem


class Unchanged:
    """Looks after all that the pattern and the redundancy of a problem follow from.

    What callbacks may change is measured and weighed: observations, sigmas, losses, groups, values of priors
    and of unknowns. The next linearisation heeds it.

    Args:
        problem: as it is when its solution begins.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._parts = _parts(problem)
        self._blocks, self._datum = len(problem.unknowns), problem.datum
        self._frozen, self._eliminated = problem.unknowns.frozen.copy(), problem.unknowns.eliminated.copy()
        self._active = [batch.active.copy() for batch in problem.batches]

    def check(self) -> None:
        """Settles what may have changed.

        Raises:
            InputError: something else has.
        """
        changed = next(self._changes(), None)
        if changed:
            raise InputError(
                f"solve: a callback {changed}. It may replace observations, sigmas, losses, groups, and "
                "values of priors and unknowns; change the rest between two solutions"
            )
        self._problem.settle()

    def _changes(self) -> Iterator[str]:
        problem = self._problem
        for what, now in _parts(problem).items():
            before = self._parts[what]
            if len(now) == len(before) and all(map(is_, now, before)):
                continue
            added = [part for part in now if not any(part is other for other in before)]
            if added:
                yield f"added to the {what}: {getattr(added[0], 'name', 'a pull to current values')}"
            else:
                yield f"took away some of the {what}"
        table = problem.unknowns
        if len(table) > self._blocks:
            yield f"added the unknowns {table.names[self._blocks]!r}"
        elif np.count_nonzero(changed := table.frozen != self._frozen):
            unknown = int(changed.argmax())
            verb = "froze" if table.frozen[unknown] else "freed"
            yield f"{verb} {table.component_names(unknown)[0]}"
        elif np.count_nonzero(changed := table.eliminated != self._eliminated):
            yield f"changed whether {table.names[int(changed.argmax())]!r} is to be eliminated"
        if problem.datum is not self._datum:
            yield "changed the datum"
        for batch, active in zip(problem.batches, self._active, strict=True):
            if np.count_nonzero(changed := batch.active != active):
                yield f"changed `active` of {batch.label(int(changed.argmax()))}"


def _parts(problem: Problem) -> dict[str, tuple[object, ...]]:
    return {
        "observations": problem.batches,
        "priors": problem.priors,
        "constraints": problem.constraints,
        "viscosities": problem.viscosities,
    }
