"""An antenna beside its mark."""

from obseq.survey.causes.cause import Cause
from obseq.survey.causes.scopes import FROM, FROM_IN_FILE, TO, TO_IN_FILE

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
