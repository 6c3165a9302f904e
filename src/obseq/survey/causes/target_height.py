"""A wrong height of a target."""

from obseq.survey.causes.cause import Cause
from obseq.survey.causes.scopes import READING, SIGHT, TO

TARGET_HEIGHT = Cause(
    "S131",
    "height of target",
    "Zenith angles, slope distances and height differences to a target share a wrong height of it.",
    "The pole was lengthened between two sights, or its height was not noted.",
    "Look up the height in the field notes, and correct it in all lines to the target.",
    "m",
    4.0,
    (SIGHT, READING, TO),
    lambda notes: notes.is_raised,
    lambda effects: effects.raised,
    is_bent=True,
)
