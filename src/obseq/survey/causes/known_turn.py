"""Known points of another zone or system: larger or smaller, and turned."""

import numpy as np

from obseq.survey.causes.cause import KnownCause

KNOWN_TURN = KnownCause(
    "S116",
    "system of known points",
    "Known points fit what is observed when they are turned in plan, and made larger or smaller.",
    "Coordinates of another zone or another map than the one that is named.",
    "Correct --points-crs or --frame.",
    "",
    6.0,
    (0, 1),
    lambda places, components, _: np.column_stack(
        [
            places[np.arange(len(places)), components],
            np.where(components == 0, places[:, 1], -places[:, 0]),
        ]
    ),
    parts=("larger", "of a radian, turned clockwise"),
)
