"""Other observations of a block in tables: lengths between points, and positions of images.

| table | columns |
|---|---|
| lengths | `from to length sigma` |
| positions | `image x y z`, and `sigma` or `sx sy sz`; an empty sigma is not observed |

A table of positions may have more: `omega phi kappa` (degrees) of an inertial unit, and, where a shutter
rolls, velocities `vx vy vz` (metres per second), or `time` (seconds), from which they come.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError, naming
from obseq.formats.blocks.ground import covariances_in_frame, frame_for, turned_to_frame
from obseq.formats.blocks.reading import note_count
from obseq.geometry import rotations_from
from obseq.images.block import Block
from obseq.images.names import are_among
from obseq.images.poses import Poses
from obseq.images.references import velocities_of
from obseq.reading.tables import Table

ANGLES = ("omega", "phi", "kappa")
VELOCITY = ("vx", "vy", "vz")


@dataclass(frozen=True)
class Carried:
    """How what the positions are of is carried by the camera.

    Attributes:
        lever_arm: from the projection centre to the antenna, in the camera frame; None for none.
        lever_sigma: of it: 0 holds it, infinity leaves it unknown.
        angle_sigma: radians, of the angles of an inertial unit; None leaves these out.
        readout: seconds, of shutters that roll; None for those that do not.
        readout_sigma: of it: 0 holds it, infinity leaves it unknown.
        system: of the positions; empty for the frame of the block.
        frame: that is wanted; None for that of the block, or one at their mean.
    """

    lever_arm: tuple[float, float, float] | None = None
    lever_sigma: float = np.inf
    angle_sigma: float | None = None
    readout: float | None = None
    readout_sigma: float = np.inf
    system: str = ""
    frame: str | None = None


AS_THEY_ARE = Carried()


def carry_antennas(block: Block, carried: Carried) -> None:
    """Gives the antennas that the files of a block have a lever arm, and says so.

    Raises:
        InputError: There is none to which it could belong.
    """
    if not block.antennas:
        raise InputError("a lever arm is that of observed positions: the files have none (--positions)")
    given, block.antennas = block.antennas, []
    for one in given:
        block.observe_antenna(
            one.images,
            one.positions,
            one.sigmas,
            carried.lever_arm or (0.0, 0.0, 0.0),
            carried.lever_sigma,
            one.name,
        )
    arm = " ".join(f"{part:g}" for part in carried.lever_arm or ())
    how = {0.0: "held", np.inf: "unknown"}.get(carried.lever_sigma, f"known to {carried.lever_sigma:g}")
    block.notes.append(f"the positions of the files have the lever arm {arm} ({how}), as asked for")


def add_lengths(block: Block, path: str | Path) -> None:
    """Adds the lengths of a table to a block, scale bars for instance.

    Raises:
        InputError: a column is missing, a length or a sigma is not above zero; file and line are named.
    """
    table = Table.read(path)
    table.allow(("from", "to", "length", "sigma"))
    table.require("from", "to", "length", "sigma")
    values = np.column_stack([table.numbers("length"), table.numbers("sigma")]).tolist()
    ends = zip(table.texts("from"), table.texts("to"), strict=True)
    for row, ((first, second), (length, sigma)) in enumerate(zip(ends, values, strict=True)):
        with naming(table.place(row)):
            block.add_length(first, second, length, sigma)


def observe_positions(block: Block, path: str | Path, carried: Carried = AS_THEY_ARE) -> None:
    """Adds observed positions, of a satellite receiver for instance.

    Raises:
        InputError: a column is missing, an image is not known, a sigma is not above zero.
    """
    table = Table.read(path)
    table.allow(("image", "x", "y", "z", "sigma", "sx", "sy", "sz", "time", *ANGLES, *VELOCITY))
    table.require("image", "x", "y", "z")
    columns = ("sigma",) * 3 if "sigma" in table else ("sx", "sy", "sz")
    table.require(*columns)
    images = table.texts("image")
    places = np.column_stack([table.numbers(name) for name in "xyz"])
    sigmas = np.column_stack([table.numbers(name, np.inf) for name in columns])
    turns = _turns(table)
    velocities = _velocities(table, images, places, carried)
    if carried.system:
        block.frame = frame_for(block, carried.system, places, carried.frame)
        turns = turned_to_frame(turns, places, carried.system, block.frame)
        axes = turned_to_frame(_eye(places), places, carried.system, block.frame)
        velocities = np.einsum("nij,nj->ni", axes, velocities)
        places, sigmas = _in_frame(table, places, sigmas, carried.system, block.frame)
    with table.located():
        if carried.lever_arm is None:
            block.observe_poses(Poses.of(images, places, _eye(places)), sigmas)
        else:
            _observe_antenna(block, images, places, sigmas, carried)
    measured = _measured(block, images)
    if carried.angle_sigma is not None:
        table.require(*ANGLES)
        kept = [image for image, is_measured in zip(images, measured.tolist(), strict=True) if is_measured]
        block.observe_poses(Poses.of(kept, places[measured], turns[measured]), np.inf, carried.angle_sigma)
    if carried.readout is not None:
        _roll(block, images, velocities, carried)


def _eye(places: FloatArray) -> FloatArray:
    return np.array(np.broadcast_to(np.eye(3), (len(places), 3, 3)))


def _turns(table: Table) -> FloatArray:
    """(n, 3, 3) rotations of the angles of a table, from camera to world; the identity where it has none."""
    if not set(ANGLES) <= set(table.columns):
        return np.array(np.broadcast_to(np.eye(3), (len(table), 3, 3)))
    return rotations_from(np.radians(np.column_stack([table.numbers(name) for name in ANGLES])), "opk")


def _velocities(table: Table, images: list[str], places: FloatArray, carried: Carried) -> FloatArray:
    """(n, 3) velocities along the axes of the positions; zero where no shutter rolls."""
    if carried.readout is None:
        return np.zeros_like(places)
    if set(VELOCITY) <= set(table.columns):
        return np.column_stack([table.numbers(name) for name in VELOCITY])
    if "time" not in table:
        raise InputError(
            f"{table.path}: a rolling shutter takes the velocities of its images: columns vx vy vz, or time "
            "(seconds), from which they come"
        )
    with table.located():
        return velocities_of(images, places, table.numbers("time"))


def _in_frame(
    table: Table, places: FloatArray, sigmas: FloatArray, system: str, frame: str
) -> tuple[FloatArray, FloatArray]:
    """Positions in the frame, and sigmas along its axes."""
    covariances = np.zeros((len(places), 3, 3))
    covariances[:, range(3), range(3)] = sigmas**2
    moved, turned = covariances_in_frame(tuple(table.texts("image")), places, covariances, system, frame)
    return moved, np.sqrt(np.diagonal(turned, axis1=1, axis2=2))


def _measured(block: Block, images: list[str]) -> BoolArray:
    return are_among(images, {name for part in block.sets for name in part.measures.image_names})


def _observe_antenna(
    block: Block, images: list[str], places: FloatArray, sigmas: FloatArray, carried: Carried
) -> None:
    """Adds an antenna; positions of images that nothing was measured in are told."""
    idle = [image for image in images if image not in block.camera_of]
    note_count(block, idle, "positions are of images that the block does not have")
    kept = are_among(images, block.camera_of)
    names = [image for image in images if image in block.camera_of]
    lever, sigma = carried.lever_arm, carried.lever_sigma
    block.observe_antenna(names, places[kept], sigmas[kept], lever or (0.0, 0.0, 0.0), sigma)


def _roll(block: Block, images: list[str], velocities: FloatArray, carried: Carried) -> None:
    """Lets the shutters of all cameras with a velocity roll."""
    assert carried.readout is not None
    rows: dict[str, list[int]] = {}
    for row, image in enumerate(images):
        if image in block.camera_of:
            rows.setdefault(block.camera_of[image], []).append(row)
    for camera, own in rows.items():
        names = [images[row] for row in own]
        block.roll_shutter(camera, names, velocities[own], carried.readout, carried.readout_sigma)
