"""All causes of surveys: a new one is an object in a file of its own, and a line here."""

from __future__ import annotations

from obseq.survey.causes.antenna import ANTENNA
from obseq.survey.causes.antenna_beside import ANTENNA_BESIDE
from obseq.survey.causes.circle import CIRCLE
from obseq.survey.causes.distance_constant import CONSTANT
from obseq.survey.causes.distance_scale import SCALE
from obseq.survey.causes.eccentric import ECCENTRIC
from obseq.survey.causes.index_error import INDEX
from obseq.survey.causes.instrument_height import INSTRUMENT_HEIGHT
from obseq.survey.causes.known_heights import KNOWN_HEIGHTS
from obseq.survey.causes.known_scale import KNOWN_SCALE
from obseq.survey.causes.known_turn import KNOWN_TURN
from obseq.survey.causes.level_scale import LEVEL_SCALE
from obseq.survey.causes.target_height import TARGET_HEIGHT
from obseq.survey.causes.vector import WHOLE_VECTOR
from obseq.survey.causes.wrong_standpoint import STANDPOINT
from obseq.survey.causes.wrong_target import TARGET

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

OF_KNOWN = (KNOWN_HEIGHTS, KNOWN_SCALE, KNOWN_TURN)
"""Mistakes that all known coordinates share."""
