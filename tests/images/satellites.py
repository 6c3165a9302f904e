"""Synthetic satellite images: three views of one ground, their polynomials off by corrections."""

from dataclasses import dataclass, replace

import numpy as np

from obseq import crs
from obseq.images import ControlPoints, ImagePoints
from obseq.images.aerial.rpc import Rpc
from obseq.images.satellite.block import GEOGRAPHIC, SatelliteBlock

HEIGHT = 3
"""Place of the height among the terms of a polynomial."""


def made_rpc() -> Rpc:
    """Rational polynomials of an image of half a metre a pixel, in the south of France."""
    rng = np.random.default_rng(1)
    coefficients = np.zeros((4, 20))
    coefficients[[1, 3], 0] = 1.0
    coefficients[0, [0, 1, 2, 3]] = [1e-3, 0.05, -1.02, 0.015]
    coefficients[2, [0, 1, 2, 3]] = [-2e-3, 1.01, 0.06, -0.01]
    coefficients[:, 4:10] += rng.normal(0.0, 3e-4, (4, 6))
    coefficients[:, 10:] += rng.normal(0.0, 3e-6, (4, 10))
    offsets = {"LINE": 14000.0, "SAMP": 15000.0, "LAT": 43.6, "LONG": 5.2, "HEIGHT": 300.0}
    scales = {"LINE": 14000.0, "SAMP": 15000.0, "LAT": 0.063, "LONG": 0.093, "HEIGHT": 500.0}
    return Rpc(offsets, scales, coefficients)


@dataclass
class Scene:
    """A block with its truth."""

    block: SatelliteBlock
    points: np.ndarray
    corrections: dict


def views(base: Rpc) -> dict[str, Rpc]:
    """Images of it from three sides: what a height moves changes."""
    found = {}
    for name, along, across in (("fore", 0.03, 0.0), ("nadir", 0.0, 0.002), ("aft", -0.025, -0.004)):
        coefficients = base.coefficients.copy()
        coefficients[0, HEIGHT] += along
        coefficients[2, HEIGHT] += across
        found[name] = replace(base, coefficients=coefficients)
    return found


def scene(
    base: Rpc | None = None,
    correction: str = "affine",
    n_points: int = 60,
    n_control: int = 6,
    n_check: int = 20,
    noise: float = 0.4,
    seed: int = 0,
) -> Scene:
    """Points over the whole ground, each in all images; control is good to 20 cm."""
    rng = np.random.default_rng(seed)
    rpcs = views(base or made_rpc())
    one = rpcs["nadir"]
    unit = rng.uniform(-0.8, 0.8, (n_points, 3)) * [1.0, 1.0, 0.4]
    keys = ("LONG", "LAT", "HEIGHT")
    offsets, scales = (np.array([part[key] for key in keys]) for part in (one.offsets, one.scales))
    ground = offsets + unit * scales
    frame = crs.rtl_at(offsets, crs.parse(GEOGRAPHIC)).definition
    points = np.asarray(crs.Transformer(crs.parse(GEOGRAPHIC), crs.parse(frame)).forward(ground))
    truth, xy = {}, []
    for name, rpc in rpcs.items():
        middle, half = np.array([rpc.offsets["SAMP"], rpc.offsets["LINE"]]), rpc.scales["SAMP"]
        shift, drift = rng.normal(0.0, 5.0, 2), rng.normal(0.0, 1.0 / half, (2, 2))
        drift *= correction == "affine"
        pixels = rpc.project(ground) - middle
        xy.append(pixels + shift + pixels @ drift.T + middle + rng.normal(0.0, noise, pixels.shape))
        truth[name] = [*shift, *drift[:, 1], *drift[:, 0]][: 2 if correction == "bias" else 6]
    names = [f"p{k}" for k in range(n_points)]
    image, point = np.divmod(np.arange(3 * n_points), n_points)
    measures = ImagePoints.packed(tuple(rpcs), names, image, point, np.concatenate(xy), noise)
    given = points + rng.normal(0.0, 0.2, points.shape)
    order = rng.permutation(n_points)
    own, other = order[:n_control], order[n_control : n_control + n_check]
    control, check = (ControlPoints.of([names[k] for k in rows], given[rows], 0.2) for rows in (own, other))
    block = SatelliteBlock(rpcs, measures, control, check, frame, correction)
    return Scene(block, points, truth)
