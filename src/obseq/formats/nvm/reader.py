"""Models of VisualSFM (`.nvm`, NVM_V3): cameras with one distortion each, points with their features.

Poses go from world to camera: a quaternion and the centre; x right, y down, z forward. The distortion
corrects the measured point: `undistorted = distorted (1 + k r^2)`, r in focal lengths. Features are from the
middle of the image, or from its corner; no file says which, nor how large images are. Where none is negative
they are from the corner, and the principal point is where poses and points put it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.errors import InputError
from obseq.formats.blocks.features import add_features
from obseq.formats.blocks.reading import hold_all_but, new_block, note_count
from obseq.geometry import RigidMotion, rotations_from
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera
from obseq.images.poses import Poses
from obseq.reading.tables import text_of
from obseq.reading.text import counted

FREE = ("F", "K1")
"""What VisualSFM estimates of a camera."""
HEAD = "NVM_V3"
FIXED = "FixedK"
WIDTH = 11
"""Words of a camera: name, focal length, quaternion, centre, distortion, zero."""


def read_nvm(path: str | Path) -> BundleAdjustment:
    """The first model of a file; points are called by their number, from 1.

    Raises:
        InputError: the file is none, or broken; file and line are named.
    """
    place = Path(path)
    lines = _Lines(place)
    head = lines.words()
    if not head or head[0] != HEAD:
        raise InputError(f"{place}:1: the first word of a model of VisualSFM is {HEAD}")
    with new_block(path) as block:
        if FIXED in head:
            block.notes.append(
                f"{place}:1: one calibration that is fixed ({FIXED}): cameras keep their values"
            )
        _add_images(block, lines, FIXED in head)
        _add_points(block, lines)
        if int(lines.words()[0]) if lines.left() else 0:
            note_count(block, [place.name], "files have further models, which are left out")
    return block


class _Lines:
    """Lines with something in them, one after the other."""

    def __init__(self, path: Path) -> None:
        self.path = path
        lines = counted(path, text_of(path).split("\n"))
        self._lines = [(n, line) for n, line in enumerate(lines, 1) if line.strip()]
        self._next = 0

    def left(self) -> bool:
        """Whether there is another line, which begins with a whole number."""
        return self._next < len(self._lines) and self._lines[self._next][1].split()[0].isdigit()

    def words(self) -> list[str]:
        """The words of the next line."""
        if self._next == len(self._lines):
            raise InputError(f"{self.path}: is cut short")
        self._next += 1
        return self._lines[self._next - 1][1].split()

    def count(self) -> int:
        """The whole number of the next line."""
        words = self.words()
        if len(words) != 1 or not words[0].isdigit() or int(words[0]) > len(self._lines):
            raise self.problem("a number of lines that follow is expected")
        return int(words[0])

    def numbers(self, words: list[str]) -> list[float]:
        """Finite numbers of this line."""
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = [np.nan]
        if not np.isfinite(values).all():
            raise self.problem("finite numbers are expected")
        return values

    def problem(self, said: str) -> InputError:
        """An error about this line."""
        return InputError(f"{self.path}:{self._lines[self._next - 1][0]}: {said}")


def _add_images(block: BundleAdjustment, lines: _Lines, is_fixed: bool) -> None:
    names, turns, centres, cameras = [], [], [], []
    for _ in range(lines.count()):
        words = lines.words()
        if len(words) < WIDTH:
            raise lines.problem("a camera is: name, focal length, quaternion, centre, distortion, 0")
        split = len(words) - WIDTH + 1
        name = " ".join(words[:split])
        focal, *values = lines.numbers(words[split:-1])
        if not focal > 0.0 or not any(values[:4]):
            raise lines.problem("a camera has a focal length above zero, and a rotation")
        names.append(name)
        turns.append(values[:4])
        centres.append(values[4:7])
        cameras.append(Camera(name, 0, 0, focal, np.zeros(2), (3, 1, 1), {"K1": values[7]}, backward=True))
    block.add_cameras(*cameras)
    hold_all_but(block, {camera.name: () if is_fixed else FREE for camera in cameras})
    rotations = rotations_from(np.array(turns).reshape(-1, 4), "quaternion")
    block.add_poses(
        Poses.of(names, np.array(centres).reshape(-1, 3), np.swapaxes(rotations, 1, 2), cameras=names)
    )


def _add_points(block: BundleAdjustment, lines: _Lines) -> None:
    places, rows = [], []
    images = list(block.poses.images)
    for point in range(lines.count()):
        words = lines.words()
        values = lines.numbers(words)
        if len(values) < 7 or len(values) != 7 + 4 * int(values[6]):
            raise lines.problem(
                "a point is: x y z, three of its colour, number, then image, feature, x, y of each"
            )
        places.append(values[:3])
        for k in range(7, len(values), 4):
            image = values[k]
            if not 0 <= image < len(images) or image != int(image):
                raise lines.problem(f"there is no image {words[k]}")
            rows.append((image, point, *values[k + 2 : k + 4]))
    names = [str(number) for number in range(1, len(places) + 1)]
    block.add_approximations(names, np.array(places).reshape(-1, 3))
    if rows:
        columns = np.array(rows)
        image, point_of = columns[:, :2].T.astype(np.int64)
        if (columns[:, 2:] >= 0.0).all():
            _find_middles(block, image, np.array(places)[point_of], columns[:, 2:])
        add_features(block, images, names, image, point_of, columns[:, 2:])


def _find_middles(block: BundleAdjustment, image: IntArray, places: FloatArray, xy: FloatArray) -> None:
    """Puts principal points where poses (k) and points (n, 3) put the features (n, 2) that see them."""
    poses, off = block.poses, np.empty_like(xy)
    local = RigidMotion(poses.centres[image], poses.rotations[image]).to_local(places)
    for k, name in enumerate(poses.cameras):
        rows = image == k
        off[rows] = xy[rows] - block.cameras[name].project(local[rows])
    middle = np.round(2.0 * np.median(off, axis=0)) / 2.0
    block.cameras = {name: replace(one, principal_point=middle) for name, one in block.cameras.items()}
    block.notes.append(
        f"features are from the corner of the image; principal points are at {middle[0]:g} {middle[1]:g}, "
        "where poses and points put them"
    )
