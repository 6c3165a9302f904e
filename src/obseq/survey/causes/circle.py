"""A horizontal circle that was turned in the middle of a set-up."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.causes.cause import Cause, Groups
from obseq.survey.causes.scopes import SETUP

if TYPE_CHECKING:
    from obseq.arrays import BoolArray
    from obseq.survey.causes.notes import Notes


def _later_readings(cause: Cause, notes: Notes, active: BoolArray) -> list[Groups]:
    """The directions of each set-up from the k-th on, k = 2 .. n - 2: one alone is that reading."""
    mask, labels = active & cause.takes(notes), notes.book.observations.stations
    rows, found, own = [], [], []
    members, starts = notes.book.stations.members, notes.book.stations.starts
    read = mask[members]
    for station in np.flatnonzero(np.add.reduceat(np.append(read, False), starts[:-1]) > 3).tolist():
        part = slice(starts[station], starts[station + 1])
        directions = np.sort(members[part][read[part]])
        for k in range(2, len(directions) - 1):
            rows.append(directions[k:])
            found.append(len(directions) - k)
            own.append(labels[directions[0]])
    joined = np.concatenate([np.zeros(0, np.int64), *rows])
    return [Groups(SETUP, np.append(0, np.cumsum(found)).astype(np.int64), joined, np.array(own, np.int64))]


CIRCLE = Cause(
    "S120",
    "turned circle",
    "The directions of a set-up from one reading on are all off by the same angle.",
    "The instrument was knocked or the circle set anew, and reading went on in the same set-up.",
    "Make the later readings a set-up of their own.",
    "rad",
    4.0,
    (SETUP,),
    lambda notes: notes.is_direction,
    lambda effects: effects.ones,
    groups=_later_readings,
)
