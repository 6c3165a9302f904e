"""Robust losses that leave a system without observations: how many, of which group, and what to do.

Without observations unknowns are undetermined, or keep the values of their priors: nothing is adjusted then.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from obseq.arrays import BoolArray, IntArray
from obseq.errors import DivergenceError, SingularSystemError
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.unknowns import UnknownTable

MOST = 0.5
"""Share of the observations of what is undetermined, from which their loss is to blame."""
REMEDY = (
    "start nearer to the solution: with a loss whose weights never vanish (huber) first and with this one "
    "from there, with a larger constant, narrowed step by step (graduated), or from better initial values"
)


@contextmanager
def rejection_told(table: UnknownTable, batches: Sequence[Batch]) -> Iterator[None]:
    """Errors of systems that a loss has emptied say so too; where priors hide it, it is one.

    Raises:
        SingularSystemError: no observation has any weight left at the solution.
    """
    try:
        yield
        _refuse_emptied(batches)
    except (DivergenceError, SingularSystemError) as error:
        said = _emptied(table, batches, getattr(error, "unknowns", ()))
        if said:
            error.args = (f"{said}. So {error}",)
        raise


def _refuse_emptied(batches: Sequence[Batch]) -> None:
    """Refuses a solution for which losses have left no observation any weight."""
    active = [batch for batch in batches if batch.active.any()]
    if active and all(is_emptied(batch) for batch in active):
        raise SingularSystemError("only priors say what the unknowns are: nothing is adjusted")


def is_emptied(batch: Batch) -> bool:
    """Whether the loss of a batch leaves none of its observations any weight."""
    return batch.loss is not None and not (batch.active & (batch.robust_weights() > 0.0)).any()


def _emptied(table: UnknownTable, batches: Sequence[Batch], unknowns: Sequence[str]) -> str:
    """What losses have rejected of the observations of unknowns, or of all; empty where it is not most."""
    wanted = {*unknowns, *(name.rpartition(".")[0] for name in unknowns)}
    touched = np.array([not wanted or name in wanted for name in table.names], dtype=bool)
    counts: dict[str, IntArray] = {}
    for batch in batches:
        if batch.loss is not None:
            name = f"{batch.group} ({type(batch.loss).__name__})"
            counts[name] = counts.get(name, 0) + _counts(batch, touched)
    gone, there = sum(counts.values(), np.zeros(2, dtype=np.int64))
    if not there or gone < MOST * there:
        return ""
    groups = ", ".join(f"{lost} of {of_all} of {name}" for name, (lost, of_all) in counts.items() if lost)
    return f"The loss leaves {gone} of {there} observations no weight: {groups}; {REMEDY}"


def _counts(batch: Batch, touched: BoolArray) -> IntArray:
    """(2,) how many observations of blocks have no weight, of how many that are active."""
    own = batch.active & touched[batch.blocks].any(axis=0)
    return np.array([np.count_nonzero(own & (batch.robust_weights() == 0.0)), np.count_nonzero(own)])
