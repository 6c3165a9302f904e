"""An index error of zenith angles."""

from obseq.survey.causes.cause import Cause
from obseq.survey.causes.scopes import ALL, FILE, FROM, SETUP, TO

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
