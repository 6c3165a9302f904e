"""A wrong scale of distances."""

from obseq.survey.causes.cause import Cause
from obseq.survey.causes.scopes import ALL, FILE, FROM, INSTRUMENT, TO

SCALE = Cause(
    "S151",
    "scale of distances",
    "Distances that share an instrument, a day or a point are all too long, or too short, by one share.",
    "The atmospheric correction is that of another day, or a scale of a map projection was left in.",
    "Correct the distances by the scale, or give the coordinates in the system of the map.",
    "",
    4.0,
    (FILE, INSTRUMENT, FROM, TO, ALL),
    lambda notes: notes.is_length,
    lambda effects: effects.values,
    least=3,
)
