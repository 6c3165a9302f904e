"""Images of targets as cameras take them, and where targets are in them: perspective, distortion, noise."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.targets.drawing.drawings import figure_of, inked_bits
from obseq.targets.drawing.legend import legend_places
from obseq.targets.drawing.painting import paint_places
from obseq.targets.drawing.rendering import lattice
from obseq.targets.specification import extent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import Array, FloatArray, FloatRows
    from obseq.geometry import RigidMotion
    from obseq.images import Camera
    from obseq.targets.specification import Specification

FEW, MANY = (21, 13), (233, 144)
"""Places in a pixel that are looked at, lattices in which each has its own column and line: everywhere, and
where an edge is. With 64 there, centres would be wrong by 0.002 pixels, half of what noise makes of them."""
TRIALS = 200
"""Times a place is looked for where a sheet overlaps no other."""
APART = 1.05
"""Least distance of two sheets, over the sum of the radii around them."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """A sheet in space.

    Attributes:
        spec: the set.
        name: of the target.
        centre: (3,) of its figure.
        right: (3,) the vector of a unit to the right on the sheet.
        down: (3,) and down.
        white: grey level of white paper.
        black: of black ink.
        hidden: share of it that a bar of middle grey hides, from its left side on, through the middle.
    """

    spec: Specification
    name: str
    centre: FloatArray
    right: FloatArray
    down: FloatArray
    white: float = 190.0
    black: float = 40.0
    hidden: float = 0.0


@dataclass(frozen=True)
class Conditions:
    """What stands between a scene and its image.

    Attributes:
        blur: sigma of the point spread, pixels.
        noise: standard deviation of a pixel, grey levels.
        ramp: change of the light across the image, in parts of it.
        motion: vertical blur of a movement, pixels.
        background: grey level around the sheets.
        deep: 16 bits: grey levels are multiplied by 257.
        seed: of the noise.
    """

    blur: float = 0.9
    noise: float = 3.0
    ramp: float = 0.15
    motion: float = 0.0
    background: float = 110.0
    deep: bool = False
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Truth:
    """What is seen of a sheet.

    Attributes:
        name: of the target.
        family: of its set.
        centre: (2,) image of its centre, pixels.
        size: pixels across its code, seen from the front; the height of sheets with rows.
        tilt: between its normal and the ray, radians.
        hidden: share of it that is hidden.
    """

    name: str
    family: str
    centre: FloatArray
    size: float
    tilt: float
    hidden: float


def photograph(
    camera: Camera,
    sheets: Sequence[Sheet],
    conditions: Conditions | None = None,
    pose: RigidMotion | None = None,
    scenery: Array | None = None,
) -> tuple[Array, list[Truth]]:
    """The image that a camera takes of sheets, and where their centres are in it.

    Args:
        camera: pixel centres are at whole numbers.
        sheets: in the world.
        conditions: of the photograph.
        pose: of the camera: `X_world = centre + rotation x_camera`; the world is its frame by default.
        scenery: (height, width) what is behind the sheets, grey levels.

    Returns:
        (height, width) uint8 or uint16, and what is seen of each sheet.

    Raises:
        InputError: the camera has no size, or a sheet is behind it or outside its image.
    """
    seen = conditions or Conditions()
    if not camera.width:
        raise InputError(f"camera {camera.name}: an image cannot be simulated without its size")
    light = np.full((camera.height, camera.width), seen.background)
    if scenery is not None:
        light[:] = scenery
    truths = [_expose(light, camera, _moved(sheet, pose)) for sheet in sheets]
    return _developed(light, seen), truths


def _moved(sheet: Sheet, pose: RigidMotion | None) -> Sheet:
    """The same in the frame of the camera."""
    if pose is None:
        return sheet
    turn = pose.rotation.T
    centre = turn @ (sheet.centre - pose.centre)
    return Sheet(
        sheet.spec,
        sheet.name,
        centre,
        turn @ sheet.right,
        turn @ sheet.down,
        sheet.white,
        sheet.black,
        sheet.hidden,
    )


def _expose(light: Array, camera: Camera, sheet: Sheet) -> Truth:
    """Draws a sheet into the image."""
    left, right, top, bottom = sheet.spec.geometry.sheet
    ways = np.linspace(0.0, 1.0, 12)
    x, y = left + (right - left) * ways, top + (bottom - top) * ways
    edge = np.vstack(
        [np.column_stack((x, np.full(12, side))) for side in (top, bottom)]
        + [np.column_stack((np.full(12, side), y)) for side in (left, right)]
    )
    axes = np.column_stack((sheet.right, sheet.down))
    places = sheet.centre + edge @ axes.T
    if places[:, 2].min() <= 0.0:
        raise InputError(f"target {sheet.name}: its sheet is not in front of the camera")
    pixels = camera.project(places)
    x0, y0 = np.maximum(np.floor(pixels.min(axis=0)).astype(int) - 1, 0)
    x1 = min(int(pixels[:, 0].max()) + 2, camera.width)
    y1 = min(int(pixels[:, 1].max()) + 2, camera.height)
    if x1 <= x0 or y1 <= y0:
        raise InputError(f"target {sheet.name}: its sheet is outside the image")
    _shade(light[y0:y1, x0:x1], camera, sheet, np.array([x0, y0]), np.column_stack((axes, sheet.centre)))
    return _truth(camera, sheet, axes)


def _shade(part: Array, camera: Camera, sheet: Sheet, corner: Array, frame: FloatRows) -> None:
    """The same in the part of the image where it is; `frame` (3, 3) has its axes and centre as columns."""
    from scipy.ndimage import maximum_filter, minimum_filter

    height, width = part.shape
    columns, lines = np.meshgrid(np.arange(width + 1), np.arange(height + 1))
    pixels = np.column_stack((columns.ravel(), lines.ravel())) + corner - 0.5
    rays = camera.directions(pixels)
    rays = (rays / rays[:, 2:] @ np.linalg.inv(frame).T).reshape(height + 1, width + 1, 3)
    around = np.stack([rays[:-1, :-1], rays[:-1, 1:], rays[1:, :-1], rays[1:, 1:]], axis=2)
    share, paper = _seen(around, sheet, FEW)
    both = share * 1e6 + paper
    is_edge = maximum_filter(both, 3) != minimum_filter(both, 3)
    share[is_edge], paper[is_edge] = _seen(around[is_edge], sheet, MANY)
    part[:] = (1.0 - share) * part + paper


def _seen(rays: Array, sheet: Sheet, sizes: tuple[int, int]) -> tuple[Array, Array]:
    """The share of each pixel that a sheet covers, and its grey levels times that.

    Args:
        rays: (..., 4, 3) of the corners of the pixels, in the frame of the sheet.
        sheet: what is seen.
        sizes: number of the places in a pixel that are looked at, and the generator of their lattice.
    """
    x, y = lattice(*sizes).T + 0.5
    within = np.column_stack(((1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y))
    meets = (within @ rays.reshape(-1, 4, 3)).reshape(-1, 3)
    depth = np.where(meets[:, 2] > 0.0, meets[:, 2], np.nan)
    places = np.ascontiguousarray(meets[:, :2] / depth[:, None])
    left, right, top, bottom = sheet.spec.geometry.sheet
    u, v = places.T
    inside = (u >= left) & (u <= right) & (v >= top) & (v <= bottom)
    grey = np.zeros(len(places))
    code = inked_bits(sheet.spec, sheet.spec.codes.get(sheet.name, 0))
    boxes = legend_places(sheet.spec, sheet.name)
    paint_places(figure_of(sheet.spec), sheet.spec.bits, code, boxes, np.nan_to_num(places, nan=1e6), grey)
    white = 1.0 - grey if sheet.spec.geometry.is_white else grey
    grey = sheet.black + (sheet.white - sheet.black) * white
    if sheet.hidden:
        limit = left + sheet.hidden * (right - left)
        grey = np.where(u + 0.5 * v < limit, 0.6 * sheet.black + 0.4 * sheet.white, grey)
    shape = (*rays.shape[:-2], sizes[0])
    return inside.reshape(shape).mean(axis=-1), np.where(inside, grey, 0.0).reshape(shape).mean(axis=-1)


def _truth(camera: Camera, sheet: Sheet, axes: FloatRows) -> Truth:
    centre = camera.project(sheet.centre[None])[0]
    normal = np.cross(axes[:, 0], axes[:, 1])
    ray = sheet.centre / np.linalg.norm(sheet.centre)
    tilt = math.acos(min(1.0, abs(float(normal @ ray)) / float(np.linalg.norm(normal))))
    unit = camera.focal * float(np.linalg.norm(sheet.right) / np.linalg.norm(sheet.centre))
    return Truth(sheet.name, sheet.spec.family, centre, unit * extent(sheet.spec), tilt, sheet.hidden)


def _developed(light: Array, seen: Conditions) -> Array:
    from scipy.ndimage import gaussian_filter, uniform_filter1d

    width = light.shape[1]
    if seen.ramp:
        light = light * (1.0 + seen.ramp * (np.arange(width) / width - 0.5))
    if seen.blur:
        light = gaussian_filter(light, seen.blur)
    if seen.motion:
        light = uniform_filter1d(light, max(1, round(seen.motion)), axis=0)
    random = np.random.default_rng(seen.seed)
    grey = light + random.normal(0.0, seen.noise, light.shape) if seen.noise else light
    scale, most, kind = (257.0, 65535, np.uint16) if seen.deep else (1.0, 255, np.uint8)
    return np.clip(np.round(grey * scale), 0, most).astype(kind)


@dataclass(frozen=True)
class Scene:
    """Sheets at random.

    Attributes:
        count: how many.
        sizes: least and greatest size, pixels.
        tilts: least and greatest tilt, degrees.
        contrast: between paper and ink, grey levels; twice half of it around the middle.
        hidden: share of the sheets of which a part is hidden.
        seed: of all that is by chance.
    """

    count: int = 20
    sizes: tuple[float, float] = (40.0, 110.0)
    tilts: tuple[float, float] = (0.0, 45.0)
    contrast: tuple[float, float] = (100.0, 180.0)
    hidden: float = 0.0
    seed: int = 0


def random_sheets(
    camera: Camera, specs: Sequence[Specification], scene: Scene, names: Sequence[str] = ()
) -> list[Sheet]:
    """Sheets at random in front of a camera; none overlaps another, each name comes once.

    Args:
        camera: that will see them.
        specs: their sets.
        scene: how many, and how they lie.
        names: of these targets only.

    Returns:
        As many as find a place; fewer than asked for where the image is full.
    """
    random = np.random.default_rng(scene.seed)
    known = [(spec, name) for spec in specs for name in spec.codes if not names or name in names]
    order = random.permutation(len(known))[: scene.count]
    found: list[Sheet] = []
    taken: list[tuple[float, float, float]] = []
    for k in order.tolist():
        spec, name = known[k]
        for _ in range(TRIALS):
            sheet, around = _random_sheet(camera, spec, name, scene, random)
            if around is not None and _is_free(around, taken, camera):
                found.append(sheet)
                taken.append(around)
                break
    return found


def _random_sheet(
    camera: Camera, spec: Specification, name: str, scene: Scene, random: np.random.Generator
) -> tuple[Sheet, tuple[float, float, float] | None]:
    """A sheet, and the circle around it in the image: None where that cannot be seen."""
    size = random.uniform(*scene.sizes)
    pixel = random.uniform([0.0, 0.0], [camera.width, camera.height])
    ray = camera.directions(pixel[None])[0]
    tilt, way, turn = math.radians(random.uniform(*scene.tilts)), *random.uniform(0.0, 2.0 * math.pi, 2)
    unit = size / extent(spec) / camera.focal
    axes = _axes(ray, tilt, way, turn)
    contrast, middle = random.uniform(*scene.contrast), random.uniform(105.0, 125.0)
    hidden = random.uniform(0.2, 0.45) if random.uniform() < scene.hidden else 0.0
    sheet = Sheet(
        spec,
        name,
        ray,
        unit * axes[:, 0],
        unit * axes[:, 1],
        middle + 0.5 * contrast,
        middle - 0.5 * contrast,
        hidden,
    )
    if not np.isfinite(ray).all():
        return sheet, None
    left, right, top, bottom = spec.geometry.sheet
    corner = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    places = ray + unit * corner @ axes[:, :2].T
    pixels = camera.project(places)
    radius = float(np.hypot(*(pixels - pixel).T).max())
    return sheet, (float(pixel[0]), float(pixel[1]), radius)


def _axes(ray: FloatArray, tilt: float, way: float, turn: float) -> FloatRows:
    """(3, 3) right, down and away of a sheet that is tilted against a ray, turned in itself at last."""
    right = np.cross([0.0, 1.0, 0.0], ray)
    right /= np.linalg.norm(right)
    base = np.column_stack((right, np.cross(ray, right), ray))

    def about_ray(angle: float) -> FloatRows:
        c, s = math.cos(angle), math.sin(angle)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    c, s = math.cos(tilt), math.sin(tilt)
    found: FloatRows = (
        base @ about_ray(way) @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ about_ray(turn - way)
    )
    return found


def _is_free(
    around: tuple[float, float, float], taken: Sequence[tuple[float, float, float]], camera: Camera
) -> bool:
    x, y, radius = around
    room = radius + 6.0
    if not (room < x < camera.width - 1 - room and room < y < camera.height - 1 - room):
        return False
    return all(math.hypot(x - u, y - v) > APART * (radius + other) for u, v, other in taken)
