"""Coordinate systems of SNAP by their codes."""

from __future__ import annotations

import re

import numpy as np

from obseq import crs
from obseq.arrays import FloatArray
from obseq.crs.frames import geographic_crs
from obseq.dataclass import dataclass
from obseq.errors import CrsError
from obseq.formats.dynadjust.stations import ELLIPSOID

OLD_DATUM = "+proj=longlat +ellps=intl +towgs84=0,0,0"
"""NZGD1949 on its own ellipsoid; a way to other datums is not needed."""
CIRCUITS = (
    *(
        "EDEN",
        "PLEN",
        "POVE",
        "HAWK",
        "TARA",
        "TUHI",
        "WANG",
        "WAIR",
        "WELL",
        "COLL",
        "NELS",
        "KARA",
        "BULL",
        "GREY",
    ),
    *(
        "AMUR",
        "MARL",
        "HOKI",
        "OKAR",
        "JACK",
        "PLEA",
        "GAWL",
        "TIMA",
        "LIND",
        "NICH",
        "YORK",
        "OBSE",
        "TAIE",
        "BLUF",
    ),
)
"""Meridional circuits of New Zealand, in the order of their numbers at EPSG."""
PROJECTIONS = {"NZTM": (2193, "NZGD2000"), "NZTM2000": (2193, "NZGD2000"), "NZMG": (27200, "NZGD1949")}
"""Number at EPSG and datum, by code."""
_FIRST = {"TM2000": (2105, "NZGD2000"), "TM1949": (27205, "NZGD1949")}
"""Number of the first circuit, and datum, by what ends a code."""
_EPOCH = re.compile(r"[(@][^)]*\)?$")


@dataclass(frozen=True)
class System:
    """A coordinate system.

    Attributes:
        datum: Its datum.
        projection: Number of its projection at EPSG; 0 for none.
        is_geocentric: Whether coordinates are X, Y and Z.
    """

    datum: str
    projection: int = 0
    is_geocentric: bool = False

    @property
    def definition(self) -> str:
        """Definition of longitude, latitude and height on its datum.

        Raises:
            CrsError: PROJ knows no datum of that name.
        """
        if self.datum == "NZGD1949":
            return OLD_DATUM
        definition = geographic_crs(self.datum)
        here = np.array([[173.0, -41.0, 0.0]])
        gap = crs.parse(definition).to_geocentric(here) - crs.parse(ELLIPSOID).to_geocentric(here)
        return definition if float(np.abs(gap).max()) < 1e-6 else ELLIPSOID

    def geodetic(self, coordinates: FloatArray) -> FloatArray:
        """(n, 3) longitude, latitude (degrees) and height of points (n, 3) of this system."""
        if self.is_geocentric:
            return crs.parse(self.definition).from_geocentric(coordinates)
        if not self.projection:
            return coordinates
        from pyproj import Proj

        east, north, height = coordinates.T
        longitude, latitude = Proj(f"EPSG:{self.projection}")(east, north, inverse=True)
        return np.column_stack([longitude, latitude, height])

    def grid(self, geodetic: FloatArray) -> FloatArray:
        """(n, 2) east and north of longitudes and latitudes (degrees)."""
        from pyproj import Proj

        return np.column_stack(Proj(f"EPSG:{self.projection}")(*geodetic[:, :2].T))


def system_of(code: str) -> System:
    """The system of a code such as NZGD2000, NZTM, WELLTM2000 or ITRF2008_XYZ.

    Raises:
        CrsError: It is none that is known.
    """
    name = _EPOCH.sub("", code.upper())
    if name in PROJECTIONS:
        number, datum = PROJECTIONS[name]
        return System(datum, number)
    if name[:4] in CIRCUITS and name[4:] in _FIRST:
        first, datum = _FIRST[name[4:]]
        return System(datum, first + CIRCUITS.index(name[:4]))
    found = System(name.removesuffix("_XYZ"), is_geocentric=name.endswith("_XYZ"))
    try:
        _ = found.definition
    except CrsError as error:
        raise CrsError(
            f"coordinate system {code}: {error}; known are datums, with _XYZ too, NZTM, NZMG and the "
            f"circuits ({CIRCUITS[0]}TM2000, ...)"
        ) from error
    return found
