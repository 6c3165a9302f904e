"""Networks that are counted apart: what the referee itself, asked again, finds undecided or stood above."""

import re
from dataclasses import replace

import numpy as np
from referee.adjusted import UndeterminedError, adjust

WEAK = 0.01  # of the size of the network: what is known to less is not determined (docs/statistics.md)
CLEAR = 9.0  # difference of two sums of squares that decides between two places
PLACE = re.compile(r"\((-?[\d.]+), (-?[\d.]+), (-?[\d.]+)\)")


def weak_points(network, found):
    """Names of the points whose coordinates a solution leaves uncertain by a hundredth of the size."""
    true = np.array([p.true for p in network.points])
    size = 2 * np.linalg.norm(true - true.mean(axis=0), axis=1).max()
    rows = {p.name: found.names[p.name] for p in network.points}
    spread = {name: np.sqrt((found.spread[3 * k : 3 * k + 3] ** 2).sum(axis=1)) for name, k in rows.items()}
    return {name for name, sd in spread.items() if sd.max() > WEAK * size}


def is_undecided(network, left_out):
    """Whether the places told of a point that was left out are minima that the observations do not decide."""
    told, costs = left_out.sentence, []
    name = told.split()[1]
    starts = {p.name: p.start for p in network.points}
    for place in PLACE.findall(told):
        found = from_places(network, starts | {name: np.array(list(map(float, place)))})
        if found is None:
            return False
        costs.append(cost(found))
    return len(costs) > 1 and max(costs) - min(costs) < CLEAR


def from_places(network, places, tilts=None):
    """What the referee finds from other places of the points, by their names; None where it finds nothing."""
    points = [replace(p, start=places[p.name]) for p in network.points]
    try:
        return adjust(replace(network, points=points), tilts=tilts)
    except (UndeterminedError, np.linalg.LinAlgError):
        return None


def lowest(network, places):
    """The lowest minimum that the referee finds from some places, and from the truth; None without any."""
    truth = {p.name: p.true for p in network.points}
    found = [from_places(network, places), from_places(network, truth, network.tilts)]
    return min((item for item in found if item is not None), key=cost, default=None)


def cost(found):
    """The weighted sum of squares of a solution."""
    return found.variance_factor * found.freedom if found.freedom else 0.0
