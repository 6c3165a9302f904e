"""A wrong height of the instrument."""

from obseq.survey.causes.cause import Cause
from obseq.survey.causes.scopes import FROM, SETUP

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
