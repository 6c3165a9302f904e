"""A wrong height of an antenna."""

from obseq.survey.causes.cause import Cause
from obseq.survey.causes.scopes import FROM, FROM_IN_FILE, TO, TO_IN_FILE, VECTOR

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
