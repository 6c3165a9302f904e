"""What an offset that several sights share does to each of them."""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.registry import codes_where, codes_with

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.arrays import BoolArray, FloatArray
    from obseq.survey.screening.robust import Estimate

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]
    Change = Callable[[float], FloatArray]
    """Offset (m, rad, parts) -> what it adds to the misfit of each sight."""


def zenith_angles() -> list[int]:
    """Codes of zenith angles."""
    return codes_where(lambda kind: kind.is_refracted)


def slopes() -> list[int]:
    """Codes of slope distances."""
    return codes_where(lambda kind: kind.horizontal is not None)


class What(enum.Enum):
    """What is shared."""

    INSTRUMENT = "height of the instrument"
    TARGET = "height of the target"
    CONSTANT = "constant of the distances"
    SCALE = "scale of the distances"
    INDEX = "index of the zenith angles"

    @property
    def is_height(self) -> bool:
        """Whether it is a height, not something of distances."""
        return self in (What.INSTRUMENT, What.TARGET)


@dataclass(frozen=True, eq=False)
class Sights:
    """Where the observations look.

    Attributes:
        vectors: (k, 3) from instrument to target; NaN where a point has no place.
        up: (k, 3) verticals of the instruments.
        values: (k,) what was read (m, rad).
        is_zenith, is_slope: (k,) which are zenith angles, and slope distances.
        is_distance: (k,) which are distances of an instrument.
    """

    vectors: FloatArray
    up: FloatArray
    values: FloatArray
    is_zenith: BoolArray
    is_slope: BoolArray
    is_distance: BoolArray

    @classmethod
    def of(cls, found: Estimate) -> Sights:
        """Those of an estimate."""
        observations = found.book.observations
        is_used = observations.active & np.isfinite(found.misfits)
        chosen = zenith_angles(), slopes(), list(codes_with("constant"))
        kinds = (is_used & np.isin(observations.types, codes) for codes in chosen)
        up = _verticals(found)
        return cls(_vectors(found, up), up, observations.values, *kinds)

    def seeing(self, what: What, rows: Rows) -> Rows:
        """Those of some rows that an offset changes."""
        if what is What.INDEX:
            return rows[self.is_zenith[rows]]
        mask = self.is_zenith | self.is_slope if what.is_height else self.is_distance
        return rows[mask[rows]]

    def change(self, what: What, rows: Rows) -> Change:
        """What offsets add to misfits."""
        if what in (What.CONSTANT, What.INDEX):
            return lambda size: np.full(len(rows), -size)
        if what is What.SCALE:
            return lambda size: -size * self.values[rows]
        sign = 1.0 if what is What.TARGET else -1.0
        vectors, up, is_zenith = self.vectors[rows], self.up[rows], self.is_zenith[rows]
        before = _observed(vectors, up, is_zenith)
        return lambda size: _observed(vectors + sign * size * up, up, is_zenith) - before


def _observed(vectors: FloatArray, up: FloatArray, is_zenith: BoolArray) -> FloatArray:
    """(n,) zenith angles or slope distances of sights (n, 3), with the verticals of their instruments."""
    rise = np.sum(vectors * up, axis=1)
    length = np.linalg.norm(vectors, axis=1)
    flat = np.sqrt(np.maximum(length**2 - rise**2, 0.0))
    return np.asarray(np.where(is_zenith, np.arctan2(flat, rise), length))


def _verticals(found: Estimate) -> FloatArray:
    """(k, 3) the vertical of each instrument; z where there is none."""
    observations, rotations = found.book.observations, found.rotations
    up = np.tile((0.0, 0.0, 1.0), (len(observations), 1))
    if len(rotations):
        turned = rotations[observations.stations][:, :, 2]
        is_known = (observations.stations >= 0) & np.isfinite(turned).all(axis=1)
        up = np.where(is_known[:, None], turned, up)
    return up


def _vectors(found: Estimate, up: FloatArray) -> FloatArray:
    observations, n = found.book.observations, len(found.book.point_names)
    places = np.full((n, 3), np.nan)
    places[: len(found.coordinates)] = found.coordinates
    heights = (observations.to_heights - observations.from_heights)[:, None]
    marks = places[observations.to_points] - places[observations.from_points]
    return np.asarray(marks + heights * up)
