"""Two kinds of z: ellipsoidal heights, and altitudes above a geoid grid; and the alteration of shots."""

from __future__ import annotations

from dataclasses import field
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import CrsError, InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pyproj

    from obseq.arrays import FloatArray
    from obseq.images.aerial.mapping import MapSystem


class HeightType(Enum):
    """What a z is counted from."""

    ALTITUDE = "altitude"
    """Above the geoid grid."""
    HEIGHT = "height"
    """Above the ellipsoid."""


@dataclass(frozen=True)
class Geoid:
    """Geoid grids that PROJ reads, tried in order: height = altitude + undulation, bilinear in the grid.

    Attributes:
        grids: paths, or names that PROJ finds in its data folders.

    Raises:
        InputError: if a grid is not found; the message names it.
    """

    grids: tuple[str, ...]
    _shift: pyproj.Transformer = field(init=False, repr=False, compare=False)

    def __init__(self, grids: Sequence[str | Path] | str | Path) -> None:
        names = [grids] if isinstance(grids, str | Path) else list(grids)
        object.__setattr__(self, "grids", tuple(_where(name) for name in names))
        object.__setattr__(self, "_shift", _shift_of(self.grids))

    def __reduce__(self) -> tuple[type[Geoid], tuple[tuple[str, ...]]]:
        return Geoid, (self.grids,)

    def undulation(self, geodetic: FloatArray) -> FloatArray:
        """Height of the geoid above the ellipsoid (n,), metres, at longitude and latitude (n, 2), radians.

        Raises:
            CrsError: where no grid reaches.
        """
        lon, lat = np.rad2deg(geodetic.T)
        _, _, found = self._shift.transform(lon, lat, np.zeros_like(lon))
        shift = np.asarray(found, dtype=np.float64)
        outside = np.flatnonzero(~np.isfinite(shift))
        if outside.size:
            first = outside[0]
            raise CrsError(
                f"longitude {lon[first]:.6f}, latitude {lat[first]:.6f}: outside the geoid grid "
                f"{', '.join(self.grids)} ({outside.size} points); give a grid that covers the work."
            )
        return shift


def convert_heights(
    z: FloatArray,
    plan: FloatArray,
    given: HeightType | None,
    wanted: HeightType | None,
    system: MapSystem,
    geoid: Geoid | None,
) -> FloatArray:
    """Z (n,) of map points (n, 2), from one type to another; unchanged where one is unknown.

    Raises:
        InputError: if the types differ and there is no geoid.
    """
    if given is None or wanted is None or given is wanted:
        return z
    if geoid is None:
        raise InputError(
            f"z is given as {given.value} and wanted as {wanted.value}: give the geoid grid that joins them."
        )
    sign = 1.0 if wanted is HeightType.HEIGHT else -1.0
    return z + sign * geoid.undulation(system.geodetic(plan))


def add_alteration(z: FloatArray, alteration: FloatArray, nadir: FloatArray) -> FloatArray:
    """Z of shots enlarged so that the scale of the image is right in the map: z + alpha (z - nadir)."""
    return z + alteration * (z - nadir)


def remove_alteration(z: FloatArray, alteration: FloatArray, nadir: FloatArray) -> FloatArray:
    """The z of shots without the linear alteration of the map: inverse of `add_alteration`."""
    return (z + alteration * nadir) / (1.0 + alteration)


def _where(name: str | Path) -> str:
    """The path of a grid, or its name for PROJ to find."""
    path = Path(name)
    for candidate in (path, path.with_name(path.name + ".tif")):
        if candidate.is_file():
            return str(candidate.resolve())
    return str(name) if path.suffix else f"{name}.tif"


def _shift_of(grids: tuple[str, ...]) -> pyproj.Transformer:
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    for grid in grids:
        try:
            Transformer.from_pipeline(_pipeline(grid))
        except ProjError as error:
            raise InputError(
                f"geoid grid {grid}: not found, or not a grid that PROJ reads; give its path. PROJ: {error}"
            ) from None
    return Transformer.from_pipeline(_pipeline(",".join(grids)))


def _pipeline(grids: str) -> str:
    """From degrees and altitudes to degrees and heights."""
    there, back = "+xy_in=deg +xy_out=rad", "+xy_in=rad +xy_out=deg"
    shift = f'+proj=vgridshift +grids="{grids}" +multiplier=1'
    return f"+proj=pipeline +step +proj=unitconvert {there} +step {shift} +step +proj=unitconvert {back}"
