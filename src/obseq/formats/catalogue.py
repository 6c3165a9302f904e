"""The formats that are read: what each is called, how its files are told, what reads them.

A line here is all that a format needs to be known by `obseq adjust`, its help, its errors, `obseq convert`
and the page of formats. A reader is loaded when it reads.
"""

from __future__ import annotations

import re
from enum import Enum
from typing import TYPE_CHECKING

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.reading.text import encoding_of, quoted, read_bytes

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


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
        "STAR*NET",
        (".dat",),
        "starnet.reader:read_starnet",
        Role.NETWORK,
        "points, angles, sets, traverses, levels, GNSS vectors, inline options",
        sign=r"(?:\s*#[^\n]*\n|\s*\n)*\s*\.(?:2D|3D|UNITS|ORDER)\b",
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
        "tables",
        (".csv",),
        "tables.reader:read_tables",
        Role.TABLE,
        "points, or observations of any kind, under named columns",
        point_reader="tables.reader:read_point_table",
    ),
    Format(
        "Leica GSI",
        (".gsi",),
        "leica.reader:read_gsi",
        Role.NETWORK,
        "field books: set-ups, directions, zenith angles, distances, both faces, heights",
        sign=r"\s*\*?(?:11|41)[\d.]{4}[+-][0-9A-Za-z]{8}",
    ),
    OBS,
    COR,
)
UNREAD = (
    Format("Sokkia SDR", (), "", Role.NETWORK, "", sign=r"00NMSDR"),
    Format("Carlson RW5", (), "", Role.NETWORK, "", sign=r"(?:--[^\n]*\n)*JB,NM"),
    Format("Trimble JobXML", (), "", Role.NETWORK, "", ("JOBFile",)),
    Format("Nikon RAW", (), "", Role.NETWORK, "", sign=r"CO,\s*Nikon"),
    Format("Trimble or Zeiss M5", (), "", Role.NETWORK, "", sign=r"For M5\|"),
    Format("Topcon GTS", (), "", Role.NETWORK, "", sign=r"_'"),
)
"""Formats that are known by their content, so that a message can name them."""

XML = ".xml"
START = 4096
"""Bytes of a file that tell what it is."""
_FIRST_ELEMENT = re.compile(r"<([A-Za-z_][\w.:-]*)")


def format_of(path: Path) -> Format:
    """The format of a file: by its root element, its suffix, or how it begins.

    Raises:
        InputError: Nothing here reads it; the message says what it looks like.
    """
    suffix = path.suffix.lower()
    if suffix == XML:
        return _of_root(path)
    for known in FORMATS:
        if suffix in known.suffixes:
            return known
    start = beginning(path)
    if start.lstrip().startswith("<?xml"):
        return _of_root(path)
    like = next(_signed(start), None)
    if like in FORMATS:
        return like
    looks = f": this looks like {like.name}, which nothing here reads" if like is not None else ""
    raise InputError(f"{path}{looks or ': its format is not known'}; files that are read: {listing()}")


def beginning(path: Path) -> str:
    """How a file begins."""
    start = read_bytes(path)[:START]
    return start.decode(encoding_of(start), "replace")


def listing() -> str:
    """All formats that are read, with their suffixes."""
    named: dict[str, list[str]] = {}
    for known in FORMATS:
        named.setdefault(known.name, []).extend([*known.suffixes, *([XML] if known.roots else [])])
    return ", ".join(f"{name} ({' '.join(dict.fromkeys(ends))})" for name, ends in named.items())


def _signed(start: str) -> Iterator[Format]:
    """Formats whose sign the beginning of a file shows."""
    return (known for known in (*FORMATS, *UNREAD) if known.sign and re.match(known.sign, start))


def _of_root(path: Path) -> Format:
    """By the first element; the whole file is looked at only where that is not found at its start."""
    found = _FIRST_ELEMENT.search(beginning(path))
    name = found.group(1).rpartition(":")[2] if found else _root(path)
    for known in FORMATS:
        if name in known.roots:
            return known
    like = next((known.name for known in UNREAD if name in known.roots), "")
    looks = f": this looks like {like}, which nothing here reads" if like else ""
    roots = ", ".join(root for known in FORMATS for root in known.roots)
    raise InputError(
        f"{path}{looks}: <{quoted(name)}> is not the root of a file that can be adjusted; these are {roots}"
    )


def _root(path: Path) -> str:
    """The name of the first element, however far from the start it is."""
    from obseq.reading.xml import read_xml

    return read_xml(path).name
