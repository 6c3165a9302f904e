"""All causes of surveys: a new one is an object in a file, and a line here."""

from __future__ import annotations

from obseq.survey.causes.constants import CONSTANT, INDEX, LEVEL_SCALE, SCALE
from obseq.survey.causes.known_points import KNOWN_BOWL, KNOWN_HEIGHTS, KNOWN_SCALE, KNOWN_TURN
from obseq.survey.causes.set_ups import (
    CIRCLE,
    ECCENTRIC,
    INSTRUMENT_HEIGHT,
    STANDPOINT,
    TARGET,
    TARGET_HEIGHT,
)
from obseq.survey.causes.vectors import ANTENNA, ANTENNA_BESIDE, WHOLE_VECTOR

CAUSES = (
    CIRCLE,
    INSTRUMENT_HEIGHT,
    TARGET_HEIGHT,
    INDEX,
    CONSTANT,
    SCALE,
    TARGET,
    STANDPOINT,
    ECCENTRIC,
    WHOLE_VECTOR,
    ANTENNA,
    ANTENNA_BESIDE,
    LEVEL_SCALE,
)
"""Where one column would be made twice, the first has it."""

OF_KNOWN = (KNOWN_HEIGHTS, KNOWN_SCALE, KNOWN_TURN, KNOWN_BOWL)
"""Mistakes that all known coordinates share."""
