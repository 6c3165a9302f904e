"""A network of distances that several files of tests spoil."""

import math

import numpy as np

from obseq.survey import Network

KNOWN = {"A": (0, 0, 0), "B": (100, 0, 2), "C": (90, 80, -3), "D": (-10, 70, 1)}
PLACES = KNOWN | {"P": (40.0, 30.0, 5.0), "Q": (60.0, 55.0, -2.0), "R": (20.0, 60.0, 4.0)}
SIGMA = 0.002


def distances(folder, blunder=0.0, seed=1, scale=1.0) -> Network:
    """Distances from four held points to three unknown ones and among these, one of them with a blunder."""
    chance = np.random.default_rng(seed)
    pairs = [(a, b) for a in KNOWN for b in "PQR"] + [("P", "Q"), ("Q", "R"), ("R", "P")]
    lines = []
    for k, (a, b) in enumerate(pairs):
        true = math.dist(PLACES[a], PLACES[b])
        value = true + scale * SIGMA * chance.standard_normal() + (blunder if k == 4 else 0.0)
        lines.append(f"3 {a} {b} {value:.6f} {SIGMA}")
    (folder / "n.obs").write_text("\n".join(lines) + "\n", encoding="utf-8")
    rows = [f"{int(n in KNOWN)} {n} {x} {y} {z} 0" for n, (x, y, z) in PLACES.items()]
    (folder / "n.cor").write_text("\n".join(rows) + "\n", encoding="utf-8")
    return Network.read(folder / "n.obs", folder / "n.cor", frame="Local")
