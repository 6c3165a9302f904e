"""Clinometers as they were before blocks: the boresight of each on a camera (`ClinoInit`, `ClinoDirIn`).

A spring shows how far its y axis is below the horizon, a pendulum the direction of the vertical in its plane
of x and y. So a spring is a `Clinometer` whose axis is -y, and a pendulum a `Pendulum`. Two pendulums that
were found together (`RelCalib`) stay on one body: the original lets them turn by 40 degrees.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError, nearest
from obseq.geometry import RigidMotion, exponential, skew
from obseq.images import Clinometer, Pendulum
from obseq.project.instruments.blocks import read_clinometer_readings
from obseq.project.instruments.rigid_blocks import is_rotation, pose_tree
from obseq.project.tree import Reader, data_text, files_in, read_tree

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from obseq.arrays import FloatArray
    from obseq.images import BundleAdjustment, BundleSolution, Poses
    from obseq.project.instruments.blocks import ClinometerReadings
    from obseq.project.layout import ProjectTree
    from obseq.project.options.bundle_options import BoresightOptions
    from obseq.project.tree import Tree

FILE = "ClinoCalib-"
SPRING, PENDULUM = "Spring", "Pendulum"
KINDS = (SPRING, PENDULUM)
SECOND = "i-kj"
"""Axes of the second of two clinometers in the frame of the first, as the original has them."""
STEPS, SMALL, DAMPING = 50, 1e-13, 1e-3
"""Of Gauss-Newton: most steps, the last one (rad), and the damping that it begins with."""
LOOSE = 1e-6
"""Of the best determined turn of a boresight: what is determined worse is not determined."""


@dataclass(frozen=True, eq=False)
class Boresight:
    """A clinometer on a camera.

    Attributes:
        name: of it.
        kind: "Spring" or "Pendulum".
        rotation: (3, 3) from the frame of the camera to its own.
        camera: calibration that carries it.
        reference: clinometer to which it has a known turn; empty for none.
        relative: (3, 3) from that one's frame to its own.
    """

    name: str
    kind: str
    rotation: FloatArray
    camera: str
    reference: str = ""
    relative: FloatArray | None = None

    def text(self, *, as_json: bool = False) -> str:
        """Its file."""
        data: dict[str, Tree] = {
            "Type": self.kind,
            "NameClino": self.name,
            "Rotation": _axes(self.rotation),
            "NameCamera": self.camera,
        }
        if self.relative is not None:
            data["RelCalib"] = {"ClinoRef": self.reference, "Rotation": _axes(self.relative)}
        return data_text(data, as_json=as_json)

    @property
    def file(self) -> str:
        """The name of its file, without ending."""
        return f"{FILE}{self.name}-{self.camera}"


def _axes(rotation: FloatArray) -> Tree:
    whole = pose_tree(RigidMotion(np.zeros(3), rotation))
    assert isinstance(whole, dict)
    return whole["RotMatrix"]


def read_boresights(folder: Path) -> list[Boresight]:
    """The clinometers of a folder of `Clino`.

    Raises:
        InputError: with file and field; or it holds none.
    """
    found = [_read(path) for path in files_in(folder, FILE)]
    if not found:
        raise InputError(f"{folder}: holds no clinometers ({FILE}<clinometer>-<calibration>.xml; ClinoInit)")
    return found


def _read(path: Path) -> Boresight:
    fields = Reader(read_tree(path), str(path))
    kind = fields.text("Type")
    if kind not in KINDS:
        raise InputError(f"{path}: Type is {kind!r}, not one of {', '.join(KINDS)}")
    found = Boresight(fields.text("NameClino"), kind, _rotation(fields), fields.text("NameCamera"))
    if not fields.has("RelCalib"):
        return found
    other = fields.fields("RelCalib")
    return replace(found, reference=other.text("ClinoRef"), relative=_rotation(other))


def _rotation(fields: Reader) -> FloatArray:
    axes = fields.fields("Rotation")
    rotation = np.array([axes.numbers(f"Axe{letter}", 3) for letter in "IJK"], dtype=np.float64).T
    if not is_rotation(rotation):
        raise InputError(f"{axes.where} is no rotation: its axes are not orthonormal and right-handed")
    return rotation


def axes_of(text: str) -> FloatArray:
    """(3, 3) the rotation whose columns are axes, such as "i-kj".

    Raises:
        InputError: they are no right-handed frame.
    """
    found = re.fullmatch(r"(-?)([ijk])(-?)([ijk])(-?)([ijk])", text)
    columns = np.zeros((3, 3))
    if found:
        for k in range(3):
            columns["ijk".index(found[2 * k + 2]), k] = -1.0 if found[2 * k + 1] else 1.0
    if not found or np.linalg.det(columns) < 0.5:
        raise InputError(f"{text!r} is no right-handed frame, as i-kj is (Rel12)")
    return columns


def images_of(readings: ClinometerReadings, images: Sequence[str]) -> dict[str, str]:
    """By exposure, its image: that of this name, or the only one in whose name it stands by itself."""
    found = {}
    for exposure in readings.exposures:
        alone = re.compile(rf"(?<![A-Za-z0-9]){re.escape(exposure)}(?![A-Za-z0-9])")
        own = [exposure] if exposure in images else [image for image in images if alone.search(image)]
        if len(own) > 1:
            raise InputError(f"{readings.path}: exposure {exposure} may be {own[0]} or {own[1]}")
        if own:
            found[exposure] = own[0]
    return found


# What ClinoInit finds


@dataclass(frozen=True, eq=False)
class Found:
    """Boresights that were found, and what their readings say of them.

    Attributes:
        boresights: of the clinometers that were asked for.
        lines: what is told of them.
        alone: exposures without an image.
    """

    boresights: list[Boresight]
    lines: list[str]
    alone: list[str]


def found_boresights(
    readings: ClinometerReadings,
    poses: Poses,
    chosen: Sequence[int],
    kind: str = SPRING,
    second: str = SECOND,
) -> Found:
    """The boresights that fit readings best.

    Args:
        readings: of clinometers.
        poses: of images; those with readings are of one camera.
        chosen: numbers of one or two clinometers; two have a known turn, and are found together.
        kind: of them.
        second: axes of the second one in the frame of the first.

    Raises:
        InputError: there are too few readings, of several cameras, or they do not determine the boresight.
    """
    if not 1 <= len(chosen) <= 2 or not {*chosen} <= set(range(len(readings.names))):
        known = ", ".join(f"{k} {name}" for k, name in enumerate(readings.names))
        raise InputError(f"{readings.path}: one or two numbers of its clinometers are wanted: {known}")
    images = images_of(readings, poses.images)
    rows = [row for row, name in enumerate(readings.exposures) if name in images]
    of_camera = dict(zip(poses.images, poses.cameras or (), strict=False))
    cameras = list(dict.fromkeys(of_camera[images[readings.exposures[row]]] for row in rows))
    if len(rows) < 3 or len(cameras) > 1:
        raise InputError(
            f"{readings.path}: {len(rows)} exposures have an image, of {len(cameras)} cameras; three or more "
            "of one are wanted"
        )
    down = np.array([-poses[images[readings.exposures[row]]].rotation[2] for row in rows])
    turns = [np.eye(3), axes_of(second)][: len(chosen)]
    angles = readings.angles[np.ix_(rows, list(chosen))].T
    rotation, left, spread = _best(down, angles, turns, kind)
    if spread[1 if _is_alone(kind, chosen) else 2] < LOOSE * spread[0]:
        raise InputError(
            f"{readings.path}: the images are all tilted alike; readings at other tilts are needed"
        )
    freedom = len(left) - (2 if _is_alone(kind, chosen) else 3)
    sigma = float(np.sqrt(left @ left / freedom)) if freedom > 0 else 0.0
    names = [readings.names[k] for k in chosen]
    made = [
        Boresight(name, kind, turn @ rotation, cameras[0]) for name, turn in zip(names, turns, strict=True)
    ]
    if len(made) == 2:
        made[1] = replace(made[1], reference=names[0], relative=turns[1])
    lines = [f"{', '.join(names)}: {len(rows)} readings, sigma {sigma:.3g} rad, Cond {_shown(spread)}"]
    if _is_alone(kind, chosen):
        lines.append(f"{names[0]}: a spring does not say how it is turned about its y axis; any turn serves")
    lines += list(_alone(down, angles, rotation, turns, kind, names)) if len(made) == 2 else []
    return Found(made, lines, [name for name in readings.exposures if name not in images])


def _is_alone(kind: str, chosen: Sequence[object]) -> bool:
    return kind == SPRING and len(chosen) == 1


def _shown(spread: FloatArray) -> str:
    return " ".join(f"{value / spread[0]:.3g}" for value in spread[:0:-1])


def _alone(
    down: FloatArray,
    angles: FloatArray,
    rotation: FloatArray,
    turns: Sequence[FloatArray],
    kind: str,
    names: Sequence[str],
) -> Iterator[str]:
    """How two clinometers fit each by itself, and how far they then are from the turn that was given."""
    found = []
    for name, own, turn in zip(names, angles, turns, strict=True):
        best, left, _ = _refined(turn @ rotation, down, own[None], [np.eye(3)], kind)
        found.append(turn.T @ best)
        yield f"  {name} alone: root mean square {np.sqrt(np.mean(left**2)):.3g} rad"
    off = np.arccos(np.clip((np.trace(found[1] @ found[0].T) - 1.0) / 2.0, -1.0, 1.0))
    yield f"  turn between them: off by {off:.3g} rad"


def _best(
    down: FloatArray, angles: FloatArray, turns: Sequence[FloatArray], kind: str
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The rotation from the camera that fits best, residuals (rad), singular values of the derivatives.

    It is looked for from the 24 rotations that exchange axes: one of them is within 63 degrees of any.
    """
    signs = [np.diag(sign) for sign in itertools.product((1.0, -1.0), repeat=3)]
    axes = [np.eye(3)[list(order)] for order in itertools.permutations(range(3))]
    starts = [sign @ axis for sign in signs for axis in axes if np.linalg.det(sign @ axis) > 0.0]
    found = [_refined(start, down, angles, turns, kind) for start in starts]
    return min(found, key=lambda one: float(one[1] @ one[1]))


def _refined(
    rotation: FloatArray, down: FloatArray, angles: FloatArray, turns: Sequence[FloatArray], kind: str
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Damped Gauss-Newton from a rotation; what is not determined keeps its value."""
    left, slopes = _misfit(rotation, down, angles, turns, kind)
    damping = DAMPING
    for _ in range(STEPS):
        u, s, v = np.linalg.svd(slopes, full_matrices=False)
        if not s[0]:
            break  # a needle that no small turn moves
        step = -v.T @ (s / (s**2 + damping * s[0] ** 2) * (u.T @ left))
        moved = rotation @ exponential(step)
        new, new_slopes = _misfit(moved, down, angles, turns, kind)
        if new @ new <= left @ left:
            rotation, left, slopes, damping = moved, new, new_slopes, 0.1 * damping
        else:
            damping *= 10.0
        if float(np.abs(step).max()) < SMALL:
            break
    return rotation, left, np.asarray(np.linalg.svd(slopes, compute_uv=False), np.float64)


def _misfit(
    rotation: FloatArray, down: FloatArray, angles: FloatArray, turns: Sequence[FloatArray], kind: str
) -> tuple[FloatArray, FloatArray]:
    """Residuals (n,) of all readings, computed minus read (rad), and their derivatives (n, 3) by a turn."""
    left, slopes = [], []
    for turn, own in zip(turns, angles, strict=True):
        whole = turn @ rotation
        seen = down @ whole.T
        moves = -np.einsum("ij,njk->nik", whole, skew(down))
        if kind == SPRING:
            cosines = np.cos(own)
            left.append((seen[:, 1] - np.sin(own)) / cosines)
            slopes.append(moves[:, 1] / cosines[:, None])
        else:
            squares = np.maximum(seen[:, 0] ** 2 + seen[:, 1] ** 2, 1e-300)[:, None]
            gap = np.arctan2(seen[:, 1], seen[:, 0]) - own
            left.append(np.arctan2(np.sin(gap), np.cos(gap)))
            slopes.append((seen[:, :1] * moves[:, 1] - seen[:, 1:2] * moves[:, 0]) / squares)
    return np.concatenate(left), np.concatenate(slopes)


# In an adjustment


def add_boresights(block: BundleAdjustment, tree: ProjectTree, given: BoresightOptions) -> None:
    """Adds the clinometers of `ClinoDirIn` with their readings.

    Raises:
        InputError: a clinometer has no readings, or an exposure no image.
    """
    readings = read_clinometer_readings(tree.folder("MeasureClino", given.readings))
    for one in read_boresights(tree.folder("Clino", given.folder)):
        if one.name not in readings.names:
            known = nearest(one.name, readings.names)
            raise InputError(f"{readings.path}: has no readings of the clinometer {known}")
        own = [image for image, camera in block.camera_of.items() if camera == one.camera]
        images = images_of(readings, own)
        rows = [row for row, name in enumerate(readings.exposures) if name in images]
        if not rows:
            raise InputError(f"{readings.path}: no exposure has an image of {one.camera}")
        if len(rows) < len(readings.exposures):
            count = len(readings.exposures) - len(rows)
            block.notes.append(f"{readings.path}: {count} exposures have no image of {one.camera}")
        named = [images[readings.exposures[row]] for row in rows]
        column = readings.names.index(one.name)
        angles, sigmas = readings.angles[rows, column], readings.sigmas[rows, column]
        if not np.isfinite(sigmas).all():
            raise InputError(
                f"{readings.path}: the readings of {one.name} have no sigmas (ImportMeasuresClino with S); "
                "that which ClinoInit tells may serve"
            )
        if one.kind == SPRING:
            block.add_clinometer(Clinometer(one.name, -one.rotation[1]))
            block.add_inclinations(one.name, named, angles, sigmas)
            if one.reference:
                block.notes.append(f"{one.file}: RelCalib of a spring is not used: its axis is free")
        else:
            block.add_pendulum(Pendulum(one.name, one.rotation, turns_with=one.reference))
            block.add_needles(one.name, named, angles, sigmas)


def adjusted_boresights(found: Sequence[Boresight], solution: BundleSolution) -> Iterator[Boresight]:
    """Clinometers after an adjustment; a spring keeps its turn about its y axis."""
    for one in found:
        if one.kind == PENDULUM:
            yield replace(one, rotation=solution.pendulum(one.name).boresight)
        else:
            before, after = one.rotation[1], -solution.clinometer(one.name).axis
            turn = np.cross(before, after)
            size = float(np.linalg.norm(turn))
            angle = np.arctan2(size, before @ after)
            carried = exponential(turn / size * angle) if size > 0.0 else np.eye(3)
            yield replace(one, rotation=one.rotation @ carried.T)
