"""Makes a synthetic survey network: OBS and COR files of any size, for benches and tests.

Points lie on a wavy terrain, near the nodes of a square grid of a local tangent frame (RTL) in Lambert 93.
Every second node of every second row is a plumb station that observes Hz, Zen and Dist to points around it,
two of them stations, so that the network hangs together. Observations follow the adjustment's own model
(ellipsoid normal, refraction) with normal noise of their sigma; one point in a hundred is known. The time is
proportional to the size.

Example:
    python tools/benchmarks/make_network.py --points 10000 --observations 60000 --out big
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import numpy.typing as npt

import obseq.crs
from obseq.survey import (
    FieldBook,
    Observations,
    Orientation,
    Points,
    Stations,
    make_points,
    write_cor,
    write_obs,
)
from obseq.survey.kinds.directions import HZ, ZEN
from obseq.survey.kinds.lengths import DIST
from obseq.survey.model import group_by_station

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]

FRAME = "RTL*657700*6860700*0*IGNF:LAMB93"
PLANE = "IGNF:LAMB93"
SIGMA_KNOWN = 0.001
SIGMA_ANGLE = 1.5e-5
SIGMA_DISTANCE = 0.002
_REACH = 4
_FIRST_SIGHTS = ((2, 0), (0, 2), (1, 0), (0, 1), (1, 1))
_KINDS = (HZ.code, ZEN.code, DIST.code)


def main() -> None:
    """Reads the options, writes the files, says what they hold."""
    options = _options()
    random = np.random.default_rng(options.seed)
    true = terrain(options.points, options.spacing, random)
    names = [f"P{row + 1}" for row in range(len(true))]
    book = measured(names, true, sights(len(true), options.observations), random)
    system = FRAME if options.frame == "rtl" else PLANE
    known = known_points(names, true, options.known, system, random)
    options.out.mkdir(parents=True, exist_ok=True)
    write_obs(options.out / "network.obs", book)
    write_cor(options.out / "network.cor", known, f"{system}, seed {options.seed}")
    write_cor(options.out / "true.cor", make_points(names, in_system(true, system)), f"{system}, true values")
    print(
        f"{options.out}: {len(true)} points ({len(known)} known) in {system}, {len(book.stations)} stations, "
        f"{len(book.observations)} observations; adjust in {FRAME}"
    )


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--points", type=_positive, default=10_000, help="number of points (default 10000)")
    parser.add_argument("--observations", type=_positive, default=60_000, help="about (default 60000)")
    parser.add_argument("--known", type=_positive, default=100, help="one point in so many is known")
    parser.add_argument("--spacing", type=float, default=50.0, help="distance of neighbours, metres")
    parser.add_argument("--frame", choices=("rtl", "l93"), default="rtl", help="system of the COR files")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("network"), help="folder to write")
    return parser.parse_args()


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("must be 1 or more")
    return number


def terrain(n_points: int, spacing: float, random: np.random.Generator) -> FloatArray:
    """(n, 3) points of the frame, near the nodes of a square grid centred on its origin."""
    width = _width(n_points)
    rows, columns = np.divmod(np.arange(n_points), width)
    east = (columns - width / 2.0 + random.uniform(-0.25, 0.25, n_points)) * spacing
    north = (rows - width / 2.0 + random.uniform(-0.25, 0.25, n_points)) * spacing
    waves = 2.0 * np.sin(east / (6.0 * spacing)) + 3.0 * np.cos(north / (9.0 * spacing))
    up = 100.0 + spacing / 5.0 * waves + random.uniform(-0.05, 0.05, n_points) * spacing
    return np.column_stack([east, north, up])


def _width(n_points: int) -> int:
    return int(np.ceil(np.sqrt(n_points)))


def sights(n_points: int, n_observations: int) -> IntArray:
    """(k, 2) rows of station and target, ordered by station."""
    width = _width(n_points)
    rows, columns = np.divmod(np.arange(n_points), width)
    stations = np.flatnonzero((rows % 2 == 0) & (columns % 2 == 0))
    wanted = max(1, round(n_observations / len(_KINDS) / len(stations)))
    pairs = []
    for right, ahead in _offsets(max(wanted, len(_FIRST_SIGHTS))):
        column, target = columns[stations] + right, stations + ahead * width + right
        kept = (column >= 0) & (column < width) & (target >= 0) & (target < n_points)
        pairs.append(np.column_stack([stations[kept], target[kept]]))
    found = np.concatenate(pairs)
    return found[np.argsort(found[:, 0], kind="stable")].astype(np.int32)


def _offsets(count: int) -> list[tuple[int, int]]:
    """Grid offsets of the targets of a station: those that connect the network, then the nearest."""
    reach = range(-_REACH, _REACH + 1)
    nearest = sorted(((i, j) for i in reach for j in reach if (i, j) != (0, 0)), key=lambda o: np.hypot(*o))
    return list(dict.fromkeys([*_FIRST_SIGHTS, *nearest]))[:count]


def measured(names: list[str], true: FloatArray, pairs: IntArray, random: np.random.Generator) -> FieldBook:
    """Hz, Zen and Dist of each sight, with noise; one plumb station per origin, its zero anywhere."""
    origins, numbers = np.unique(pairs[:, 0], return_inverse=True)
    g0 = random.uniform(-np.pi, np.pi, len(origins))[numbers]
    exact = exact_values(true, pairs, g0)
    sigmas = np.broadcast_to([SIGMA_ANGLE, SIGMA_ANGLE, SIGMA_DISTANCE], exact.shape)
    values = exact + random.normal(0.0, 1.0, exact.shape) * sigmas
    values[:, 0] %= 2.0 * np.pi
    n, per = exact.size, len(_KINDS)
    stations = np.repeat(numbers, per).astype(np.int32)
    stations[per - 1 :: per] = -1
    starts, members = group_by_station(stations, len(origins))
    observations = Observations(
        types=np.tile(np.array(_KINDS, np.int16), len(pairs)),
        from_points=np.repeat(pairs[:, 0], per),
        to_points=np.repeat(pairs[:, 1], per),
        values=values.ravel(),
        sigmas=sigmas.ravel(),
        relative_sigmas=np.zeros(n),
        from_heights=np.zeros(n),
        to_heights=np.zeros(n),
        active=np.ones(n, np.bool_),
        stations=stations,
        groups=np.full(n, -1, np.int32),
        file_indices=np.zeros(n, np.int32),
        lines=np.arange(1, n + 1, dtype=np.int32),
        backsights=np.full(n, -1, np.int32),
    )
    plumb = np.full(len(origins), Orientation.VERT, np.int8)
    set_ups = Stations(origins.astype(np.int32), plumb, starts, members)
    return FieldBook(tuple(names), observations, set_ups, ("synthetic",))


def exact_values(true: FloatArray, pairs: IntArray, g0: FloatArray) -> FloatArray:
    """(k, 3) horizontal reading, zenith angle (refracted), slope distance."""
    frame = obseq.crs.parse(FRAME)
    start, end = true[pairs[:, 0]], true[pairs[:, 1]]
    vertical = frame.vertical_rotation(true)[pairs[:, 0]]
    east, north, up = np.einsum("kij,kj->ik", vertical, end - start)
    zenith = np.arctan2(np.hypot(east, north), up) - obseq.crs.refraction_correction(frame, start, end)
    return np.column_stack([np.arctan2(east, north) - g0, zenith, np.linalg.norm(end - start, axis=1)])


def known_points(
    names: list[str], true: FloatArray, one_in: int, system: str, random: np.random.Generator
) -> Points:
    """Points drawn at random with noisy coordinates in a system; two at least, when there are two."""
    count = min(len(true), max(2, len(true) // one_in))
    rows = np.sort(random.choice(len(true), count, replace=False))
    noisy = true[rows] + random.normal(0.0, SIGMA_KNOWN, (len(rows), 3))
    sigmas = np.full((len(rows), 3), SIGMA_KNOWN)
    return make_points([names[row] for row in rows], in_system(noisy, system), sigmas)


def in_system(points: FloatArray, system: str) -> FloatArray:
    """Points of the frame in another system."""
    if system == FRAME:
        return points
    return obseq.crs.Transformer(obseq.crs.parse(FRAME), obseq.crs.parse(system)).forward(points)


if __name__ == "__main__":
    main()
