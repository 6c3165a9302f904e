"""The record of a block as arrays, for drawings and tables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.geometry import rotations_from
from obseq.images.output.block_record import BundleRecord, CameraRecord, MeasureRecord
from obseq.records.columns import Texts
from obseq.records.rows import Rows

UPPER = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
"""Where the entries of a 3 by 3 covariance are among the six that a record holds."""
GRID = 17
"""Points of a line of the grid that shows a distortion."""


@dataclass(frozen=True, eq=False)
class BlockArrays:
    """What a record says of images, points and image points.

    Attributes:
        camera: (m,) camera of each image, a position in the cameras of the record.
        centres: (m, 3) of the images.
        rotations: (m, 3, 3) from camera to world.
        coordinates: (p, 3) of the points.
        covariances: (p, 3, 3); None without precisions.
        is_control: (p,) whether a point is a control point.
        image: (n,) image of each measure.
        point: (n,) point of each measure.
        xy: (n, 2) measured, pixels.
        residuals: (n, 2) computed minus measured, pixels.
        sigmas: (n, 2) pixels.
        weights: (n,) what robust weights left.
    """

    camera: IntArray
    centres: FloatArray
    rotations: FloatArray
    coordinates: FloatArray
    covariances: FloatArray | None
    is_control: BoolArray
    image: IntArray
    point: IntArray
    xy: FloatArray
    residuals: FloatArray
    sigmas: FloatArray
    weights: FloatArray

    @property
    def largest(self) -> FloatArray:
        """(p,) the longest residual of each point, pixels."""
        found = np.zeros(len(self.coordinates))
        np.maximum.at(found, self.point, np.linalg.norm(self.residuals, axis=1))
        return found


def arrays_of(record: BundleRecord) -> BlockArrays:
    """The arrays of a record."""
    names = [camera.name for camera in record.cameras]
    measures, points = record.measures, record.points
    covariances = None
    if record.precision != "none":
        covariances = points.numbers("covariance").reshape(-1, 6)[:, UPPER]
    return BlockArrays(
        np.array([names.index(image.camera) for image in record.images], dtype=np.int64),
        np.array([image.centre for image in record.images], dtype=np.float64).reshape(-1, 3),
        rotations_from([image.quaternion for image in record.images], "quaternion"),
        np.column_stack([points.numbers(axis) for axis in "xyz"]),
        covariances,
        np.array([kind == "control" for kind in points.values("kind")], dtype=bool),
        _positions(measures.texts("image"), [image.name for image in record.images]),
        _positions(measures.texts("point"), points.values("name")),
        _pairs(measures, ""),
        _pairs(measures, "d"),
        _pairs(measures, "s"),
        measures.numbers("weight"),
    )


def _pairs(measures: Rows[MeasureRecord], of: str) -> FloatArray:
    return np.column_stack([measures.numbers(of + axis) for axis in "xy"])


def _positions(column: Texts, names: Sequence[str]) -> IntArray:
    """(n,) where the texts of a column are among some names."""
    at = {name: k for k, name in enumerate(names)}
    return np.array([at[name] for name in column.names], dtype=np.int64)[column.codes]


def suspected_measures(record: BundleRecord) -> BoolArray:
    """(n,) image points, in the rows of the residuals, that are suspected to be gross errors."""
    marked = np.zeros(len(record.measures), dtype=bool)
    accused = () if record.diagnosis is None else record.diagnosis.accused
    marked[[place.row for one in accused for place in one.observations]] = True
    return marked


def frame_of(size: tuple[int, int], xy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Corner and size of the image in pixels; of the measures where the camera has no size."""
    if size[0]:
        return np.zeros(2), np.array(size, dtype=np.float64)
    reach = np.abs(xy).max(axis=0, initial=1.0)
    return -reach, 2.0 * reach


def grid_of(size: tuple[int, int], focal: float) -> FloatArray:
    """(289, 2) points of a regular grid of the image, in pixels."""
    corner, reach = frame_of(size, np.full((1, 2), 2.0 * focal))
    ticks = [np.linspace(corner[k], corner[k] + reach[k], GRID) for k in (0, 1)]
    x, y = np.meshgrid(*ticks)
    return np.column_stack([x.ravel(), y.ravel()])


def interior(camera: CameraRecord) -> tuple[float, tuple[float, float]]:
    """Focal length and principal point of a camera, pixels: its first three parameters."""
    focal, x, y = (parameter.value for parameter in camera.parameters[:3])
    return focal, (x, y)
