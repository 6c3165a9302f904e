"""Random blocks of images with planted mistakes, and one block of which each image point is displaced.

Four to eleven images look at a cloud of points 2 to 400 m wide; half of the blocks have poses. Residuals of
image points are of 0.4 pixels, those of control points of a 4000th of the cloud.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from diagnosis_verdicts import Fault, Line

from obseq.geometry import RigidMotion, attitudes, exponential
from obseq.images import Camera

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

Random = np.random.Generator

SIGMA = 0.4
"""Pixels."""
LEAST_RAYS, LEAST_OF_KNOWN = 4, 3
"""Rays of a free point and of a control point of which one may be wrong: the others tell which."""
UNITS = 1e-3, 1e3, 100.0, 1.0 / 0.3048
"""What control points in kilometres, millimetres, centimetres and feet are multiplied by."""


@dataclass(frozen=True)
class Measured:
    """An image point as it is written."""

    image: int
    point: int
    x: float
    y: float


@dataclass(frozen=True)
class Block:
    """A block as its tables have it.

    Attributes:
        cameras: of the block.
        camera_of: number of the camera of each image.
        poses: of the images, as they are given; None where they are not.
        control: (n, 3) coordinates of points; NaN for those that are not known.
        sigma: of known coordinates, as it is written.
        measures: in the order of their file.
        images: names of the images, in the order of the poses.
    """

    cameras: tuple[Camera, ...]
    camera_of: tuple[int, ...]
    poses: RigidMotion | None
    control: FloatArray
    sigma: float
    measures: tuple[Measured, ...]
    images: tuple[str, ...]

    def texts(self) -> dict[str, str]:
        """The tables."""
        return {
            "cameras.csv": "name,width,height,focal,K1,K2\n"
            + "".join(f"{c.name},{c.width},{c.height},{c.focal!r},0,0\n" for c in self.cameras),
            "images.csv": self._images(),
            "control.csv": "point,x,y,z,sigma\n"
            + "".join(f"P{k},{_listed(self.control[k])},{self.sigma:g}\n" for k in self.known),
            "measures.csv": "image,point,x,y\n"
            + "".join(f"I{m.image},P{m.point},{m.x:.3f},{m.y:.3f}\n" for m in self.measures),
        }

    def _images(self) -> str:
        head = "image,camera" + ("" if self.poses is None else ",x,y,z,omega,phi,kappa")
        rows = [f"{name},{self.cameras[k].name}" for name, k in zip(self.images, self.camera_of, strict=True)]
        if self.poses is not None:
            angles = np.degrees(attitudes(self.poses.rotation, "opk"))
            given = np.hstack([self.poses.centre, angles]).tolist()
            rows = [f"{row},{_listed(pose)}" for row, pose in zip(rows, given, strict=True)]
        return "\n".join([head, *rows]) + "\n"

    @property
    def known(self) -> list[int]:
        """Numbers of the control points."""
        return np.flatnonzero(np.isfinite(self.control[:, 0])).tolist()

    def rays(self, point: int) -> int:
        """In how many images a point is."""
        return sum(m.point == point for m in self.measures)

    def controlled(self) -> list[int]:
        """Rows of measures of which the others tell that they are wrong."""
        known = set(self.known)
        least = {p: LEAST_OF_KNOWN if p in known else LEAST_RAYS for p in range(len(self.control))}
        return [row for row, m in enumerate(self.measures) if self.rays(m.point) >= least[m.point]]

    def place(self, row: int) -> Line:
        """File and line of a measure."""
        return "measures.csv", row + 2

    def is_inside(self, measured: Measured) -> bool:
        """Whether an image point lies in its image."""
        camera = self.cameras[self.camera_of[measured.image]]
        return bool(0.0 < measured.x < camera.width and 0.0 < measured.y < camera.height)

    def displaced(self, row: int, by: float, angle: float) -> Block | None:
        """With an image point elsewhere; None where that is not in the image: it is refused by name then."""
        old = self.measures[row]
        new = replace(old, x=old.x + by * float(np.cos(angle)), y=old.y + by * float(np.sin(angle)))
        if not self.is_inside(new):
            return None
        return replace(self, measures=(*self.measures[:row], new, *self.measures[row + 1 :]))


def _listed(row: FloatArray | list[float]) -> str:
    return ",".join(f"{value:.4f}" for value in row)


Planted = tuple[Block, tuple[Fault, ...]]


def block(random: Random, *, images: tuple[int, int] = (4, 12), has_poses: bool | None = None) -> Block:
    """A random block without error; with poses or not, or half of them."""
    n, n_points = int(random.integers(*images)), int(random.integers(20, 60))
    size = float(random.choice([2.0, 20.0, 200.0]) * random.uniform(1.0, 2.0))
    points = random.uniform(-1.0, 1.0, (n_points, 3)) * size * [1.0, 1.0, 0.25]
    cameras = tuple(_camera(f"cam{k}", random) for k in range(int(random.integers(1, 3))))
    camera_of = tuple(k % len(cameras) for k in range(n))
    around = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False) + random.uniform(0.0, 0.6, n)
    high = random.uniform(0.5, 1.3, n)
    sights = np.column_stack([np.cos(around) * np.cos(high), np.sin(around) * np.cos(high), np.sin(high)])
    centres = sights * size * random.uniform(2.4, 3.4, (n, 1))
    motion = RigidMotion(centres, _towards(centres, random))
    measures = tuple(
        measured
        for image in range(n)
        for measured in _seen(cameras[camera_of[image]], motion, image, points, random)
    )
    sigma = size / 4000.0
    control = np.full(points.shape, np.nan)
    chosen = random.choice(n_points, int(random.integers(6, 10)), replace=False)
    control[chosen] = points[chosen] + random.normal(0.0, sigma, (len(chosen), 3))
    given = bool(random.random() < 0.5) if has_poses is None else has_poses
    rough = RigidMotion(
        centres + random.normal(0.0, 0.01 * size, centres.shape),
        motion.rotation @ exponential(random.normal(0.0, 0.01, centres.shape)),
    )
    names = tuple(f"I{k}" for k in range(n))
    return Block(cameras, camera_of, rough if given else None, control, sigma, measures, names)


def _camera(name: str, random: Random) -> Camera:
    width, height = (int(side) for side in random.integers(2000, 4500, 2))
    return Camera(name, width, height, float(random.uniform(0.7, 1.0)) * max(width, height))


def _towards(centres: FloatArray, random: Random) -> FloatArray:
    """Rotations of cameras that look at the middle, turned about their axes as it comes."""
    z = -centres / np.linalg.norm(centres, axis=1, keepdims=True)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    turns = np.zeros(centres.shape)
    turns[:, 2] = random.uniform(-np.pi, np.pi, len(centres))
    return np.stack([x, np.cross(z, x), z], axis=2) @ exponential(turns)


def _seen(
    camera: Camera, motion: RigidMotion, image: int, points: FloatArray, random: Random
) -> list[Measured]:
    local = RigidMotion(motion.centre[image], motion.rotation[image]).to_local(points)
    xy = camera.project(local) + random.normal(0.0, SIGMA, (len(points), 2))
    inside = camera.sees(local) & ((xy > 0.0) & (xy < [camera.width, camera.height])).all(axis=1)
    kept = np.flatnonzero(inside & (random.random(len(points)) < 0.9))
    return [Measured(image, int(k), float(xy[k, 0]), float(xy[k, 1])) for k in kept]


# Mistakes


def image_points(given: Block, random: Random, count: int = 1) -> Planted | None:
    """Image points that are 5 to 1000 pixels off."""
    made: Block | None = given
    rows = random.choice(given.controlled(), count, replace=False).tolist()
    for row in rows:
        by, angle = 5.0 * 200.0 ** random.uniform(), random.uniform(0.0, 2.0 * np.pi)
        made = None if made is None else made.displaced(row, by, angle)
    return None if made is None else (made, tuple(Fault(frozenset({given.place(row)})) for row in rows))


def control_digit(given: Block, random: Random) -> Planted | None:
    """One digit of a control coordinate, 20 sigmas off or more."""
    points = [k for k in given.known if given.rays(k) >= LEAST_OF_KNOWN]
    if len(given.known) < 5 or not points:
        return None
    point, axis = int(random.choice(points)), int(random.integers(3))
    control = given.control.copy()
    value = abs(float(control[point, axis]))
    units = [unit for unit in (0.01, 0.1, 1.0, 10.0, 100.0) if 20.0 * given.sigma <= unit <= max(value, 1.0)]
    if not units:
        return None
    unit = float(random.choice(units))
    old = int(value / unit + 1e-9) % 10
    by = (int(random.choice([k for k in range(10) if k != old])) - old) * unit
    control[point, axis] += by * np.sign(control[point, axis])
    return replace(given, control=control), (Fault(points=frozenset({f"P{point} {'xyz'[axis]}"})),)


def two_errors(given: Block, random: Random) -> Planted | None:
    """Two image points, or an image point and a control coordinate."""
    if random.random() < 0.5:
        return image_points(given, random, 2)
    first = control_digit(given, random)
    second = None if first is None else image_points(first[0], random)
    return None if first is None or second is None else (second[0], (*first[1], *second[1]))


def exchanged_images(given: Block, random: Random) -> Planted | None:
    """Two images under each other's names in the measures, or in the table of poses."""
    first, second = (int(k) for k in random.choice(len(given.images), 2, replace=False))
    other = {first: second, second: first}
    fault = Fault(images=frozenset({given.images[first], given.images[second]}))
    if random.random() < 0.5 and given.poses is not None:
        order = [other.get(k, k) for k in range(len(given.images))]
        poses = RigidMotion(given.poses.centre[order], given.poses.rotation[order])
        return replace(given, poses=poses), (fault,)
    measures = tuple(replace(m, image=other.get(m.image, m.image)) for m in given.measures)
    made = replace(given, measures=measures)
    return (made, (fault,)) if all(map(made.is_inside, measures)) else None


def unit_of_control(given: Block, random: Random) -> Planted:
    """Control points in another unit than the poses; their sigmas as they were."""
    factor = float(random.choice(UNITS))
    return replace(given, control=given.control * factor), (Fault(codes=frozenset({"I150"})),)


def first_block() -> Block:
    """A block of four images, every point of which is displaced in turn."""
    return block(np.random.default_rng(4), images=(4, 5), has_poses=False)


def displaced(given: Block, random: Random) -> Planted | None:
    """An image point 10 to 1000 pixels off."""
    row = int(random.choice(given.controlled()))
    by, angle = (
        float(random.choice([10.0, 30.0, 100.0, 300.0, 600.0, 1000.0])),
        random.integers(4) * np.pi / 2.0,
    )
    made = given.displaced(row, by, float(angle))
    return None if made is None else (made, (Fault(frozenset({given.place(row)})),))


MISTAKES: dict[str, Callable[[Block, Random], Planted | None]] = {
    "image point": image_points,
    "control digit": control_digit,
    "two errors": two_errors,
    "exchanged images": exchanged_images,
    "unit of control": unit_of_control,
}
NEED_POSES = "exchanged images", "unit of control"
