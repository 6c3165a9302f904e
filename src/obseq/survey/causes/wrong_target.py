"""Readings to another target than the one that is noted."""

from obseq.survey.causes.cause import Cause
from obseq.survey.causes.scopes import READING, SIGHT

TARGET = Cause(
    "S160",
    "name of a target",
    "All that was read from a set-up to a target fits another point.",
    "Another point was sighted, or its name was mistyped.",
    "Correct the name of the target.",
    "",
    5.0,
    (SIGHT, READING),
    lambda notes: notes.setups >= 0,
    needs_slip=True,
)
