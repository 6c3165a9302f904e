"""Kinds of unknowns: what their values look like, what formulas read of them, how a step moves them.

A kind is one object, a `Manifold`; nothing else of the library asks which one it is. The values of points,
vectors and numbers are the unknowns themselves. The others are `Curved`: they have a current value, kept as
the context that formulas read, and unknowns that are a small displacement from it, zero between two steps: a
step is absorbed by the value, and the displacement is zero again. `LeastSquares.add_blocks` takes one of
your own.

A rotation is a matrix R0 from the local frame (camera, instrument) to the world frame, and an unknown small
rotation w around it: R = R0 (I - [w]x). After a step, w is absorbed by the exact exponential,
R0 <- R0 exp(-[w]x). A direction is a unit vector N0 with two tangent vectors U, V and the unknowns du, dv:
N = N0 + du U + dv V, normalised when the step is absorbed.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.geometry.rotations import IDENTITY, absorb, logarithm


@dataclass(frozen=True)
class Manifold:
    """A kind of unknown whose values are the unknowns themselves; steps are added.

    Attributes:
        label: its name, which blocks of formulas give as their kind (`Point3`).
        components: names of the unknowns of a block; empty where each addition names its own.
        is_point: whether a block is a place, which error ellipses and free movements speak of.
        stands_for: kinds of blocks of formulas that it can stand for besides its own.
    """

    label: str
    components: tuple[str, ...] = ()
    is_point: bool = False
    stands_for: tuple[str, ...] = ()

    is_flat: ClassVar[bool] = True
    """Whether its values are the unknowns themselves: these take priors, and can define a datum."""

    context_size: ClassVar[int] = 0
    """Number of context values of a block."""

    transposed_at: ClassVar[int] = 0
    """Where in the context formulas find it transposed, if they want it so."""

    def shape(self, size: int) -> tuple[int, ...]:
        """Shape of the value of a block of `size` unknowns."""
        return (size,)

    def checked(self, values: FloatArray, names: Sequence[str], what: str) -> FloatArray:
        """Finite values (n, ...) of blocks of these names, as they are taken.

        Raises:
            InputError: a row is no value of this kind; the message begins with `what`.
        """
        del names, what
        return values

    def split(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, size) unknowns and (n, context_size) context of values (n, ...)."""
        return values, np.zeros((len(values), 0))

    def joined(self, unknowns: FloatArray, context: FloatArray) -> FloatArray:
        """(n, ...) the values of unknowns (n, size) and their context, between two steps."""
        del context
        return unknowns

    def moved(self, context: FloatArray, step: FloatArray) -> FloatArray:
        """(n, context_size) the contexts after steps (n, size) that are absorbed."""
        del step
        return context

    def coordinates(self, values: FloatArray) -> FloatArray:
        """(n, size) what a table of unknowns shows of values (n, ...)."""
        return values


class Curved(Manifold, ABC):
    """A kind with a current value, and unknowns that are a displacement from it.

    A subclass says `context_size`, `shape`, `context`, `values` and `moved`, and what else differs.
    """

    is_flat = False

    @abstractmethod
    def shape(self, size: int) -> tuple[int, ...]:
        """Shape of a value."""

    @abstractmethod
    def context(self, values: FloatArray) -> FloatArray:
        """(n, context_size) what formulas read of values (n, ...)."""

    @abstractmethod
    def values(self, context: FloatArray) -> FloatArray:
        """(n, ...) the values of contexts (n, context_size)."""

    @abstractmethod
    def moved(self, context: FloatArray, step: FloatArray) -> FloatArray:
        """(n, context_size) the contexts after steps (n, size) that are absorbed."""

    def split(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Displacements of zero, and the context."""
        return np.zeros((len(values), len(self.components))), self.context(values)

    def joined(self, unknowns: FloatArray, context: FloatArray) -> FloatArray:
        """The current values."""
        del unknowns
        return self.values(context)

    def coordinates(self, values: FloatArray) -> FloatArray:
        """The displacements, 0."""
        return np.zeros((len(values), len(self.components)))


class Rotations(Curved):
    """Rotations from a local frame to the world, (3, 3), moved by small rotations in the local frame."""

    context_size = 18
    """The matrix row by row, then its transpose, for kernels that read either."""

    transposed_at = 9

    def shape(self, size: int) -> tuple[int, ...]:
        """A matrix."""
        return (3, 3)

    def checked(self, values: FloatArray, names: Sequence[str], what: str) -> FloatArray:
        """Matrices checked to be rotations to 1e-6, and made so to rounding."""
        gap = np.abs(values @ values.swapaxes(1, 2) - IDENTITY).max(axis=(1, 2))
        is_wrong = (gap > 1e-6) | (np.linalg.det(values) < 0.0)
        if is_wrong.any():
            raise InputError(
                f"{what}: row {is_wrong.argmax()} is not a rotation matrix (R R^T = I, det R = 1)"
            )
        return orthonormalised(orthonormalised(values))

    def context(self, values: FloatArray) -> FloatArray:
        """(n, 18) of matrices."""
        context = np.empty((len(values), 2, 3, 3))
        context[:, 0], context[:, 1] = values, values.swapaxes(1, 2)
        return context.reshape(-1, 18)

    def values(self, context: FloatArray) -> FloatArray:
        """(n, 3, 3) matrices."""
        return context[:, :9].reshape(-1, 3, 3)

    def moved(self, context: FloatArray, step: FloatArray) -> FloatArray:
        """Contexts of R0 exp(-[w]x), kept orthonormal over many steps."""
        return Rotations.context(self, orthonormalised(absorb(Rotations.values(self, context), step)))

    def coordinates(self, values: FloatArray) -> FloatArray:
        """Rotation vectors."""
        return logarithm(values)


class PlumbRotations(Rotations):
    """Rotations that know to which plumb line they refer, as that of an instrument which stays plumb.

    A value is (3, 6): the matrix, and beside it the rotation from the world to axes along the plumb line.
    """

    context_size = 27

    def shape(self, size: int) -> tuple[int, ...]:
        """Two matrices."""
        return (3, 6)

    def checked(self, values: FloatArray, names: Sequence[str], what: str) -> FloatArray:
        """With matrices checked to be rotations, and made so."""
        return np.concatenate([super().checked(values[:, :, :3], names, what), values[:, :, 3:]], axis=2)

    def context(self, values: FloatArray) -> FloatArray:
        """(n, 27): the matrix, its transpose, and the plumb line, row by row."""
        return np.hstack([super().context(values[:, :, :3]), values[:, :, 3:].reshape(-1, 9)])

    def values(self, context: FloatArray) -> FloatArray:
        """(n, 3, 6) both matrices."""
        return np.concatenate([super().values(context), context[:, 18:].reshape(-1, 3, 3)], axis=2)

    def moved(self, context: FloatArray, step: FloatArray) -> FloatArray:
        """Contexts of R0 exp(-[w]x)."""
        return np.hstack([super().moved(context[:, :18], step), context[:, 18:]])

    def coordinates(self, values: FloatArray) -> FloatArray:
        """Rotation vectors."""
        return super().coordinates(values[:, :, :3])


class Directions(Curved):
    """Unit vectors of space, given by vectors of any length but zero, moved along their two tangents."""

    context_size = 9
    """The unit vector N0 and two unit vectors U, V that complete it to a direct orthonormal frame."""

    def shape(self, size: int) -> tuple[int, ...]:
        """A vector of space."""
        return (3,)

    def checked(self, values: FloatArray, names: Sequence[str], what: str) -> FloatArray:
        """Vectors that are not zero."""
        wrong = np.flatnonzero(~values.any(axis=1))
        if wrong.size:
            raise InputError(f"{what}: the vector of {names[wrong[0]]!r} is zero")
        return values

    def context(self, values: FloatArray) -> FloatArray:
        """(n, 9) of vectors: U is the projection of the coordinate axis that is farthest from N0."""
        unit = values / np.linalg.norm(values, axis=1)[:, None]
        axis = np.eye(3)[np.argmin(np.abs(unit), axis=1)]
        first = axis - np.sum(axis * unit, axis=1)[:, None] * unit
        first /= np.linalg.norm(first, axis=1)[:, None]
        return np.hstack([unit, first, np.cross(unit, first)])

    def values(self, context: FloatArray) -> FloatArray:
        """(n, 3) unit vectors."""
        return context[:, :3]

    def moved(self, context: FloatArray, step: FloatArray) -> FloatArray:
        """Contexts of N0 + du U + dv V."""
        unit, first, second = context[:, :3], context[:, 3:6], context[:, 6:]
        return self.context(unit + step[:, :1] * first + step[:, 1:] * second)


@dataclass(frozen=True, eq=False)
class CurvedBlocks:
    """The blocks of a curved kind.

    Attributes:
        manifold: the kind.
        scalars: (n, size) positions of their unknowns in the values.
        places: (n, context size) positions of their context.
    """

    manifold: Manifold
    scalars: IntArray
    places: IntArray


POINT3 = Manifold("Point3", ("x", "y", "z"), is_point=True)
POINT2 = Manifold("Point2", ("x", "y"), is_point=True)
ROTATION = Rotations("Rotation", ("rotation.x", "rotation.y", "rotation.z"))
PLUMB = PlumbRotations("PlumbRotation", ROTATION.components, stands_for=(ROTATION.label,))
DIRECTION = Directions("Direction", ("direction.u", "direction.v"))
VECTOR = Manifold("Vector", stands_for=("Scalar",))
SCALAR = Manifold("Scalar", ("",), stands_for=("Vector",))

MANIFOLDS: tuple[Manifold, ...] = (POINT3, POINT2, ROTATION, DIRECTION, VECTOR, SCALAR)
"""Those that every system knows."""


ONE_AND_A_HALF = 1.5 * IDENTITY


def orthonormalised(matrices: FloatArray) -> FloatArray:
    """Rotations from matrices (n, 3, 3) that rounding moved away: one step of Newton's iteration."""
    return np.asarray(matrices @ (ONE_AND_A_HALF - (0.5 * matrices.swapaxes(1, 2)) @ matrices))


FARTHEST = 1e-6
"""Least share of the inverse distance that a step leaves: infinity itself has no coordinates."""


@dataclass(frozen=True, eq=False)
class Perspective:
    """Points and from where they are seen: a step changes the inverse of their distance, not the distance.

    Rays that are nearly parallel tell the inverse of a distance with an error that is symmetric, zero and
    less included: there the rays meet in front, nowhere, or behind. The distance itself goes to infinity on
    the way, along a valley that bends and has no end (Montiel, Civera and Davison, Unified inverse depth
    parametrization for monocular SLAM, 2006). A step d of a point X seen from C changes the inverse of its
    distance, to first order, by the share s = d'(X - C) / |X - C|^2. Made in the inverse distance it leads to
    X + d / (1 - s): the same step where it is short, a longer one towards infinity, and one beyond it where s
    is above one.

    Attributes:
        scalars: (n, 3) positions of their coordinates among all unknowns.
        places: (n, 3) from where: about the middle of all places is enough.
    """

    scalars: IntArray
    places: FloatArray

    def stretched(self, values: FloatArray, step: FloatArray, frozen: BoolArray) -> FloatArray:
        """(n_scalars,) a step from these values in which these points change their inverse distances."""
        arms, steps = values[self.scalars] - self.places, step[self.scalars]
        squares = np.einsum("ij,ij->i", arms, arms)
        shares = np.einsum("ij,ij->i", arms, steps) / np.where(squares > 0.0, squares, np.inf)
        left = 1.0 - shares
        left = np.copysign(np.maximum(np.abs(left), FARTHEST), left)
        left[frozen[self.scalars].any(axis=1)] = 1.0
        found = step.copy()
        found[self.scalars] = steps / left[:, None]
        return found
