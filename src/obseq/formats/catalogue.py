"""The formats that are read: what each is called, how its files are told, what reads them.

A line here is all that a format needs to be known by `obseq adjust`, its help, its errors, `obseq convert`
and the page of formats. A reader is loaded when it reads.
"""

from __future__ import annotations

import re
from enum import Enum
from pathlib import Path

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.reading.text import encoding_of, quoted, start_of


class Role(Enum):
    """What the files of a format are of a network.

    `NETWORK`: points and observations, as far as they go. `TABLE`: the one or the other, as its columns say.
    """

    NETWORK = "network"
    OBSERVATIONS = "observations"
    POINTS = "points"
    TABLE = "table"


@dataclass(frozen=True)
class Format:
    """A format.

    Attributes:
        name: What people call it.
        suffixes: How its files end, in small letters.
        reader: Module in this room and function, which takes paths and a `Reading` and gives a `Project`;
            empty where files are no network by themselves.
        role: What its files are.
        holds: What is read, for people.
        roots: Root elements of its XML files.
        sign: Expression that the beginning of its files matches; empty where only suffixes tell.
        point_reader: Of files of points: module and function, which takes a path and an encoding (see
            `obs.point_lists.PointReader`).
    """

    name: str
    suffixes: tuple[str, ...]
    reader: str
    role: Role
    holds: str
    roots: tuple[str, ...] = ()
    sign: str = ""
    point_reader: str = ""

    @property
    def told(self) -> str:
        """Name and suffixes, for lists."""
        return f"{self.name} ({' '.join(self.suffixes)})" if self.suffixes else self.name


OBS = Format(
    "OBS of Comp3D and MMVII",
    (".obs",),
    "",
    Role.OBSERVATIONS,
    "observations by code, set-ups, deflections, relative sigmas",
)
COR = Format("COR of Comp3D and MMVII", (".cor",), "", Role.POINTS, "points with flags and sigmas")


def _field_book(
    name: str,
    suffixes: tuple[str, ...],
    reader: str,
    holds: str,
    roots: tuple[str, ...] = (),
    sign: str = "",
) -> Format:
    """A format of field books."""
    what = f"field books: {holds}"
    return Format(name, suffixes, f"fieldbooks.{reader}", Role.NETWORK, what, roots, sign)


FORMATS = (
    Format(
        "Comp3D",
        (".comp",),
        "comp3d.reader:read_comp3d",
        Role.NETWORK,
        "projects: files, frame, options, sub-frames, axes, equalities",
    ),
    Format(
        "GNU Gama",
        (".gkf",),
        "gama.reader:read_gama",
        Role.NETWORK,
        "networks in a plane with heights, covariances, datum",
        ("gama-local", "gama-xml"),
    ),
    Format(
        "DynAdjust",
        (".stn", ".msr"),
        "dynadjust.reader:read_dna",
        Role.NETWORK,
        "stations and measurements of all types, frames and epochs",
        sign=r"!#=DNA",
    ),
    Format(
        "DynAdjust",
        (),
        "dynadjust.reader:read_dynaml",
        Role.NETWORK,
        "the same as XML (DynaML)",
        ("DnaXmlFormat",),
    ),
    Format(
        "DynAdjust",
        (".dnaproj",),
        "dynadjust.project_file:read_dnaproj",
        Role.NETWORK,
        "projects: files of stations and measurements, geoid",
    ),
    Format(
        "STAR*NET",
        (".dat", ".gps"),
        "starnet.reader:read_starnet",
        Role.NETWORK,
        "points, angles, sets, traverses, levels, GNSS vectors, inline options",
        sign=r"(?:\s*#[^\n]*\n|\s*\n)*\s*(?:\.(?:2D|3D|UNITS|ORDER|GPS)\b|G[01][ \t])",
    ),
    Format(
        "STAR*NET",
        (".snproj", ".prj"),
        "starnet.reader:read_starnet",
        Role.NETWORK,
        "projects: data files, units, grid, instruments with centring",
        sign=r"\s*\*STAR\*NET",
    ),
    Format(
        "SNAP",
        (".snp",),
        "snap.reader:read_snap",
        Role.NETWORK,
        "command files with their coordinate and data files: all data types, grids of New Zealand",
    ),
    Format(
        "SNAP",
        (".crd",),
        "snap.reader:refuse_part",
        Role.NETWORK,
        "coordinate and data files, of a command file",
        sign=r"(?:[^\n]*\n){1,60}?[ \t]*#[ \t]*data(?:[ \t]+\w+)*?[ \t]+"
        r"(?i:SD|HD|ED|MD|HA|ZD|AZ|PB|LV|GB|GX|GPS)\b",
    ),
    Format(
        "LandXML",
        (),
        "landxml.reader:read_landxml",
        Role.NETWORK,
        "surveys: points, set-ups, raw observations",
        ("LandXML",),
    ),
    Format(
        "SINEX",
        (".snx",),
        "sinex.reader:read_sinex",
        Role.NETWORK,
        "GNSS solutions: estimates, normal equations",
        sign=r"%=SNX",
    ),
    Format(
        "GVX",
        (".gvx",),
        "gvx.reader:read_gvx",
        Role.NETWORK,
        "GNSS vectors from mark to mark, with their covariances",
        ("GVX",),
    ),
    Format(
        "tables",
        (".csv",),
        "tables.reader:read_tables",
        Role.TABLE,
        "points, or observations of any kind, under named columns",
        point_reader="tables.reader:read_point_table",
    ),
    _field_book(
        "Leica GSI",
        (".gsi",),
        "gsi:read_gsi",
        "GSI-8, GSI-16",
        sign=r"\s*\*?(?:11|41)[\d.]{4}[+-][0-9A-Za-z?]{8}",
    ),
    _field_book("Trimble JobXML", (".jxl",), "jobxml:read_jobxml", "raw circles, prisms, air", ("JOBFile",)),
    _field_book(
        "Sokkia SDR",
        (".sdr",),
        "sdr:read_sdr",
        "SDR2x and SDR33, of Nikon and others too",
        sign=r"[\x02\s]*00NM ?SDR",
    ),
    _field_book(
        "Carlson RW5",
        (".rw5",),
        "rw5:read_rw5",
        "angles right and left, deflections, azimuths",
        sign=r"\s*(?:\d*\s*\n|\s*--[^\n]*\n)*\s*(?:--)?(?:JB,NM|MO,AD)",
    ),
    _field_book(
        "Nikon RAW",
        (),
        "nikon:read_nikon",
        "V2.00, of Ruide and Trimble M3 too (.raw, .sdr)",
        sign=r"CO,\s*[^\n]*\b(?:RAW|Raw) data",
    ),
    _field_book(
        "Zeiss and Trimble M5",
        (".m5",),
        "m5:read_m5",
        "M5, R5, R4 of total stations, and of digital levels",
        sign=r"\s*For[ _](?:M5|R5|R4)\|",
    ),
    _field_book(
        "Geodimeter",
        (".job", ".are"),
        "geodimeter:read_geodimeter",
        "labels of Geodimeter and Trimble",
        sign=r"\s*(?:\d{1,2}=[^\n]*\n){3}",
    ),
    _field_book(
        "Topcon GTS",
        (".gts7", ".gts"),
        "gts:read_gts",
        "GTS-7 (South, TopSURV) and GTS-210",
        sign=r"\x02?_'|[^\n]*\n?JOB {5}|JOB {5}",
    ),
    OBS,
    COR,
)
XML = ".xml"
START = 4096
"""Bytes of a file that tell what it is."""
_FIRST_ELEMENT = re.compile(r"<([A-Za-z_][\w.:-]*)")


def format_of(path: Path) -> Format:
    """The format of a file: by its root element, how it begins, or its suffix.

    Raises:
        InputError: Nothing here reads it.
    """
    suffix = path.suffix.lower()
    if suffix == XML:
        return _of_root(path)
    start = beginning(path)
    for known in FORMATS:
        if known.sign and re.match(known.sign, start):
            return known
    for known in FORMATS:
        if suffix in known.suffixes:
            return known
    if start.lstrip().startswith("<?xml"):
        return _of_root(path)
    raise InputError(f"{path}: its format is not known; files that are read: {listing()}")


def beginning(path: Path) -> str:
    """How a file begins."""
    start = start_of(path, START)
    return start.decode(encoding_of(start), "replace")


def listing() -> str:
    """All formats that are read, with their suffixes."""
    named: dict[str, list[str]] = {}
    for known in FORMATS:
        named.setdefault(known.name, []).extend([*known.suffixes, *([XML] if known.roots else [])])
    found = ((name, " ".join(dict.fromkeys(ends))) for name, ends in named.items())
    return ", ".join(f"{name} ({ends})" if ends else name for name, ends in found)


def _of_root(path: Path) -> Format:
    """By the first element; the whole file is looked at only where that is not found at its start."""
    found = _FIRST_ELEMENT.search(beginning(path))
    name = found.group(1).rpartition(":")[2] if found else _root(path)
    for known in FORMATS:
        if name in known.roots:
            return known
    roots = ", ".join(root for known in FORMATS for root in known.roots)
    raise InputError(
        f"{path}: <{quoted(name)}> is not the root of a file that can be adjusted; these are {roots}"
    )


def _root(path: Path) -> str:
    """The name of the first element, however far from the start it is."""
    from obseq.reading.xml import read_xml

    return read_xml(path).name
