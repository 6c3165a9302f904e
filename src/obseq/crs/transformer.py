"""Conversion of points from one coordinate system to another."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from obseq.arguments import ARRAY, NOTHING, TEXTS, expecting, instance, require
from obseq.arrays import FloatArray
from obseq.cached import cached_property
from obseq.crs.point_arrays import as_points
from obseq.crs.system import CoordinateSystem
from obseq.crs.unreferenced import UnreferencedSystem
from obseq.dataclass import dataclass


@dataclass(frozen=True)
class Transformer:
    """Converts points from `source` to `target` through geocentric WGS 84 coordinates, as MMVII does.

    Equal systems convert by identity. A Local system converts to itself, and to the same plane with other
    axes (`Local*sw`).

    Raises:
        CrsError: if one of two different systems is Local, or one is an RTL without origin.

    Example:
        >>> from obseq import crs
        >>> to_frame = crs.Transformer(crs.parse("L93"), crs.parse("RTL*657700*6860700*0*L93"))
        >>> to_frame.forward([657700.0, 6860700.0, 10.0]).round(6) + 0.0
        array([ 0.,  0., 10.])
    """

    source: CoordinateSystem
    target: CoordinateSystem

    def __post_init__(self) -> None:
        for name, system in (("source", self.source), ("target", self.target)):
            require("Transformer", name, system, instance(CoordinateSystem))
            if isinstance(system, UnreferencedSystem) and self.turn is None:
                system.refuse()

    @property
    def is_identity(self) -> bool:
        """Whether the two systems are equal."""
        return self.source == self.target

    @cached_property
    def turn(self) -> FloatArray | None:
        """(3, 3) that makes coordinates of one of two Local systems those of the other; None elsewhere."""
        source, target = self.source, self.target
        if isinstance(source, UnreferencedSystem) and source.is_complete:
            return source.turn_to(target)
        return None

    @expecting(points=ARRAY, names=TEXTS | NOTHING)
    def forward(self, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
        """Coordinates in `target` of points (n, 3) of `source`; a new array."""
        if self.is_identity:
            return np.array(as_points(points))
        if self.turn is not None:
            return as_points(points) @ self.turn.T
        return self.target.from_geocentric(self.source.to_geocentric(points, names), names)

    def inverse(self, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
        """Coordinates in `source` of points (n, 3) of `target`; a new array."""
        return Transformer(self.target, self.source).forward(points, names)
