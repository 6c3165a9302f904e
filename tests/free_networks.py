"""Ordinary networks of which one thing more is known than their shape: what `--datum inner` makes of it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.survey import Datum, network_from_tables, simulate

if TYPE_CHECKING:
    from obseq.survey.network import Network

SIZES = (20.0, 60.0, 200.0, 500.0)
"""Metres. At 1 km a distance at height 0 of 1 mm shows the height to 6 m: to less than a hundredth of it."""
KNOWN = ("a coordinate", "a height", "a distance at height 0")
SEEDS_OF_ALL = len(SIZES) * len(KNOWN)


@dataclass(frozen=True)
class FreeCase:
    """One network.

    Attributes:
        network: It, with noise.
        known: Which of `KNOWN` is.
        redundancy: That of its adjustment on the inner datum.
    """

    network: Network
    known: str
    redundancy: int


def free_case(seed: int) -> FreeCase:
    """The network of a seed: its size, what is known of it, its observations and its place are drawn."""
    rng = np.random.default_rng(seed)
    known, size = KNOWN[seed % 3], SIZES[seed // 3 % 4]
    count = int(rng.integers(4, 9))
    places = rng.uniform(-0.5, 0.5, (count, 3)) * size * np.array([1.0, 1.0, 0.15])
    names = [f"P{k}" for k in range(count)]
    rows = observations(rng, names, size)
    if known == KNOWN[2]:
        origin, target = rng.choice(names, 2, replace=False)
        rows.append({"type": "DistHz0", "from": origin, "to": target, "value": size, "sigma": 0.001})
    sigmas = np.full((count, 3), np.nan)
    sigmas[:3] = 0.005
    if known != KNOWN[2]:
        sigmas[rng.integers(0, 3), 2 if known == KNOWN[1] else rng.integers(0, 2)] = 0.0
    points: dict[str, Any] = {"name": names}
    for k, axis in enumerate("xyz"):
        points[axis] = places[:, k].tolist()
        points[f"s{axis}"] = [None if np.isnan(sigma) else float(sigma) for sigma in sigmas[:, k]]
    table = {column: [row[column] for row in rows] for column in rows[0]}
    frame = f"RTL*{rng.uniform(-180, 180):.4f}*{rng.uniform(-70, 70):.4f}*0*EPSG:4326"
    network = simulate(network_from_tables(points, table, frame=frame), seed=seed)
    # coordinates and orientations, less the four motions that are free, of which a held coordinate takes one
    redundancy = len(rows) - 3 * count - count + 4
    return FreeCase(network, known, redundancy)


def observations(rng: np.random.Generator, names: list[str], size: float) -> list[dict[str, Any]]:
    """Directions and distances between all points, with zenith angles, levelled differences or both."""
    vertical = [("Zen",), ("DH",), ("Zen", "DH")][rng.integers(0, 3)]
    angle = max(3e-6, 0.0003 / size)
    sigmas = {"Hz": angle, "Zen": angle, "Dist": 0.001, "DH": 0.0005}
    return [
        {"type": kind, "from": origin, "to": target, "value": 1.0, "sigma": sigmas[kind]}
        for kind in ("Hz", "Dist", *vertical)
        for origin, target in permutations(names, 2)
    ]


def fault(case: FreeCase) -> str:
    """What is wrong with the adjustment of a network on the inner datum; empty where it is right."""
    found = case.network.adjust(datum=Datum("inner"))
    if not found.converged:
        return "not converged"
    if not found.book.observations.active.all() or found.left_out:
        return "observations or points are left out"
    if found.gross_errors:
        return f"accused: {found.gross_errors[0].what}"
    if found.solution.redundancy != case.redundancy:
        return f"redundancy {found.solution.redundancy} instead of {case.redundancy}"
    if not 0.5 < found.sigma0 < 1.7:
        return f"sigma0 {found.sigma0:.3f}"
    return "" if len(found.solution.iterations) <= 4 else f"{len(found.solution.iterations)} iterations"
