"""Rates of aerial intersections: ours for arrays, beside the one-point-at-a-time way of Borea.

    python tools/benchmarks/bench_aerial.py --points 1000000 --json aerial.json

The rival does for each point what Borea 0.2.2 does: a frame centred between the two shots, four conversions
by PROJ, two rotations, Cramer's rule. It is written here from the description of the method, because Borea is
not on the package index. Both get the same points, in turn, and the largest difference is printed.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from command import command_line, write_json
from pyproj import CRS, Proj, Transformer

from obseq.images.aerial import FrameCamera, HeightType, MapSystem, Shots, Worksite, intersect_pairs

if TYPE_CHECKING:
    import argparse

CENTRE = np.array([815000.0, 6283000.0])
FLYING_HEIGHT = 1800.0
RIVAL_POINTS = 300


def block(n_shots: int = 100) -> Worksite:
    """Vertical shots on a grid of 250 m, in Lambert 93."""
    side = int(np.sqrt(n_shots))
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    plan = CENTRE + 250.0 * np.column_stack([x.ravel(), y.ravel()])
    rng = np.random.default_rng(1)
    angles = rng.normal(0.0, 0.01, (side * side, 3))
    places = np.column_stack([plan, FLYING_HEIGHT + rng.normal(0.0, 10.0, side * side)])
    names = [f"S{k}" for k in range(side * side)]
    shots = Shots.from_angles(names, places, angles, ["c"] * len(names), height_type=HeightType.HEIGHT)
    camera = FrameCamera("c", (13210.0, 8502.0), 30975.0, (26460, 17004))
    return Worksite(shots, {"c": camera}, MapSystem(2154))


def measures(site: Worksite, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of neighbouring shots (count, 2) and pixels (count, 2, 2) of points between them."""
    rng = np.random.default_rng(2)
    first = rng.integers(0, len(site.shots) - 1, count)
    pairs = np.stack([first, first + 1], axis=1)
    middle = site.shots.positions[pairs, :2].mean(axis=1)
    ground = np.column_stack(
        [middle + rng.uniform(-200.0, 200.0, (count, 2)), rng.uniform(0.0, 100.0, count)]
    )
    pixels = [site.world_to_image(pairs[:, k], ground, HeightType.HEIGHT) for k in (0, 1)]
    return pairs, np.stack(pixels, axis=1)


class OneAtATime:
    """Borea's way: objects per shot, a frame and PROJ calls per point."""

    def __init__(self, site: Worksite) -> None:
        self.site = site
        crs = CRS.from_epsg(2154)
        self.projection = Proj(crs)
        self.to_geodetic = Transformer.from_crs(crs, crs.geodetic_crs, always_xy=True)
        self.to_geocentric = Transformer.from_crs(crs.to_3d(), "EPSG:4978", always_xy=True)

    def axes(self, x: float, y: float) -> np.ndarray:
        """Rotation from geocentric axes to the frame at a map point."""
        lon, lat = self.to_geodetic.transform(x, y)
        gamma = -np.deg2rad(self.projection.get_factors(lon, lat).meridian_convergence)
        lon, lat = np.deg2rad([lon, lat])
        east = np.array([-np.sin(lon), np.cos(lon), 0.0])
        north = np.array([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
        turn = np.array([[np.cos(gamma), np.sin(gamma)], [-np.sin(gamma), np.cos(gamma)]])
        return np.vstack([turn @ np.stack([east, north]), np.cross(east, north)])

    def intersect(self, pair: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        """The ground point of one pair."""
        shots = self.site.shots
        centre = shots.positions[pair, :2].mean(axis=0)
        frame = self.axes(*centre)
        origin = np.array(self.to_geocentric.transform(*centre, 0.0))
        eyes, rays = [], []
        for row, pixel in zip(pair, pixels, strict=True):
            place = shots.positions[row]
            turn = shots.matrices[row] @ self.axes(*place[:2]) @ frame.T
            eyes.append(frame @ (np.array(self.to_geocentric.transform(*place)) - origin))
            rays.append(turn.T @ np.array([pixel[0] - 13210.0, pixel[1] - 8502.0, 30975.0]))
        base = eyes[1] - eyes[0]
        t1, t2 = nearest(base, *rays)
        middle = 0.5 * (eyes[0] + t1 * rays[0] + eyes[1] + t2 * rays[1])
        return np.array(self.to_geocentric.transform(*(frame.T @ middle + origin), direction="INVERSE"))


def nearest(base: np.ndarray, first: np.ndarray, second: np.ndarray) -> tuple[float, float]:
    """How far along two rays, `base` apart, they are nearest to each other; in lengths of their vectors."""
    n1, n2, c = first @ first, second @ second, first @ second
    below = c * c - n1 * n2
    along, across = base @ second, base @ first
    return (along * c - across * n2) / below, (along * n1 - across * c) / below


def arguments() -> argparse.Namespace:
    """What the command line asks for."""
    parser = command_line(__doc__)
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", type=Path)
    return parser.parse_args()


def main() -> None:
    """Time both, print the rates and their ratio."""
    chosen = arguments()
    site = block()
    pairs, pixels = measures(site, chosen.points)
    rival = OneAtATime(site)
    ours, theirs = [], []
    for _ in range(chosen.rounds):
        start = time.process_time()
        found = intersect_pairs(site, pairs, pixels, HeightType.HEIGHT)
        ours.append(time.process_time() - start)
        start = time.process_time()
        single = [rival.intersect(pairs[k], pixels[k]) for k in range(RIVAL_POINTS)]
        theirs.append((time.process_time() - start) / RIVAL_POINTS)
    off = float(np.abs(np.array(single) - found.points[:RIVAL_POINTS]).max())
    seconds, each = float(np.median(ours)), float(np.median(theirs))
    result = {
        "points": chosen.points,
        "seconds_of_processor": seconds,
        "points_per_second": chosen.points / seconds,
        "rival_points_per_second": 1.0 / each,
        "ratio": each * chosen.points / seconds,
        "largest_difference_m": off,
    }
    for key, value in result.items():
        print(f"{key:>24}: {value:.6g}")
    write_json(chosen.json, result)


if __name__ == "__main__":
    main()
