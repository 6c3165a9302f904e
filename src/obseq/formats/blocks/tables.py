"""A block in four tables: cameras, images with or without poses, control points, image measures.

| table | columns |
|---|---|
| cameras | `name width height focal [ppx ppy projection radial decentric general K1 ... b2 backward]` |
| images | `image camera`, and for poses `x y z` with the angles of one form (degrees) or a quaternion |
| control | `point x y z`, and `sigma` or `sx sy sz`: 0 is held, an empty field free |
| measures | `image point x y`, and `sigma` or `sx sy` (pixels) |

`backward` is 1 for a distortion that corrects the measured points (DBAT's), 0 else.
Angles: `omega phi kappa` (photogrammetric), `w p k` (MMVII), `yaw pitch roll`, or `qw qx qy qz`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError, naming
from obseq.images.block import Block
from obseq.images.camera import Camera
from obseq.images.control import ControlPoints
from obseq.images.measures import ImagePoints
from obseq.images.names import unique_names
from obseq.images.output.clouds import CAMERA_COLUMNS
from obseq.images.parts import Weighting
from obseq.images.poses import Poses
from obseq.kernels import formula_names
from obseq.reading.tables import Table

ANGLES = {
    "opk": ("omega", "phi", "kappa"),
    "wpk": ("w", "p", "k"),
    "ypr": ("yaw", "pitch", "roll"),
    "quaternion": ("qw", "qx", "qy", "qz"),
}
DEGREE = re.compile(r"EqDist_Dist_Rad(\d+)_Dec(\d+)_XY(\d+)")


def read_cameras(path: str | Path) -> list[Camera]:
    """Cameras from a table.

    Raises:
        InputError: a column is missing, a field is wrong; file and line are named.
    """
    return _cameras(Table.read(path))


def add_cameras(block: Block, path: str | Path) -> None:
    """Adds the cameras of a table to a block; see `read_cameras`."""
    table = Table.read(path)
    for row, camera in enumerate(_cameras(table)):
        with naming(table.place(row)):
            block.add_cameras(camera)


def _cameras(table: Table) -> list[Camera]:
    table.require("name", "width", "height", "focal")
    coefficients = [column for column in table.columns if column not in CAMERA_COLUMNS]
    degrees = _degrees(table, coefficients)
    numbers = {name: table.numbers(name) for name in ("width", "height", "focal")}
    middle = [table.numbers(name, np.nan) for name in ("ppx", "ppy")]
    values = {column: table.numbers(column, 0.0) for column in coefficients}
    backward = _flags(table, "backward")
    projections = table.texts("projection") if "projection" in table else [""] * len(table)
    found = []
    for row, name in enumerate(table.texts("name")):
        given = {_spelt(column): float(values[column][row]) for column in coefficients if values[column][row]}
        with naming(table.place(row)):
            found.append(
                Camera(
                    name,
                    int(numbers["width"][row]),
                    int(numbers["height"][row]),
                    float(numbers["focal"][row]),
                    np.array([middle[0][row], middle[1][row]]),
                    degrees[row],
                    given,
                    projections[row] or "Stenope",
                    backward=backward[row],
                )
            )
    return found


def _flags(table: Table, column: str) -> list[bool]:
    """A column of 0 and 1; 0 where it is empty or absent."""
    values = table.numbers(column, 0.0)
    for row, value in enumerate(values):
        if value not in (0.0, 1.0):
            raise InputError(f"{table.place(row)}: {column} is 0 or 1, not {value:g}")
    return [bool(value) for value in values]


def _spelt(column: str) -> str:
    """`K1` for `k1`: the radial coefficients are in capitals."""
    return column.upper() if column.startswith("k") else column


def _degrees(table: Table, coefficients: Sequence[str]) -> list[tuple[int, int, int]]:
    """Degrees as the table gives them, or small ones that have its coefficients."""
    named = ("radial", "decentric", "general")
    if any(name in table for name in named):
        columns = [table.numbers(name, 0.0).astype(int) for name in named]
        return [(int(a), int(b), int(c)) for a, b, c in zip(*columns, strict=True)]
    numbers = [int(name[1:]) for name in coefficients if name[:1] == "k" and name[1:].isdigit()]
    pairs = [int(name[1:]) for name in coefficients if name[:1] == "p" and name[1:].isdigit()]
    general = 1 if {"b1", "b2"} & set(coefficients) else 0
    radial, decentric = max(numbers, default=0), (max(pairs, default=0) + 1) // 2
    return [_generated(radial, decentric, general) if coefficients else (3, 1, 1)] * len(table)


def _generated(*least: int) -> tuple[int, int, int]:
    """The smallest degrees of the catalogue that reach some; these themselves where none does."""
    found = (DEGREE.fullmatch(name) for name in formula_names())
    degrees = [(int(match[1]), int(match[2]), int(match[3])) for match in found if match]
    enough = [degree for degree in degrees if all(a >= b for a, b in zip(degree, least, strict=True))]
    return min(enough, key=sum, default=(least[0], least[1], least[2]))


def read_images(path: str | Path) -> tuple[dict[str, str], Poses]:
    """Camera of each image (empty where the table has none), and the poses of those that have one.

    Raises:
        InputError: a column is missing, an image comes twice, a field is wrong; file and line are named.
    """
    return _images(Table.read(path))


def _images(table: Table) -> tuple[dict[str, str], Poses]:
    known = ("image", "camera", "x", "y", "z", *(name for names in ANGLES.values() for name in names))
    table.allow(known)
    table.require("image")
    images = table.texts("image")
    with table.located():
        unique_names(images, "image")
    cameras = table.texts("camera") if "camera" in table else [""] * len(images)
    form = next((form for form, names in ANGLES.items() if names[0] in table), None)
    if form is None:
        return dict(zip(images, cameras, strict=True)), Poses.of([], np.zeros((0, 3)), np.zeros((0, 3, 3)))
    table.require("x", "y", "z", *ANGLES[form])
    rows = [row for row, field in enumerate(table.texts("x")) if field]
    chosen = Table(
        table.path,
        table.columns,
        tuple(table.rows[row] for row in rows),
        tuple(table.lines[row] for row in rows),
    )
    centres = np.column_stack([chosen.numbers(name) for name in "xyz"])
    turns = np.column_stack([chosen.numbers(name) for name in ANGLES[form]])
    values = turns if form == "quaternion" else np.radians(turns)
    with table.located(rows):
        poses = Poses.of([images[row] for row in rows], centres, values, form, [cameras[row] for row in rows])
    return dict(zip(images, cameras, strict=True)), poses


def read_control(path: str | Path, sigma: float | None = None) -> ControlPoints:
    """Control points from a table; `sigma` is for those whose row gives none.

    Raises:
        InputError: neither the table nor the caller gives a sigma.
    """
    return _control(Table.read(path), sigma)


def add_control(block: Block, path: str | Path, sigma: float | None = None) -> None:
    """Adds the control points of a table to a block; see `read_control`."""
    control, table = control_table(path, sigma)
    with table.located():
        block.add_control_points(control, table.origin)


def control_table(path: str | Path, sigma: float | None = None) -> tuple[ControlPoints, Table]:
    """Control points, and the table that they are in; see `read_control`."""
    table = Table.read(path)
    return _control(table, sigma), table


def _control(table: Table, sigma: float | None) -> ControlPoints:
    table.allow(("point", "x", "y", "z", "sigma", "sx", "sy", "sz", "rays"))  # rays: of adjusted points
    table.require("point", "x", "y", "z")
    coordinates = np.column_stack([table.numbers(name) for name in "xyz"])
    if "sigma" in table:
        sigmas = np.column_stack([table.numbers("sigma", np.inf)] * 3)
    elif "sx" in table:
        table.require("sx", "sy", "sz")
        sigmas = np.column_stack([table.numbers(name, np.inf) for name in ("sx", "sy", "sz")])
    elif sigma is None:
        raise InputError(
            f"{table.path}: no column says how well the points are known; add sigma (0 holds a point), or "
            "give one for all of them (--control-sigma)"
        )
    else:
        sigmas = np.full((len(table), 3), sigma)
    with table.located():
        return ControlPoints.of(table.texts("point"), coordinates, sigmas)


def read_measures(path: str | Path, sigma: float | None = None) -> ImagePoints:
    """Image measures from a table; `sigma` (pixels) is for a table that gives none.

    Raises:
        InputError: neither the table nor the caller gives a sigma.
    """
    return _measures(Table.read(path), sigma)


def add_measures(
    block: Block, path: str | Path, sigma: float | None = None, weighting: Weighting | None = None
) -> None:
    """Adds the image measures of a table to a block; a weighting goes before their sigmas."""
    table = Table.read(path)
    measures = _measures(table, sigma)
    with table.located():
        block.add_measures(measures, weighting, Path(path).name, origin=table.origin)


def _measures(table: Table, sigma: float | None) -> ImagePoints:
    table.allow(("image", "point", "x", "y", "sigma", "sx", "sy", "sxy"))
    table.require("image", "point", "x", "y")
    xy = np.column_stack([table.numbers(name) for name in "xy"])
    sigmas: FloatArray
    if "sxy" in table:
        table.require("sx", "sy")
    if "sigma" in table:
        sigmas = table.numbers("sigma")
    elif "sx" in table:
        sigmas = np.column_stack([table.numbers("sx"), table.numbers("sy")])
    elif sigma is None:
        raise InputError(
            f"{table.path}: no column says how good the measures are; add sigma, or give one for all "
            "(--image-sigma)"
        )
    else:
        sigmas = np.full(len(table), sigma)
    with table.located():
        covariances = table.numbers("sxy") if "sxy" in table else 0.0
        return ImagePoints.of(table.texts("image"), table.texts("point"), xy, sigmas, covariances)


@dataclass(frozen=True)
class BlockFiles:
    """Where the tables of a block are.

    Attributes:
        cameras: table of cameras.
        images: table of images.
        measures: tables of measures.
        control: tables of control points.
        image_sigma: for measures without sigma, pixels.
        control_sigma: for control points without sigma.
    """

    cameras: Path
    images: Path
    measures: Sequence[Path]
    control: Sequence[Path] = ()
    image_sigma: float | None = None
    control_sigma: float | None = None

    def fill(self, block: Block, weighting: Weighting | None = None) -> None:
        """Puts everything in a block; a weighting goes before the sigmas of the measures."""
        add_cameras(block, self.cameras)
        add_images(block, self.images)
        for path in self.control:
            add_control(block, path, self.control_sigma)
        for path in self.measures:
            add_measures(block, path, self.image_sigma, weighting)


def add_images(block: Block, path: str | Path) -> None:
    """Adds the images of a table to a block, with the poses of those that have one."""
    table = Table.read(path)
    camera_of, poses = _images(table)
    only = next(iter(block.cameras)) if len(block.cameras) == 1 else ""
    for row, (image, camera) in enumerate(camera_of.items()):
        with naming(table.place(row)):
            block.add_images([image], camera or only)
    with table.located():
        block.add_poses(poses)
