"""Reading the definitions of coordinate systems, and writing those of local tangent frames."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from obseq.arguments import ARRAY, TABLE, TEXT, expecting, instance
from obseq.arrays import FloatArray
from obseq.crs.point_arrays import as_points, check_finite
from obseq.crs.proj import ProjSystem, proj_system
from obseq.crs.rigid import LocalTangent, geocentric, local_euclidean, local_tangent
from obseq.crs.system import CoordinateSystem, Kind
from obseq.crs.unreferenced import UnreferencedSystem
from obseq.errors import CrsError

ALIASES: Mapping[str, str] = MappingProxyType({"L93": "IGNF:LAMB93", "Geog": "+proj=latlong +datum=WGS84"})
GEOCENTRIC_BASE = "+proj=geocent +datum=WGS84"
SYNTAX = {
    Kind.LOCAL_EUCLIDEAN: "LEuc*TX*TY*TZ*OMEGA*PHI*KAPPA (metres, radians)",
    Kind.LOCAL_TANGENT: "RTL*X0*Y0*Z0*DEFINITION",
}


@expecting(definition=TEXT, aliases=TABLE)
def parse(definition: str, aliases: Mapping[str, str] = ALIASES) -> CoordinateSystem:
    """The coordinate system of a definition.

    Accepted, told by how they begin: `Local...`; `GeoC`; `LEuc*TX*TY*TZ*Omega*Phi*Kappa` (metres, radians);
    `RTL*X0*Y0*Z0*DEFINITION` or `RTL` alone, to be completed; anything else is for PROJ. Axes are x, easting
    or longitude first, always: `RTL*2.42*48.84*0*EPSG:4326` has longitude 2.42.

    A PROJ definition followed by `@h` changes the datum of the plan only: heights stay what they are, above
    the ellipsoid of WGS 84.

    We go further than MMVII in two points: aliases are also resolved inside an RTL definition, and a trailing
    `*` (its documentation has one) is accepted and dropped.

    Args:
        definition: text of the definition, or an alias.
        aliases: names that stand for a definition.

    Raises:
        CrsError: if the definition is unknown or malformed; it quotes it and says what is accepted.
    """
    name = definition.strip()
    text = aliases.get(name, name).strip()
    if text.startswith(Kind.LOCAL):
        return UnreferencedSystem(text)
    if text.startswith(Kind.GEOCENTRIC):
        return geocentric(text)
    if text.startswith(Kind.LOCAL_EUCLIDEAN):
        return _parse_local_euclidean(text)
    if text == Kind.LOCAL_TANGENT:
        return UnreferencedSystem(text)
    if text.startswith(Kind.LOCAL_TANGENT):
        return _parse_local_tangent(text, aliases)
    return proj_system(text)


@expecting(points=ARRAY, source=instance(CoordinateSystem))
def complete_rtl(points: npt.ArrayLike, source: CoordinateSystem) -> LocalTangent:
    """The local tangent frame whose origin is the mean of points (n, 3) of the system `source`.

    Raises:
        CrsError: if there are no points, one is not finite, or the source has no place on the Earth.
    """
    given = as_points(points).reshape(-1, 3)
    if not len(given):
        raise CrsError("A local tangent frame (RTL) at the mean of points needs at least one point.")
    check_finite(given, given, "has no finite coordinates: the mean of the points is undefined.")
    return rtl_at(side_by_side(given, source).mean(axis=0), source)


def side_by_side(points: FloatArray, system: CoordinateSystem) -> FloatArray:
    """The points (n, 3) with longitudes within half a turn of the first: these have a mean."""
    return np.asarray(points[:1] + system.differences(points, points[:1]))


@expecting(origin=ARRAY, source=instance(CoordinateSystem))
def rtl_at(origin: npt.ArrayLike, source: CoordinateSystem) -> LocalTangent:
    """The local tangent frame at `origin` (3,), given in the system `source`.

    The definition gives the origin with 8 decimals, in `source` if that is a PROJ definition, else in
    geocentric coordinates.
    """
    if not isinstance(source, ProjSystem):
        origin, source = source.to_geocentric(origin), proj_system(GEOCENTRIC_BASE)
    decimals = [f"{round(float(value), 8) + 0.0:.8f}" for value in as_points(origin)]
    definition = "*".join(["RTL", *decimals, source.definition])
    x, y, z = (float(value) for value in decimals)
    return local_tangent(definition, (x, y, z), source)


def _parse_local_euclidean(text: str) -> CoordinateSystem:
    tokens = _tokens(text, Kind.LOCAL_EUCLIDEAN, 7)
    values = np.array(_numbers(tokens[1:], text))
    return local_euclidean("*".join(tokens), values[:3], values[3:])


def _parse_local_tangent(text: str, aliases: Mapping[str, str]) -> CoordinateSystem:
    tokens = _tokens(text, Kind.LOCAL_TANGENT, 5)
    x, y, z = _numbers(tokens[1:4], text)
    base = parse(tokens[4], aliases)
    if not isinstance(base, ProjSystem):
        raise CrsError(
            f"The origin of {text!r} must be given in a system that PROJ knows, not in {tokens[4]!r}."
        )
    return local_tangent("*".join([*tokens[:4], base.definition]), (x, y, z), base)


def _tokens(text: str, kind: Kind, count: int) -> list[str]:
    """The `count` parts of a definition, of which the first is its kind."""
    tokens = [token.strip() for token in text.split("*")]
    if len(tokens) == count + 1 and not tokens[-1]:
        tokens.pop()
    if len(tokens) != count or tokens[0] != kind or not all(tokens):
        raise CrsError(f"Malformed definition {text!r}: expected {SYNTAX[kind]}.")
    return tokens


def _numbers(tokens: Sequence[str], text: str) -> list[float]:
    return [_number(token, text) for token in tokens]


def _number(token: str, text: str) -> float:
    try:
        value = float(token)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise CrsError(f"Malformed definition {text!r}: {token!r} is not a number.")
    return value
