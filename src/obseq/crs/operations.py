"""The operation that leads from a PROJ definition to geocentric WGS 84, and geodetic coordinates by it.

pyproj is imported when first needed. Nothing here turns the network on, or silently does without a grid.
"""

import warnings
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from obseq.arrays import FloatArray
from obseq.crs.point_arrays import as_points, check_finite
from obseq.dataclass import dataclass
from obseq.errors import CrsError

if TYPE_CHECKING:
    import pyproj
    from pyproj.transformer import TransformerGroup

GEOCENTRIC = "EPSG:4978"
GEOGRAPHIC = "+proj=latlong +datum=WGS84"
KEPT_HEIGHTS = "@h"
"""What follows a definition whose heights are kept: no change of datum moves them."""
ROUNDING = 4e-9
"""What a geocentric coordinate may lose on the way there and back, metres: four units of its last place."""


@dataclass(frozen=True)
class Operation:
    """The transformation of a PROJ definition to geocentric WGS 84 coordinates.

    Attributes:
        description: PROJ's names of its steps.
        accuracy: PROJ's announced accuracy, metres; negative if unknown.
        transformer: the transformation, x or easting or longitude first.
    """

    description: str
    accuracy: float
    transformer: "pyproj.Transformer"

    def forward(self, points: FloatArray) -> FloatArray:
        """Geocentric coordinates of points (..., 3); not finite outside the domain."""
        return self._apply(points, "FORWARD")

    def inverse(self, points: FloatArray) -> FloatArray:
        """Coordinates of geocentric points (..., 3), to the rounding errors; not finite outside the domain.

        PROJ's inverse of a datum shift with rotations is off by up to a millimetre, and its heights by
        micrometres in the mountains. One correction by the forward transformation, where it is needed,
        removes that.
        """
        found = self._apply(points, "INVERSE")
        with np.errstate(invalid="ignore"):
            left = points - self.forward(found)
        wrong = np.abs(left).max(axis=-1) > ROUNDING
        if wrong.any():
            found[wrong] = self._apply(points[wrong] + left[wrong], "INVERSE")
        return found

    def _apply(self, points: FloatArray, direction: str) -> FloatArray:
        x, y, z = np.array(points.reshape(-1, 3).T, order="C")  # a copy, which PROJ may work in
        converted = np.empty((x.size, 3))
        converted.T[:] = self.transformer.transform(x, y, z, direction=direction, inplace=True)
        return converted.reshape(points.shape)


class HeightKeeping(Operation):
    """A transformation of the plan only: heights are taken as above the ellipsoid of WGS 84, as they are."""

    def _apply(self, points: FloatArray, direction: str) -> FloatArray:
        if direction == "FORWARD":
            return _at_heights(super()._apply(_level(points), direction), points[..., 2])
        place = geodetic_from_geocentric(points)
        found = super()._apply(_at_heights(points, np.zeros(points.shape[:-1])), direction)
        found = super()._apply(_at_heights(points, -found[..., 2]), direction)
        found[..., 2] = place[..., 2]
        return found


def _level(points: FloatArray) -> FloatArray:
    """The points (..., 3) at height 0."""
    return np.concatenate([points[..., :2], np.zeros_like(points[..., 2:])], axis=-1)


def _at_heights(geocentric: FloatArray, heights: FloatArray) -> FloatArray:
    """Geocentric points (..., 3) moved along their verticals to heights (...) above the ellipsoid."""
    degrees = geodetic_from_geocentric(geocentric)
    degrees[..., :2], degrees[..., 2] = np.rad2deg(degrees[..., :2]), heights
    return operation_of(GEOGRAPHIC).forward(degrees)


def from_geocentric(definition: str, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
    """Coordinates in the system of a PROJ definition of geocentric WGS 84 points (metres)."""
    given = as_points(points)
    moved = operation_of(definition).inverse(given)
    check_finite(moved, given, f"(geocentric) is outside the domain of {definition!r}.", names)
    return moved


def geodetic_from_geocentric(points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
    """Longitude, latitude (radians), ellipsoidal height (metres) on WGS 84 of geocentric points (..., 3)."""
    place = from_geocentric(GEOGRAPHIC, points, names)
    place[..., :2] = np.deg2rad(place[..., :2])
    return place


@lru_cache(maxsize=256)
def operation_of(definition: str) -> Operation:
    """The operation from a PROJ definition to geocentric WGS 84, chosen once."""
    import pyproj

    if definition.endswith(KEPT_HEIGHTS):
        plain = operation_of(definition.removesuffix(KEPT_HEIGHTS))
        return HeightKeeping(f"{plain.description}, heights kept", plain.accuracy, plain.transformer)
    group = _candidates(definition)
    if not group.best_available:
        raise CrsError(_missing_grids(definition, group))
    if not group.transformers:
        raise CrsError(_ballpark_only(definition))
    best = group.transformers[0]
    # Those of a group may not be used in several threads; one made again from its text may.
    return Operation(best.description, best.accuracy, pyproj.Transformer.from_pipeline(best.definition))


def _candidates(definition: str) -> "TransformerGroup":
    """PROJ's operations to geocentric WGS 84, the most relevant first, without ballpark ones."""
    from pyproj.transformer import TransformerGroup

    source = known_crs(definition).to_3d()
    with warnings.catch_warnings():  # pyproj warns of a missing grid; we raise
        warnings.simplefilter("ignore", UserWarning)
        try:
            return TransformerGroup(source, GEOCENTRIC, always_xy=True, allow_ballpark=False)
        except IndexError:  # pyproj's, when no operation is left
            raise CrsError(_ballpark_only(definition)) from None


@lru_cache(maxsize=256)
def known_crs(definition: str) -> "pyproj.CRS":
    """What PROJ knows of a definition.

    Raises:
        CrsError: if it does not know it, or knows it as something else than a system of positions.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError as ProjError

    definition = definition.removesuffix(KEPT_HEIGHTS)
    if "proj=pipeline" in definition:
        raise CrsError(f"{definition!r} is a transformation, not a coordinate system.")
    with warnings.catch_warnings():  # "+init=" is deprecated, and unambiguous here
        warnings.simplefilter("ignore", FutureWarning)
        try:
            crs = CRS.from_user_input(definition)
        except ProjError as error:
            raise CrsError(_unknown(definition, str(error))) from None
    if not (crs.is_geographic or crs.is_projected or crs.is_geocentric):
        raise CrsError(f"{definition!r} ({crs.name}, {crs.type_name}) does not give a position on the Earth.")
    return crs


def _unknown(definition: str, said: str) -> str:
    return (
        f"Unknown coordinate system {definition!r}. Accepted: Local..., GeoC, "
        "LEuc*TX*TY*TZ*OMEGA*PHI*KAPPA, RTL*X0*Y0*Z0*DEFINITION, the aliases L93 and Geog, or what PROJ "
        f"knows, such as EPSG:2154, IGNF:LAMB93 or '+proj=utm +zone=31 +datum=WGS84'. PROJ said: {said}"
    )


def _missing_grids(definition: str, group: "TransformerGroup") -> str:
    """What to do about the grids that the best operation needs."""
    best = group.unavailable_operations[0]
    grids = sorted({grid.short_name for grid in best.grids if not grid.available})
    download = " ".join(f"`pyproj sync --file {grid}`" for grid in grids)
    is_compound = bool(known_crs(definition).is_compound)
    levelled = "the system of the plan alone, in which heights are taken as levelled; " if is_compound else ""
    return (
        f"The transformation of {definition!r} to WGS 84 ({best.name}) needs a grid that is not installed: "
        f"{', '.join(grids)}. Install it with {download}, or put the file in PROJ's data folder "
        f"(PROJ_DATA); or give a definition that needs none: {levelled}with ellipsoidal heights, or with "
        "'+towgs84=' parameters of your choice."
    )


def _ballpark_only(definition: str) -> str:
    return (
        f"PROJ knows no transformation of {definition!r} to WGS 84 but a ballpark one, metres to hundreds of "
        "metres off. Say how its datum lies: '+datum=', or '+towgs84=' (0,0,0 if it is WGS 84)."
    )
