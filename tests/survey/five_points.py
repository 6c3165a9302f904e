"""A site of five points, each of which observes all others: directions, zenith angles and distances."""

import math

import numpy as np

PLACES = {"A": (0.0, 0.0, 10.0), "B": (210.0, 20.0, 14.0), "C": (90.0, 190.0, 7.0), "D": (60.0, 60.0, 12.0)}
PLACES |= {"E": (130.0, 110.0, 9.0)}


def sights():
    """Type, ends, value (rad or m) and sigma of each observation; the circle of each station is turned."""
    random = np.random.default_rng(2)
    for k, (start, here) in enumerate(PLACES.items()):
        for end, there in PLACES.items():
            east, north, up = np.subtract(there, here)
            flat = math.hypot(east, north)
            hz, zen = (math.atan2(*pair) + random.normal(0.0, 1e-5) for pair in ((east, north), (flat, up)))
            if start != end:
                yield "Hz", start, end, (hz + 1.3 * k) % (2.0 * math.pi), 1e-5
                yield "Zen", start, end, zen, 1e-5
                yield "Dist", start, end, math.hypot(flat, up), 0.002


def table(rows):
    """The columns of a table of observations."""
    columns = ("type", "from", "to", "value", "sigma")
    return dict(zip(columns, zip(*rows, strict=True), strict=True))
