"""A set-up beside its mark."""

from obseq.survey.causes.cause import Cause
from obseq.survey.causes.scopes import SETUP

_BESIDE = 5.0
"""Metres up to which an instrument stands beside its mark; beyond, it is on another one."""

ECCENTRIC = Cause(
    "S162",
    "eccentric set-up",
    "All that was read in a set-up fits an instrument beside its mark.",
    "The instrument was not centred, or stood beside the mark on purpose and nobody reduced it.",
    "Reduce the readings to the mark, or make the stand point a point of its own.",
    "m",
    6.0,
    (SETUP,),
    lambda notes: notes.is_direction | notes.is_zenith | notes.is_length,
    lambda effects: effects.off_centre,
    least=5,
    parts=("east", "north"),
    most=_BESIDE,
)
