"""A network that several files of tests spoil: four known points and a fifth, each seen from all others."""

import math

import numpy as np

from obseq.survey import network_from_tables

PLACES = {
    "A": (100.0, 900.0, 5.0),
    "B": (700.0, 950.0, 9.0),
    "C": (650.0, 300.0, 14.0),
    "D": (120.0, 340.0, 2.0),
}
PLACES |= {"P": (400.0, 600.0, 8.0)}


def network(known="ABCD", stations="ABCDP"):
    """Directions, zenith angles and slope distances and height differences from all stations to all."""
    rows = []
    for origin in stations:
        for target in PLACES:
            if target == origin:
                continue
            dx, dy, dz = np.subtract(PLACES[target], PLACES[origin])
            azimuth, flat = math.atan2(dx, dy) % (2.0 * math.pi), math.hypot(dx, dy)
            rows += [
                ("Hz", origin, target, azimuth, 1e-5),
                ("Zen", origin, target, math.atan2(flat, dz), 1e-4),
                ("Dist", origin, target, math.hypot(flat, dz), 2e-3),
                ("DH", origin, target, dz, 1e-3),
            ]
    places = {name: place if name in known else (None,) * 3 for name, place in PLACES.items()}
    points = {"name": list(places)} | dict(zip("xyz", zip(*places.values(), strict=True), strict=True))
    points |= {axis: [0.001 if name in known else None for name in places] for axis in ("sx", "sy", "sz")}
    columns = ("type", "from", "to", "value", "sigma")
    return network_from_tables(points, dict(zip(columns, zip(*rows, strict=True), strict=True)))
