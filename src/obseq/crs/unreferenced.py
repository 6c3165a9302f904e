"""Systems without a place on the Earth: Local, and an RTL whose origin is still to be chosen."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy.typing as npt

from obseq.arrays import FloatArray
from obseq.crs.system import CoordinateSystem, Kind
from obseq.errors import CrsError


@dataclass(frozen=True)
class UnreferencedSystem(CoordinateSystem):
    """A Local system, which converts to itself only, or a bare RTL, unusable until it is completed."""

    @property
    def kind(self) -> Kind:
        """Local or RTL."""
        return Kind.LOCAL_TANGENT if self.definition == "RTL" else Kind.LOCAL

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
