"""Mistakes that all known points share: heights of another kind, a scale, another zone or system."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.survey.causes.cause import KnownCause


def _too_large(places: FloatArray, components: IntArray, curvature: float) -> FloatArray:
    """Slopes of heights; of what they all have too much only what it does to the plan is seen.

    What lies higher is larger on the ground than on the map.
    """
    is_height = components == 2
    own = np.where(is_height, 0.0, places[np.arange(len(places)), components] * curvature)
    return np.column_stack([own, np.where(is_height[:, None], 1e-3 * places[:, :2], 0.0)])


KNOWN_HEIGHTS = KnownCause(
    "S114",
    "heights of known points",
    "Known heights differ from what is observed by a constant and a slope.",
    "Heights above the geoid (levelled) stand where GNSS vectors need heights above the ellipsoid.",
    "Add the geoid heights, or name the vertical system in --points-crs.",
    "m",
    6.0,
    (0, 1, 2),
    _too_large,
    parts=("in the middle", "a kilometre east", "a kilometre north"),
    least=4,
)

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

KNOWN_BOWL = KnownCause(
    "S117",
    "frame of known heights",
    "Known heights fall from the middle outwards, or rise: by 78 mm at a kilometre, the Earth's curvature.",
    "Coordinates of a local frame (RTL) are adjusted without it, or levelled heights are taken for its own.",
    "Name the system of the coordinates: --frame, --points-crs.",
    "m",
    6.0,
    (2,),
    lambda places, _components, _curvature: np.column_stack(
        [1e-6 * np.square(places[:, :2]).sum(axis=1), 1e-3 * places[:, :2]]
    ),
    parts=("a kilometre from the middle", "a kilometre east", "a kilometre north"),
    least=4,
)
