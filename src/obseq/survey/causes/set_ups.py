"""What is wrong with a set-up, or with what it sights: circle, heights, names, place."""

from __future__ import annotations

import numpy as np

from obseq.arrays import BoolArray
from obseq.survey.causes.cause import Cause, Groups
from obseq.survey.causes.notes import Notes
from obseq.survey.causes.scopes import FROM, READING, SETUP, SIGHT, TO


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

INSTRUMENT_HEIGHT = Cause(
    "S130",
    "height of instrument",
    "Zenith angles, slope distances and height differences of a set-up share a wrong height of instrument.",
    "It was not noted, noted with another sign, or is that of another set-up.",
    "Look up the height in the field notes, and correct it in all lines of the set-up.",
    "m",
    4.0,
    (SETUP, FROM),
    lambda notes: notes.is_raised,
    lambda effects: -effects.raised,
    is_bent=True,
)

TARGET_HEIGHT = Cause(
    "S131",
    "height of target",
    "Zenith angles, slope distances and height differences to a target share a wrong height of it.",
    "The pole was lengthened between two sights, or its height was not noted.",
    "Look up the height in the field notes, and correct it in all lines to the target.",
    "m",
    4.0,
    (SIGHT, READING, TO),
    lambda notes: notes.is_raised,
    lambda effects: effects.raised,
    is_bent=True,
)

TARGET = Cause(
    "S160",
    "name of a target",
    "All that was read from a set-up to a target fits another point.",
    "Another point was sighted, or its name was mistyped.",
    "Correct the name of the target.",
    "",
    5.0,
    (SIGHT, READING),
    lambda notes: notes.setups >= 0,
    needs_slip=True,
)

STANDPOINT = Cause(
    "S161",
    "name of a stand point",
    "Nothing that was read in a set-up fits its point.",
    "The instrument stood on another point, or beside it; or the name was mistyped.",
    "Correct the name of the stand point, or make it a point of its own.",
    "",
    8.0,
    (SETUP,),
    lambda notes: notes.setups >= 0,
    least=5,
)

_BESIDE = 5.0
"""Metres up to which an instrument stands beside its mark; beyond, it is on another one."""

ECCENTRIC = Cause(
    "S162",
    "eccentric set-up",
    "All that was read in a set-up fits an instrument beside its mark.",
    "The instrument was not centred, or stood beside the mark on purpose and nobody reduced it.",
    "Reduce the readings to the mark, or make the stand point a point of its own.",
    "m",
    6.0,
    (SETUP,),
    lambda notes: notes.is_direction | notes.is_zenith | notes.is_length,
    lambda effects: effects.off_centre,
    least=5,
    parts=("east", "north"),
    most=_BESIDE,
)
