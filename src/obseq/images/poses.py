"""Poses of images: where each camera is, and how it is turned."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.geometry import RigidMotion as RigidMotion
from obseq.geometry import attitudes, rotations_from
from obseq.images.camera import Camera
from obseq.images.names import index_of, rows_of, unique_names
from obseq.leastsquares.problem.arguments import real


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of images by name; X_world = centre + rotation x_camera.

    The axes of the camera are x along the columns (right), y along the lines (down), z forward.

    Attributes:
        images: (n,) names of the images, all different.
        centres: (n, 3) projection centres in the world.
        rotations: (n, 3, 3) from the camera to the world; their columns are the camera's axes.
        cameras: (n,) names of the cameras; empty where a file does not say.

    Example:
        >>> poses = Poses.of(["a.jpg"], [[0.0, 0.0, 100.0]], [[0.0, 0.0, 0.0]], form="opk")
        >>> (poses["a.jpg"].rotation[:, 2] + 0.0).tolist()
        [0.0, 0.0, -1.0]
    """

    images: tuple[str, ...]
    centres: FloatArray
    rotations: FloatArray
    cameras: tuple[str, ...]

    @classmethod
    def of(
        cls,
        images: Sequence[str],
        centres: ArrayLike,
        rotations: ArrayLike,
        form: str = "matrix",
        cameras: Sequence[str] | str = "",
    ) -> Poses:
        """Poses from centres (n, 3) and rotations in any form.

        Args:
            images: (n,) names.
            centres: (n, 3).
            rotations: values of the form: (n, 3, 3), (n, 4) or (n, 3) radians.
            form: `matrix`, `quaternion`, `opk`, `wpk` or `ypr` (see `obseq.geometry.attitudes`).
            cameras: (n,) names of the cameras, or the one of all.

        Raises:
            InputError: an array does not fit, a name comes twice, or a matrix is no rotation.
        """
        names = unique_names(images, "poses: image")
        where = rows_of(centres, len(names), 3, "poses: centres")
        wrong = np.flatnonzero(~np.isfinite(where).all(axis=1))
        if wrong.size:
            raise InputError(f"poses: image {names[wrong[0]]}: the centre {where[wrong[0]]} is not finite")
        matrices = (
            rotations_from(real(rotations, "poses: rotations"), form) if len(names) else np.zeros((0, 3, 3))
        )
        if matrices.shape != (len(names), 3, 3):
            raise InputError(
                f"poses: {np.shape(rotations)} is not the shape of {len(names)} rotations as {form}"
            )
        chosen = (cameras,) * len(names) if isinstance(cameras, str) else tuple(map(str, cameras))
        if len(chosen) != len(names):
            raise InputError(f"poses: {len(chosen)} cameras for {len(names)} images")
        return cls(names, where, matrices, chosen)

    def __len__(self) -> int:
        return len(self.images)

    def __contains__(self, image: str) -> bool:
        return image in self.images

    def __iter__(self) -> Iterator[str]:
        return iter(self.images)

    def __getitem__(self, image: str) -> RigidMotion:
        row = index_of(self.images, [image], "poses: image")[0]
        return RigidMotion(self.centres[row], self.rotations[row])

    @property
    def motions(self) -> RigidMotion:
        """All of them as one batch of rigid motions, (n, 3) and (n, 3, 3)."""
        return RigidMotion(self.centres, self.rotations)

    def attitudes(self, form: str) -> FloatArray:
        """The rotations in a form: (n, 3) radians, (n, 4) or (n, 3, 3)."""
        return attitudes(self.rotations, form)

    def select(self, images: Sequence[str]) -> Poses:
        """The poses of some images, in that order."""
        rows = index_of(self.images, images, "poses: image")
        cameras = tuple(self.cameras[row] for row in rows)
        chosen = tuple(self.images[row] for row in rows)
        return Poses(chosen, self.centres[rows], self.rotations[rows], cameras)


def are_in_front(
    cameras: Sequence[Camera], poses: Poses, image: IntArray, coordinates: FloatArray, point: IntArray
) -> BoolArray:
    """(n,) whether points are where the projection of their camera is defined.

    Args:
        cameras: camera of each image.
        poses: of the images.
        image: (n,) image of each measure.
        coordinates: (k, 3) of the points, in the world.
        point: (n,) point of each measure.
    """
    axes = poses.rotations[:, :, 2]
    depths = np.negative(np.einsum("ki,ki->k", poses.centres, axes)).take(image)
    for k in range(3):
        depths += coordinates[:, k].take(point) * axes[:, k].take(image)
    seen = depths > 0.0
    for row in np.flatnonzero(~seen):  # in front, every projection is defined; behind, some are
        local = (coordinates[point[row]] - poses.centres[image[row]]) @ poses.rotations[image[row]]
        seen[row] = cameras[image[row]].is_in_front(local[None])[0]
    return np.asarray(seen)
