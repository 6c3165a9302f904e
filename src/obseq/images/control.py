"""Control points: what is known of the coordinates of some points, and how well."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import BoolArray, FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError, RowError
from obseq.images.names import as_names, index_of, rows_of, sigmas_of, unique_names
from obseq.leastsquares.problem.arguments import real


class GivenComponents:
    """What covariances of points say of each of their components: a sigma, that it is held, that it is free.

    Attributes:
        covariances: (n, 3, 3): zero rows where a component is held (exactly known), infinite on the
            diagonal where it is free.
    """

    covariances: FloatArray

    @property
    def is_held(self) -> BoolArray:
        """(n, 3) components that are known exactly."""
        return np.asarray(np.diagonal(self.covariances, axis1=1, axis2=2) == 0.0)

    @property
    def is_free(self) -> BoolArray:
        """(n, 3) components of which nothing is known but an approximation, if that."""
        return np.isinf(np.diagonal(self.covariances, axis1=1, axis2=2))


@dataclass(frozen=True, eq=False)
class ControlPoints(GivenComponents):
    """Points with given coordinates.

    Attributes:
        names: (n,) names, all different.
        coordinates: (n, 3) in the frame of the block; where a component is free, an approximation.
        covariances: (n, 3, 3): zero rows where a component is held (exactly known), infinite on the
            diagonal where it is free.

    Example:
        >>> control = ControlPoints.of(["A", "B"], [[0.0, 0, 0], [5, 0, 0]], [[0.01, 0.01, 0.02], [0, 0, 0]])
        >>> control.is_held[1].all()
        np.True_
    """

    names: tuple[str, ...]
    coordinates: FloatArray
    covariances: FloatArray

    @classmethod
    def of(cls, names: Sequence[str], coordinates: ArrayLike, sigmas: ArrayLike = 0.0) -> ControlPoints:
        """Control points with standard deviations.

        Args:
            names: (n,) names.
            coordinates: (n, 3).
            sigmas: one number, (n,) or (n, 3), in the unit of the coordinates: 0 holds a component as it
                is, infinity leaves it free.

        Raises:
            InputError: a name comes twice, a coordinate is not finite, a sigma is negative or not a number.
        """
        names = unique_names(names, "control point")
        spread = sigmas_of(sigmas, len(names), 3, "control points: sigmas")
        with np.errstate(over="ignore", under="ignore"):
            squares = np.square(spread)
        is_said = (squares > 0.0) & np.isfinite(squares) | (spread == 0.0) | (spread == np.inf)
        wrong = np.flatnonzero(~(is_said & (spread >= 0.0)).all(axis=1))
        if wrong.size:
            raise RowError(
                f"control point {names[wrong[0]]}: a sigma is above zero, 0 (held) or infinite (free), "
                f"not {spread[wrong[0]]}",
                int(wrong[0]),
            )
        covariances = np.zeros((len(names), 3, 3))
        covariances[:, range(3), range(3)] = squares
        return cls._checked(names, coordinates, covariances)

    @classmethod
    def correlated(
        cls, names: Sequence[str], coordinates: ArrayLike, covariances: ArrayLike
    ) -> ControlPoints:
        """Control points with full covariances (n, 3, 3), each symmetric and positive definite."""
        names = unique_names(names, "control point")
        given = real(covariances, "control points: covariances")
        if given.shape != (len(names), 3, 3):
            raise InputError(
                f"control points: covariances have shape {given.shape}, not ({len(names)}, 3, 3)"
            )
        for name, matrix in zip(names, given, strict=True):
            if not (
                np.isfinite(matrix).all()
                and np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0)
                and np.linalg.eigvalsh(matrix)[0] > 0.0
            ):
                raise InputError(
                    f"control point {name}: the covariance is not symmetric and positive definite"
                )
        return cls._checked(names, coordinates, given)

    @classmethod
    def _checked(
        cls, names: tuple[str, ...], coordinates: ArrayLike, covariances: FloatArray
    ) -> ControlPoints:
        array = rows_of(coordinates, len(names), 3, "control points: coordinates")
        wrong = np.flatnonzero(~np.isfinite(array).all(axis=1))
        if wrong.size:
            raise RowError(
                f"control point {names[wrong[0]]}: coordinates {array[wrong[0]]} are not finite",
                int(wrong[0]),
            )
        return cls(names, array, covariances)

    def __len__(self) -> int:
        return len(self.names)

    @property
    def sigmas(self) -> FloatArray:
        """(n, 3) standard deviations; 0 where held, infinite where free."""
        return np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2))

    def select(self, names: Sequence[str]) -> ControlPoints:
        """Some of them, in that order."""
        rows = index_of(self.names, names, "control point")
        chosen = tuple(self.names[row] for row in rows)
        return ControlPoints(chosen, self.coordinates[rows], self.covariances[rows])

    def without(self, names: Collection[str]) -> ControlPoints:
        """All but some of them."""
        left_out = set(as_names(names, "control point"))
        return self.select([name for name in self.names if name not in left_out])

    def held(self) -> ControlPoints:
        """The same points, known exactly."""
        return ControlPoints(self.names, self.coordinates, np.zeros_like(self.covariances))

    def scaled(self, factor: float) -> ControlPoints:
        """The same points, their sigmas times a factor (MMVII's SG); 0 holds what is not free."""
        covariances = np.where(np.isinf(self.covariances), np.inf, 0.0)
        known = np.isfinite(self.covariances)
        covariances[known] = self.covariances[known] * factor**2
        return ControlPoints(self.names, self.coordinates, covariances)
