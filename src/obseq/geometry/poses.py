"""Poses: where a station or a camera is, and how it is turned."""

import numpy as np
import numpy.typing as npt

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """From a local frame to the world: world = rotation local + centre; the pose of a camera, in numbers.

    One pose, or a batch of them with the same leading shape for both arrays.

    Attributes:
        centre: (..., 3), the origin of the local frame in the world.
        rotation: (..., 3, 3), local to world.
    """

    centre: FloatArray
    rotation: FloatArray

    def to_world(self, points: npt.ArrayLike) -> FloatArray:
        """World coordinates (..., 3) of local points; poses and points are broadcast against each other."""
        return _turn(self.rotation, np.asarray(points, dtype=np.float64)) + self.centre

    def to_local(self, points: npt.ArrayLike) -> FloatArray:
        """Local coordinates (..., 3) of world points."""
        arms = np.asarray(points, dtype=np.float64) - self.centre
        return _turn(np.swapaxes(self.rotation, -1, -2), arms)

    def inverse(self) -> "RigidMotion":
        """The motion from the world to the local frame."""
        back = np.swapaxes(self.rotation, -1, -2)
        return RigidMotion(-_turn(back, self.centre), back)

    def __matmul__(self, other: "RigidMotion") -> "RigidMotion":
        """The motion that applies `other` first: (a @ b).to_world(x) = a.to_world(b.to_world(x))."""
        return RigidMotion(self.to_world(other.centre), self.rotation @ other.rotation)

    def relative_to(self, reference: "RigidMotion") -> "RigidMotion":
        """This pose seen from the local frame of `reference`: reference^-1 @ self."""
        return reference.inverse() @ self


def _turn(rotation: FloatArray, vectors: FloatArray) -> FloatArray:
    turned: FloatArray = (rotation @ vectors[..., None])[..., 0]
    return turned
