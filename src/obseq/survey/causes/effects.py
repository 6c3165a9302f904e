"""What errors of one unit do to what observations should be, where the points are: derivatives of sights."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.survey.causes.notes import Notes
from obseq.survey.equations.equations import Equations

_SHORTEST = 1e-3
"""Length of a sight (m) below which nothing is divided by it."""


@dataclass(frozen=True, eq=False)
class Effects:
    """Sights between points at some coordinates; all arrays have one entry for each observation.

    Attributes:
        notes: The network.
        coordinates: (p, 3) of the points.
        vectors: (n, 3) from instrument to target, heights included; NaN where a point has no place.
        origins: (n,) point of the instrument.
        horizons: (p, 3, 3) east, north and up at points, by rows.
        axes: (n, 3) what a metre east, north and up adds to components of vectors; NaN of others.
    """

    notes: Notes
    coordinates: FloatArray
    vectors: FloatArray
    origins: IntArray
    horizons: FloatArray
    axes: FloatArray

    @classmethod
    def of(cls, notes: Notes, equations: Equations, coordinates: FloatArray) -> Effects:
        """Those of a network, its heights as its field book gives them."""
        rows = notes.book.observations
        origins = np.where(rows.from_points < len(coordinates), rows.from_points, 0).astype(np.int64)
        horizons = equations.horizons(np.arange(len(coordinates)), coordinates)
        places = np.full((len(notes.book.point_names), 3), np.nan)
        places[: len(coordinates)] = coordinates
        axes = equations.local_axes(coordinates)
        raised = (rows.to_heights - rows.from_heights)[:, None] * horizons[origins, 2]
        vectors = places[rows.to_points] - places[rows.from_points] + raised
        return cls(notes, coordinates, vectors, origins, horizons, axes)

    @property
    def up(self) -> FloatArray:
        """(n, 3) vertical of the instrument."""
        return np.asarray(self.horizons[self.origins, 2])

    @property
    def ones(self) -> FloatArray:
        """Of a constant that all readings are too large by: computed minus observed is too small."""
        return np.full(len(self.vectors), -1.0)

    @property
    def values(self) -> FloatArray:
        """Of a scale by which all values are too large."""
        return np.asarray(-self.notes.book.observations.values)

    @cached_property
    def lengths(self) -> FloatArray:
        """Of the sights (m)."""
        return np.asarray(np.maximum(np.nan_to_num(np.linalg.norm(self.vectors, axis=1)), _SHORTEST))

    @property
    def beside(self) -> FloatArray:
        """(n, 2) of components of vectors whose end is a metre too far east, and north; 0 of all others."""
        return np.asarray(-np.nan_to_num(self.axes[:, :2]))

    @cached_property
    def off_centre(self) -> FloatArray:
        """(n, 2) of an instrument that stands a metre east, and north, of its point."""
        along = [np.einsum("ni,ni->n", self.horizons[self.origins, k], self.vectors) for k in range(3)]
        local = np.nan_to_num(np.column_stack(along))
        plan, rise = local[:, :2], local[:, 2:]
        flat = np.maximum(np.hypot(*plan.T), _SHORTEST)[:, None]
        length, notes = self.lengths[:, None], self.notes
        across = np.column_stack([plan[:, 1], -plan[:, 0]]) / flat**2
        kinds = (notes.is_direction, notes.is_zenith, notes.is_slope, notes.is_length & ~notes.is_slope)
        parts = (across, rise * plan / (flat * length**2), plan / length, plan / flat)
        found: FloatArray = np.select([kind[:, None] for kind in kinds], parts, 0.0)
        return found

    @property
    def upward(self) -> FloatArray:
        """Of components of vectors whose end is a metre too high in them; 0 of all others."""
        return np.asarray(-np.nan_to_num(self.axes[:, 2]))

    @cached_property
    def raised(self) -> FloatArray:
        """Of a height of the target that is a metre too large."""
        rise = np.nan_to_num(np.einsum("ni,ni->n", self.vectors, self.up))
        flat = np.sqrt(np.maximum(self.lengths**2 - rise**2, 0.0))
        turned = -flat / self.lengths**2
        notes = self.notes
        ones = np.ones(len(rise))
        kinds = [notes.is_zenith, notes.is_slope, notes.is_rise]
        found: FloatArray = np.select(kinds, [turned, rise / self.lengths, ones], 0.0)
        return found
