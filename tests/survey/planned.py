"""A network to plan: two known points, six new ones, three instruments; values of observations are none."""

import numpy as np

from obseq.survey import Network

NAMES = ("K1", "K2", "A", "B", "C", "D", "E", "F")
PLACES = np.array(
    [
        [0.0, 0.0, 0.0],
        [100.0, 0.0, 2.0],
        [50.0, 80.0, 5.0],
        [20.0, 60.0, 1.0],
        [80.0, 60.0, 3.0],
        [50.0, 20.0, 0.0],
        [10.0, 90.0, 2.0],
        [90.0, 95.0, 4.0],
    ]
)
STATIONS = ("K1", "K2", "D")


def point_text(places=PLACES, sigma=0.001):
    lines = []
    for name, place in zip(NAMES, places, strict=True):
        known = name.startswith("K")
        numbers = [*place.tolist(), *([sigma] * 3 if known else [])]
        lines.append(" ".join(["1" if known else "0", name, *map(str, numbers)]))
    return "\n".join(lines) + "\n"


def observation_text(stations=STATIONS, without=()):
    """Directions, zenith angles and distances from each station to all points, but for (code, from, to)."""
    lines = []
    for station in stations:
        lines.append("#NEW")
        for target in NAMES:
            for code, value, sigma in ((5, 0, 0.0005), (6, 100, 0.0005), (3, 1, 0.001)):
                if target != station and (code, station, target) not in without:
                    lines.append(f"{code} {station} {target} {value} {sigma}")
    return "\n".join(lines) + "\n"


def network(folder, **options):
    without = options.pop("without", ())
    (folder / "plan.obs").write_text(observation_text(without=without))
    (folder / "plan.cor").write_text(point_text(**options))
    return Network.read(folder / "plan.obs", folder / "plan.cor")
