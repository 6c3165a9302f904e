"""Bundler's `bundle.out`, version 0.3: the cameras of BAL, five lines each, and three lines for each point.

cameras and points            two counts
f k1 k2 / R (three lines) / t
X Y Z / colour / n, then for each of n views: camera, feature, x, y
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.errors import InputError, naming
from obseq.formats.bal.reader import block_of_cameras
from obseq.formats.blocks.reading import note_count
from obseq.images.bundle import BundleAdjustment
from obseq.reading.tables import number_in, text_of
from obseq.reading.text import counted

HEADER = "# Bundle file v0.3"
CAMERA_LINES, POINT_LINES, VIEW = 5, 3, 4


class _Lines:
    """The lines of a file that hold something, as numbers."""

    def __init__(self, path: str | Path, text: str) -> None:
        self.path = path
        lines = counted(path, text.splitlines())
        kept = [(k, line.split()) for k, line in enumerate(lines, 1) if line.strip() and k > 1]
        self._numbers = [k for k, _ in kept]
        self.rows = [self._row(row, words) for row, (_, words) in enumerate(kept)]

    def where(self, row: int) -> str:
        """File and line of a row; the file alone where it has ended."""
        return f"{self.path}:{self._numbers[row]}" if row < len(self._numbers) else str(self.path)

    def _row(self, row: int, words: list[str]) -> FloatArray:
        try:
            values = np.array(words, dtype=np.float64)
            if np.isfinite(values).all():
                return values
        except ValueError:
            pass
        return np.array([number_in(word, f"{self.where(row)}: a number is") for word in words])

    def counts(self) -> tuple[int, int]:
        """The numbers of cameras and points, checked with the number of lines."""
        first = self.rows[0] if self.rows else np.zeros(0)
        if len(first) != 2 or (first < 0.0).any() or (first != np.round(first)).any():
            raise InputError(f"{self.where(0)}: the line after the first counts cameras and points")
        cameras, points = map(int, first)
        wanted = CAMERA_LINES * cameras + POINT_LINES * points
        if len(self.rows) - 1 != wanted:
            raise InputError(
                f"{self.where(0)}: {cameras} cameras and {points} points are {wanted} lines; "
                f"{len(self.rows) - 1} follow"
            )
        return cameras, points

    def threes(self, rows: Sequence[int]) -> FloatArray:
        """(n, 3) rows of three numbers."""
        for row in rows:
            if len(self.rows[row]) != 3:
                raise InputError(f"{self.where(row)}: 3 numbers are expected, not {len(self.rows[row])}")
        return np.array([self.rows[row] for row in rows]).reshape(-1, 3)

    def views(self, row: int, is_there: list[bool]) -> FloatArray:
        """(n, 4) the views of a point: camera, feature, x, y."""
        count, *values = self.rows[row]
        if len(values) != VIEW * count:
            raise InputError(
                f"{self.where(row)}: {count:g} views are {VIEW * count:g} numbers; {len(values)} follow"
            )
        found = np.reshape(values, (-1, VIEW))
        for camera in found[:, 0]:
            if not (0.0 <= camera < len(is_there) and camera == int(camera) and is_there[int(camera)]):
                raise InputError(
                    f"{self.where(row)}: the point is seen by camera {camera:g}, which is not there"
                )
        return found


def read_bundler(path: str | Path, images: Sequence[str] | None = None) -> BundleAdjustment:
    """The block of a Bundler file (`bundle.out`, version 0.3); cameras of focal length 0 are not there.

    Args:
        path: the file.
        images: names of all its cameras in order, as its `list.txt` has them; numbers when None.

    Raises:
        InputError: the file is not what it says; file and line are named.
    """
    text = text_of(path)
    if not text.startswith(HEADER):
        raise InputError(f"{path}: not a Bundler file of version 0.3 (the first line says so)")
    lines = _Lines(path, text)
    n, m = lines.counts()
    names = list(images) if images is not None else [f"image {k}" for k in range(n)]
    if len(names) != n:
        raise InputError(f"{path}: {len(names)} image names for {n} cameras")
    after = 1 + CAMERA_LINES * n
    cameras = lines.threes(range(1, after)).reshape(n, CAMERA_LINES, 3)
    points = lines.threes(range(after, after + POINT_LINES * m, POINT_LINES))
    used = cameras[:, 0, 0] > 0.0
    views = [lines.views(after + POINT_LINES * k + 2, used.tolist()) for k in range(m)]
    index, pixels = _measures(views, used)
    with naming(path):
        block = block_of_cameras(
            path,
            cameras[used, 1:4],
            cameras[used, 4],
            cameras[used, 0],
            points,
            index,
            pixels,
            [name for name, there in zip(names, used, strict=True) if there],
        )
    absent = [name for name, there in zip(names, used, strict=True) if not there]
    note_count(block, absent, "images are not there: their focal length is 0")
    return block


def _measures(views: list[FloatArray], used: BoolArray) -> tuple[IntArray, FloatArray]:
    """(k, 2) camera, among those that are there, and point of each view, and (k, 2) pixels."""
    rows = np.concatenate([np.zeros((0, VIEW)), *views])
    number = np.cumsum(used) - 1
    owner = np.repeat(np.arange(len(views)), [len(view) for view in views])
    return np.column_stack([number[rows[:, 0].astype(np.int64)], owner]), rows[:, 2:]
