"""A set-up that is on another point than the one that is noted."""

from obseq.survey.causes.cause import Cause
from obseq.survey.causes.scopes import SETUP

STANDPOINT = Cause(
    "S161",
    "name of a stand point",
    "Nothing that was read in a set-up fits its point.",
    "The instrument stood on another point, or beside it; or the name was mistyped.",
    "Correct the name of the stand point, or make it a point of its own.",
    "",
    8.0,
    (SETUP,),
    lambda notes: notes.setups >= 0,
    least=5,
)
