"""Vectors, or positions, that are wrong, and antennas: their heights, and beside their marks."""

from __future__ import annotations

from obseq.arrays import BoolArray
from obseq.survey.causes.cause import Cause, Groups, grouped
from obseq.survey.causes.notes import Notes
from obseq.survey.causes.scopes import FROM, FROM_IN_FILE, TO, TO_IN_FILE, VECTOR


def _whole(cause: Cause, notes: Notes, active: BoolArray) -> list[Groups]:
    """The vectors: as many observations each as components are there."""
    return [grouped(VECTOR, notes.vectors, active & cause.takes(notes), 2)]


WHOLE_VECTOR = Cause(
    "S170",
    "vector",
    "The components of a vector, or of a position, are wrong together.",
    "The antenna stood beside its mark, or the solution of the ambiguities is wrong.",
    "Leave the vector out, or compute it anew.",
    "m",
    0.0,
    (VECTOR,),
    lambda notes: notes.is_vector,
    groups=_whole,
    is_one=True,
)

ANTENNA = Cause(
    "S171",
    "height of antenna",
    "Vectors of one point are wrong along its vertical.",
    "The height of the antenna was read or entered wrong.",
    "Look up the height in the field notes.",
    "m",
    1.0,
    (VECTOR, FROM, TO, FROM_IN_FILE, TO_IN_FILE),
    lambda notes: notes.is_vector,
    lambda effects: effects.upward,
)

ANTENNA_BESIDE = Cause(
    "S172",
    "antenna beside its mark",
    "Vectors of one point are wrong by the same shift in plan.",
    "The antenna was not centred, or stood on another mark, in one session.",
    "Leave these vectors out, or make the place of the antenna a point of its own.",
    "m",
    5.0,
    (FROM, TO, FROM_IN_FILE, TO_IN_FILE),
    lambda notes: notes.is_vector,
    lambda effects: effects.beside,
    least=6,
    parts=("east", "north"),
)
