"""Rigid blocks of cameras, and orthogonality of directions carried by a block.

`BlocRigid` and `BlocRigid_RE` are MMVII's, with nine equations for the three degrees of freedom of a
rotation; `RigidPair` and `KnownRotation` have three, the axis of a turn t times `2 sin(t/2)`.

The pose of a camera is the rotation and centre that take its frame to the world; the pose of a camera in
its block takes its frame to that of the block. Metres and radians.
"""

from typing import Annotated, ClassVar

from obseq.formulas.base import Formula
from obseq.formulas.blocks import Direction, Matrix3, Point3, Pose, Rotation
from obseq.formulas.functions import Scalar, sqrt

SOURCE = "MMVII Formulas_BlockRigid.h"


class BlocRigid(Formula):
    """Relative pose of two cameras, which is that of their places in a rigid block.

    Residual: the vector `R_A^T (C_B - C_A) - R_1^T (C_2 - C_1)` (m), then the nine entries, row by row, of
    `R_A^T R_B - R_1^T R_2`, each `R = m (I - [W]x)`. A and B are the poses of the cameras in the world, 1 and
    2 those in the block. Defined everywhere.
    """

    source = SOURCE
    observation_order = ("camera_a", "camera_b", "place_1", "place_2")
    typical: ClassVar = {
        "camera_a.centre": (0.0, 10.0),
        "camera_b.centre": (0.0, 10.0),
        "place_1.centre": (0.0, 1.0),
        "place_2.centre": (0.0, 1.0),
    }

    def residual(
        self,
        camera_a: Annotated[Pose, "CA", "WA", "mA"],
        camera_b: Annotated[Pose, "CB", "WB", "mB"],
        place_1: Annotated[Pose, "C1", "W1", "m1"],
        place_2: Annotated[Pose, "C2", "W2", "m2"],
    ) -> tuple[Point3, Matrix3]:
        """The relative pose of the cameras, minus that of their places: vector (m) and matrix."""
        (vector, matrix), (fixed_vector, fixed_matrix) = (
            relative(camera_a, camera_b),
            relative(place_1, place_2),
        )
        return vector - fixed_vector, matrix - fixed_matrix


class BlocRigid_RE(Formula):  # noqa: N801  (MMVII's name)
    """Pose of a block or camera attached to a known pose.

    Residual: the vector `CA - C1` (m), then the nine entries, row by row, of `mA (I - [WA]x) - m1`. Defined
    everywhere.
    """

    source = SOURCE
    typical: ClassVar = {"pose.centre": (0.0, 10.0), "centre": (0.0, 10.0)}

    def residual(
        self,
        pose: Annotated[Pose, "CA", "WA", "mA"],
        *,
        centre: Annotated[Point3, "C1"],
        matrix: Annotated[Matrix3, "m1"],
    ) -> tuple[Point3, Matrix3]:
        """The pose, minus the known one: centre (m) and matrix."""
        return pose.centre - centre, pose.rotation.matrix() - matrix


class RigidPair(Formula):
    """Relative pose of two cameras, which is that of their places in a rigid block, in six equations.

    Residual: the vector `R_A^T (C_B - C_A) - R_1^T (C_2 - C_1)` (m), then the turn from `R_1^T R_2` to
    `R_A^T R_B`, its axis times `2 sin(t/2)` (the angle t, in radians, when it is small). Undefined for a turn
    of half a circle.
    """

    source = "Definition"
    observation_order = BlocRigid.observation_order
    typical: ClassVar = BlocRigid.typical

    def residual(
        self,
        camera_a: Annotated[Pose, "CA", "WA", "mA"],
        camera_b: Annotated[Pose, "CB", "WB", "mB"],
        place_1: Annotated[Pose, "C1", "W1", "m1"],
        place_2: Annotated[Pose, "C2", "W2", "m2"],
    ) -> tuple[Point3, Point3]:
        """The relative pose of the cameras, minus that of their places: vector (m) and turn (rad)."""
        (vector, matrix), (fixed_vector, fixed_matrix) = (
            relative(camera_a, camera_b),
            relative(place_1, place_2),
        )
        return vector - fixed_vector, turn(fixed_matrix.T @ matrix)


class KnownRotation(Formula):
    """A rotation attached to a known one.

    Residual: the turn from `m1` to `mA (I - [WA]x)`, its axis in the local frame times `2 sin(t/2)` (the
    angle t, in radians, when it is small). Undefined for a turn of half a circle.
    """

    source = "Definition"

    def residual(
        self, rotation: Annotated[Rotation, "WA", "mA"], *, matrix: Annotated[Matrix3, "m1"]
    ) -> Point3:
        """The turn from the known rotation to this one (rad)."""
        return turn(matrix.T @ rotation.matrix())


class VNormOrthog(Formula):
    """Orthogonality of two unit vectors.

    Residual: `N_1 . N_2`, the cosine of their angle, each `N = PNorm + du DirU + dv DirV`. Defined
    everywhere.
    """

    source = SOURCE

    def residual(
        self, first: Annotated[Direction, "DuDv1", "_P1"], second: Annotated[Direction, "DuDv2", "_P2"]
    ) -> Scalar:
        """The scalar product of the two vectors, which should be zero."""
        return first.dot(second)


def relative(first: Pose, second: Pose) -> tuple[Point3, Matrix3]:
    """The second pose seen from the first: its centre there, and its rotation matrix."""
    return first.inverse() @ second.centre, first.rotation.inverse() @ second.rotation


def turn(matrix: Matrix3) -> Point3:
    """The axis of a rotation times 2 sin(t/2), t its angle; undefined for half a circle."""
    a, b, c = matrix.rows
    scale = 1 / sqrt(1 + a.x + b.y + c.z)
    vector: Point3 = scale * Point3(c.y - b.z, a.z - c.x, b.x - a.y)
    return vector
