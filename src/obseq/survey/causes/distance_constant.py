"""A wrong constant of distances."""

from obseq.survey.causes.cause import Cause
from obseq.survey.causes.scopes import ALL, FILE, FROM, INSTRUMENT, TO

CONSTANT = Cause(
    "S150",
    "constant of distances",
    "Distances that share an instrument, a day or a point are all too long, or too short, by one length.",
    "The constant of another prism was set.",
    "Correct the distances by the constant, or set that of the prism.",
    "m",
    4.0,
    (FILE, INSTRUMENT, FROM, TO, ALL),
    lambda notes: notes.is_length,
    lambda effects: effects.ones,
    least=3,
)
