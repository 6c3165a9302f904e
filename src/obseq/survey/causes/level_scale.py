"""A wrong scale of height differences."""

from obseq.survey.causes.cause import Cause
from obseq.survey.causes.scopes import ALL, FILE

LEVEL_SCALE = Cause(
    "S182",
    "scale of height differences",
    "Height differences that share a staff or a day are all too large, or too small, by one share.",
    "The staff is not calibrated, or values are in another unit.",
    "Correct the values by the scale.",
    "",
    4.0,
    (FILE, ALL),
    lambda notes: notes.is_levelled,
    lambda effects: effects.values,
    least=3,
)
