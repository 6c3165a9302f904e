"""A vector, or a position, that is wrong as a whole."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.survey.causes.cause import Cause, grouped
from obseq.survey.causes.scopes import VECTOR

if TYPE_CHECKING:
    from obseq.arrays import BoolArray
    from obseq.survey.causes.cause import Groups
    from obseq.survey.causes.notes import Notes


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
