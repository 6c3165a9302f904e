"""What a block holds beside cameras and poses; the block checks it when it is added."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import field, replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.dataclass import dataclass

if TYPE_CHECKING:
    import re
    from collections.abc import Collection, Iterator, Sequence

    from obseq.images.clinometers import Clinometer, Inclinations
    from obseq.images.measures import ImagePoints
    from obseq.images.poses import Poses
    from obseq.images.weighting import Weighting
    from obseq.leastsquares.problem.losses import Loss
    from obseq.reading.origin import Origin


class Approximations(Mapping[str, FloatArray]):
    """Where points are about, by name: kept as the arrays given; of a name, the last one counts."""

    def __init__(self) -> None:
        self._given: list[tuple[tuple[str, ...], FloatArray]] = []
        self._rows: dict[str, FloatArray] = {}

    def __copy__(self) -> Approximations:
        made = Approximations()
        made._given = list(self._given)
        return made

    def add(self, names: Sequence[str], coordinates: FloatArray) -> None:
        """Adds (n, 3) coordinates of n names."""
        self._given.append((tuple(names), coordinates))
        self._rows = {}

    def of(self, names: Sequence[str]) -> FloatArray:
        """(n, 3) coordinates of different names, NaN where there are none; a copy."""
        if len(self._given) == 1 and self._given[0][0] == tuple(names):
            return self._given[0][1].copy()
        unknown = np.full(3, np.nan)
        return np.array([self._by_name.get(name, unknown) for name in names]).reshape(-1, 3)

    @property
    def _by_name(self) -> dict[str, FloatArray]:
        """Rows of the arrays, looked for when a name is asked for."""
        if not self._rows:
            for names, coordinates in self._given:
                self._rows.update(zip(names, coordinates, strict=True))
        return self._rows

    def __getitem__(self, name: str) -> FloatArray:
        return self._by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self._by_name)


@dataclass(frozen=True, eq=False)
class MeasureSet:
    """Image points that are weighted alike.

    Attributes:
        measures: the points.
        weighting: robust weights; the sigmas are in the measures.
        name: of the set, for messages and sums of squares.
        origin: where they were read; None where nobody said.
        robust: robust weights of residuals over sigmas, in place of those of the weighting.
    """

    measures: ImagePoints
    weighting: Weighting | None
    name: str
    origin: Origin | None = None
    robust: Loss | None = None

    @property
    def loss(self) -> Loss | None:
        """Of residuals over sigmas; None where no measure is weakened."""
        return self.robust or (None if self.weighting is None else self.weighting.loss)

    def of_rows(self, kept: BoolArray) -> MeasureSet:
        """The set with some of its rows (n,)."""
        if kept.all():
            return self
        origin = self.origin
        if origin is not None and origin.lines:
            origin = replace(origin, lines=tuple(itertools.compress(origin.lines, kept)))
        return replace(self, measures=self.measures.rows(kept), origin=origin)


@dataclass(frozen=True)
class Lengths:
    """Distances between points, scale bars among them.

    Attributes:
        first: (n,) names of points.
        second: (n,) names of points.
        values: (n,) in the unit of the world.
        sigmas: (n,).
    """

    first: tuple[str, ...] = ()
    second: tuple[str, ...] = ()
    values: tuple[float, ...] = ()
    sigmas: tuple[float, ...] = ()


@dataclass(frozen=True)
class PoseObservations:
    """Poses that are observed: satellite positions, another orientation.

    Attributes:
        poses: observed values.
        centre_sigmas: (n, 3); infinite where nothing is observed.
        rotation_sigma: radians per axis; None when rotations are not observed.
    """

    poses: Poses
    centre_sigmas: FloatArray
    rotation_sigma: float | None

    def without(self, images: Collection[str]) -> PoseObservations:
        """Those of the other images."""
        rows = [row for row, image in enumerate(self.poses.images) if image not in images]
        kept = self.poses.select([self.poses.images[row] for row in rows])
        return PoseObservations(kept, self.centre_sigmas[rows], self.rotation_sigma)


@dataclass(eq=False)
class Instruments:
    """Clinometers and what they read.

    Attributes:
        clinometers: that cameras carry.
        inclinations: their readings.
        right_angles: names of two clinometers whose axes are at right angles, and a sigma (radians).
        vertical: (3,) upwards, in the world.
        vertical_is_free: whether it is an unknown.
    """

    clinometers: list[Clinometer] = field(default_factory=list)
    inclinations: list[Inclinations] = field(default_factory=list)
    right_angles: list[tuple[str, str, float]] = field(default_factory=list)
    vertical: tuple[float, float, float] = (0.0, 0.0, 1.0)
    vertical_is_free: bool = False


@dataclass(frozen=True)
class Rule:
    """What keeps its value, or is freed again, by patterns of names that match as a whole."""

    cameras: re.Pattern[str]
    parameters: re.Pattern[str]
    frozen: bool
