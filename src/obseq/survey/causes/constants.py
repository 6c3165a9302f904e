"""Wrong constants, scales and indices that observations of one kind share."""

from obseq.survey.causes.cause import Cause
from obseq.survey.causes.scopes import ALL, FILE, FROM, INSTRUMENT, SETUP, TO

INDEX = Cause(
    "S140",
    "index of zenith angles",
    "Zenith angles that share an instrument, a day or a point are all off by the same angle.",
    "One face only was read with a compensator out of adjustment; or refraction is not that of the model.",
    "Calibrate the instrument, read both faces, or adjust with an index as an unknown.",
    "rad",
    4.5,
    (SETUP, FILE, FROM, TO, ALL),
    lambda notes: notes.is_zenith,
    lambda effects: effects.ones,
)

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
