"""A block of images with what may stand beside it: control, lengths, rigid blocks, clinometers, a survey.

It is a network whose points are those of the block; control points are its known points. Poses are centres
and rotations from camera to world, turned about the world's axes by small vectors.
"""

from dataclasses import dataclass, field

import numpy as np
from referee.equations import Equations
from referee.network import Network, Unknowns, with_two_across

PARAMETERS = ("F", "PPx", "PPy", "K1", "K2", "K3", "p1", "p2", "b1", "b2")


@dataclass
class Image:
    """An image, where it starts, and who took it."""

    name: str
    camera: str
    centre: np.ndarray
    turn: np.ndarray  # (3, 3) camera to world


@dataclass
class Clinometer:
    """An axis in the frame of the cameras; `free` are the degrees of its correction that are unknowns."""

    name: str
    axis: np.ndarray
    is_fixed: bool
    correction: np.ndarray
    free: tuple


@dataclass
class Block(Network):
    """A block: `measures` by image are (points, pixels (n, 2), sigmas (n,)).

    `cameras` by name are ten parameters; `frozen` those of them that keep their value, `priors` (camera,
    parameter, value, sigma). `lengths` are (a, b, value, sigma), `positions` (image, xyz, sigmas (3,)),
    `pairs` (camera of the rig, master's image, its image), `places` by camera of the rig (centre, turn),
    `rig_sigmas` of shift and turn, `inclinations` (clinometer, image, reading, sigma), `control` by point
    a full covariance in place of its sigmas. `datum` is "control", "centres" or "points".
    """

    images: list = field(default_factory=list)
    cameras: dict = field(default_factory=dict)
    frozen: tuple = ()
    priors: tuple = ()
    measures: dict = field(default_factory=dict)
    lengths: tuple = ()
    positions: tuple = ()
    pairs: tuple = ()
    places: dict = field(default_factory=dict)
    rig_sigmas: tuple = ()
    clinometers: tuple = ()
    inclinations: tuple = ()
    datum: str = "control"

    def loose(self, unknowns, jacobian, white, hold):
        """Unknowns, with their equations -> (u, d) what no measure sees."""
        return lambda _, white, hold: unseen(white, hold)

    def datum_rows(self, unknowns):
        if self.datum == "points":
            return super().datum_rows(unknowns)
        return [unknowns.at["centre", image.name].start + k for image in self.images for k in range(3)]


def unseen(white, hold):
    """(u, d) what equations do not see."""
    _, s, vt = np.linalg.svd(np.vstack([white, hold]) / (scale := np.linalg.norm(white, axis=0)))
    return vt[int((s > 1e-9 * s[0]).sum()) :].T / scale[:, None]


class BlockUnknowns(Unknowns):
    """Those of the network, then poses, calibrations, places of the rig, axes and corrections."""

    def __init__(self, block):
        super().__init__(block)
        for image in block.images:
            self.add(("centre", image.name), image.centre)
            self.add(("turn", "image", image.name), np.zeros(3))
            self.bases[image.name] = image.turn
        for name, values in block.cameras.items():
            for parameter, value in zip(PARAMETERS, values, strict=True):
                if parameter not in block.frozen:
                    self.add(("camera", name, parameter), value)
        for name, (centre, turn) in block.places.items():
            self.add(("place", name), centre)
            self.add(("turn", "place", f"place {name}"), np.zeros(3))
            self.bases[f"place {name}"] = turn
        for item in block.clinometers:
            self.bases[item.name] = with_two_across(item.axis)
            if not item.is_fixed:
                self.add(("axis", item.name), np.zeros(2))
            for degree in item.free:
                self.add(("correction", item.name, degree), item.correction[degree])


class BlockEquations(Equations):
    """Residuals of a block."""

    def observed(self):
        parts, sigmas = super().observed()
        for more in (
            self._pixels,
            self._lengths,
            self._positions,
            self._pairs,
            self._inclinations,
            self._priors,
        ):
            for residual, sigma in more():
                parts.append(residual)
                sigmas.append(sigma)
        return parts, sigmas

    def turn(self, *key):
        """(m, 3, 3) a rotation to the world, or to the rig: (I + [w]x) R."""
        w, base = self.rows[:, self.unknowns.at[("turn", *key)]], self.unknowns.bases[key[-1]]
        return base + np.stack([np.cross(w, column) for column in base.T], axis=-1)

    def centre(self, image):
        return self.rows[:, self.unknowns.at["centre", image]]

    def parameters(self, camera):
        """Ten arrays (m, 1)."""
        return [
            self.rows[:, self.unknowns.at[key]]
            if (key := ("camera", camera, name)) in self.unknowns.at
            else value
            for name, value in zip(PARAMETERS, self.net.cameras[camera], strict=True)
        ]

    def _pixels(self):
        """Of all image points: x and y, computed minus measured."""
        for image in self.net.images:
            names, pixels, sigmas = self.net.measures[image.name]
            points = np.stack([self.point(name) for name in names], axis=1)
            local = np.einsum(
                "mij,mni->mnj", self.turn("image", image.name), points - self.centre(image.name)[:, None]
            )
            computed = projected(local, self.parameters(image.camera))
            for k, sigma in enumerate(sigmas):
                for axis in range(2):
                    yield computed[axis][:, k] - pixels[k, axis], sigma

    def _lengths(self):
        for a, b, value, sigma in self.net.lengths:
            d = self.point(b) - self.point(a)
            yield np.sqrt((d * d).sum(axis=-1)) - value, sigma

    def _positions(self):
        for image, xyz, sigmas in self.net.positions:
            for k in range(3):
                yield self.centre(image)[:, k] - xyz[k], sigmas[k]

    def _pairs(self):
        """A camera in the frame of the master, from what both are in the world: shift and turn."""
        for camera, master, other in self.net.pairs:
            back = np.swapaxes(self.turn("image", master), 1, 2)
            shift = np.einsum("mij,mj->mi", back, self.centre(other) - self.centre(master))
            place = self.turn("place", f"place {camera}")
            turn = np.swapaxes(place, 1, 2) @ back @ self.turn("image", other)
            cosine = np.sqrt(1 + turn[:, 0, 0] + turn[:, 1, 1] + turn[:, 2, 2])
            for k in range(3):
                yield (
                    shift[:, k] - self.rows[:, self.unknowns.at["place", camera]][:, k],
                    self.net.rig_sigmas[0],
                )
            for k in range(3):
                i, j = (k + 1) % 3, (k + 2) % 3
                yield (turn[:, j, i] - turn[:, i, j]) / cosine, self.net.rig_sigmas[1]

    def _inclinations(self):
        of = {item.name: item for item in self.net.clinometers}
        for name, image, reading, sigma in self.net.inclinations:
            along = np.einsum("mij,mj->mi", self.turn("image", image), self.axis(name))
            sine, item = np.sin(reading), of[name]
            correction = sum(
                (self.own("correction", name, k) if k in item.free else item.correction[k]) * sine**k
                for k in range(4)
            )
            yield along[:, 2] - correction, sigma * np.cos(reading)

    def _priors(self):
        for camera, parameter, value, sigma in self.net.priors:
            yield self.own("camera", camera, parameter) - value, sigma


def projected(local, parameters):
    """Columns and lines (m, n) of points (m, n, 3) in the frame of a camera: MMVII's, degree (3, 1, 1)."""
    f, px, py, k1, k2, k3, p1, p2, b1, b2 = parameters
    x, y = local[..., 0] / local[..., 2], local[..., 1] / local[..., 2]
    s = x * x + y * y
    radial = s * (k1 + s * (k2 + s * k3))
    dx = x * radial + p1 * (3 * x * x + y * y) + p2 * 2 * x * y + b1 * x + b2 * y
    dy = y * radial + p1 * 2 * x * y + p2 * (x * x + 3 * y * y)
    return px + f * (x + dx), py + f * (y + dy)
