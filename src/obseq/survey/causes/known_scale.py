"""A wrong scale of known points."""

import numpy as np

from obseq.survey.causes.cause import KnownCause

KNOWN_SCALE = KnownCause(
    "S115",
    "scale of known points",
    "Known points are too far apart in plan, or too near, by one share.",
    "A ground scale in place of that of the map, another unit, or another zone or system.",
    "Correct --points-crs, or the scale of the coordinates.",
    "",
    5.0,
    (0, 1),
    lambda places, components, _: places[np.arange(len(places)), components][:, None],
)
