"""Systems without a place on the Earth: Local, and an RTL whose origin is still to be chosen."""

from collections.abc import Sequence
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from obseq.arrays import FloatArray
from obseq.cached import cached_property
from obseq.crs.system import CoordinateSystem, Kind
from obseq.dataclass import dataclass
from obseq.errors import CrsError

LETTERS = {"e": (1.0, 0.0, 0.0), "n": (0.0, 1.0, 0.0), "w": (-1.0, 0.0, 0.0), "s": (0.0, -1.0, 0.0)}
"""Directions that an axis of a Local system may point to, in east, north and up."""
AXES = ("en", "es", "wn", "ws", "ne", "nw", "se", "sw")


@dataclass(frozen=True)
class UnreferencedSystem(CoordinateSystem):
    """A Local system, which converts to itself only, or a bare RTL, unusable until it is completed.

    `Local` has x to the east and y to the north. `Local*sw` is the same plane with x to the south and y to
    the west; so are the other pairs of directions, and these convert to each other.
    """

    @cached_property
    def axes(self) -> FloatArray | None:
        """(3, 3) its axes, by rows, in east, north and up; None for a system of unknown axes."""
        name, _, letters = self.definition.partition("*")
        if name != "Local" or (letters or "en") not in AXES:
            return None
        return np.array([*(LETTERS[letter] for letter in letters or "en"), (0.0, 0.0, 1.0)])

    @property
    def kind(self) -> Kind:
        """Local or RTL."""
        return Kind.LOCAL_TANGENT if self.definition == "RTL" else Kind.LOCAL

    def turn_to(self, other: CoordinateSystem) -> FloatArray | None:
        """(3, 3) that turns its coordinates into those of another Local system; None when nothing does."""
        if self == other:
            return np.eye(3)
        if not isinstance(other, UnreferencedSystem) or self.axes is None or other.axes is None:
            return None
        return np.asarray(other.axes @ self.axes.T)

    @property
    def is_complete(self) -> bool:
        """True for Local, False for RTL."""
        return self.kind is Kind.LOCAL

    def refuse(self) -> NoReturn:
        """Raises the error of every conversion.

        Raises:
            CrsError: always; it says what the system lacks.
        """
        if self.is_complete:
            raise CrsError(
                f"The system {self.definition!r} is local: it has no place on the Earth, no vertical, and "
                "converts to itself only. If these coordinates have a place, give their system."
            )
        raise CrsError(
            "The system 'RTL' has no origin yet: complete it with the mean of points "
            "(obseq.crs.complete_rtl), or write RTL*X0*Y0*Z0*DEFINITION."
        )

    def to_geocentric(self, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
        """Refused."""
        self.refuse()

    def from_geocentric(self, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
        """Refused."""
        self.refuse()

    def geocentric_pose(self) -> tuple[FloatArray, FloatArray]:
        """Refused."""
        self.refuse()

    def vertical_rotation(self, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
        """Refused."""
        self.refuse()
