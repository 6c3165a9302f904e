"""Observed vectors with a full covariance, as linear rows that it makes independent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.adjustment.plumb import Plumb
    from obseq.survey.adjustment.site import NetworkSite
    from obseq.survey.model import FieldBook


@dataclass(frozen=True, eq=False)
class Vectors:
    """Vectors, whose components are consecutive observations.

    Attributes:
        rows: (n,) rows of the first components.
        roots: (n, 3, 3) upper roots U of the inverse covariances, U' U = C^-1.
    """

    rows: IntArray
    roots: FloatArray

    @classmethod
    def of(cls, book: FieldBook, rows: IntArray) -> Vectors:
        """The vectors of a field book whose first components are these rows."""
        inverse = np.linalg.inv(book.vectors.at(rows))
        return cls(rows, np.linalg.cholesky(inverse).transpose(0, 2, 1))

    @property
    def components(self) -> IntArray:
        """(n, 3) rows of all components."""
        return np.asarray(self.rows[:, None] + np.arange(3))

    def values(self, site: NetworkSite, plumb: Plumb, book: FieldBook, coordinates: FloatArray) -> FloatArray:
        """(n, 3) vectors between the points themselves: without heights of instrument and target."""
        rotation, _ = site.to_geocentric(self.rows)
        offsets = plumb.offsets(book, self.rows, coordinates)
        return np.asarray(book.observations.values[self.components] - offsets @ rotation.T)

    def equations(self, rotation: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coefficients (3 n, 3) of the target (those of the origin are opposite), and values (3 n,)."""
        coefficients = (self.roots @ rotation).reshape(-1, 3)
        return coefficients, np.einsum("nij,nj->ni", self.roots, values).ravel()

    def residuals(self, whitened: FloatArray) -> FloatArray:
        """(n, 3) residuals of the components, from those of the equations."""
        return np.asarray(np.linalg.solve(self.roots, whitened.reshape(-1, 3, 1))[:, :, 0])

    @property
    def sigmas(self) -> FloatArray:
        """(n, 3) sigmas of the components."""
        covariances = np.linalg.inv(self.roots.transpose(0, 2, 1) @ self.roots)
        return np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
