"""Files of other programs, by what they are called and what they hold."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.errors import InputError
from obseq.formats.once import require_distinct
from obseq.formats.project import Reading, only_one
from obseq.printable import printable
from obseq.reading.text import encoding_of, quoted, read_bytes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.formats.project import Project, Reader


def _reader(module: str, name: str) -> Reader:
    """The reader of that name, which is loaded when it reads."""

    def read(paths: Sequence[Path], reading: Reading) -> Project:
        project: Project = getattr(import_module(f"obseq.formats.{module}"), name)(paths, reading)
        return project

    return read


def _read_comp3d(paths: Sequence[Path], reading: Reading) -> Project:
    from obseq.formats.comp3d.reader import read_comp3d

    return read_comp3d(only_one(tuple(paths)), reading)


def _read_starnet_project(paths: Sequence[Path], reading: Reading) -> Project:
    """Reads a project file of STAR*NET; one of another form is refused with the data files that it names."""
    from obseq.formats.starnet.project_file import is_project

    return (_read_starnet if is_project(paths[0]) else _refuse_starnet_project)(tuple(paths), reading)


def _refuse_starnet_project(paths: Sequence[Path], reading: Reading) -> Project:
    """Says which data files to give in place of a project file of STAR*NET in a form that is not known."""
    path = paths[0]
    text = read_bytes(path).decode("latin-1")
    named = [match.group(0).strip() for match in _DATA_FILE.finditer(text)]
    found = dict.fromkeys([*named, *([f"{path.stem}.dat"] if path.with_suffix(".dat").exists() else [])])
    files = ", ".join(printable(name) for name in list(found)[:MOST_NAMED]) or "its .dat files"
    raise InputError(
        f"{path}: the form of STAR*NET's project files is not published; give its data files ({files}), and "
        "what the project says beside them: --sigmas distance=... direction=..., --refraction, --points-crs; "
        "units and dimension as .UNITS and .2D or .3D in the data file (several files: .INCLUDE)"
    )


_read_dna, _read_gama = _reader("dynadjust.reader", "read_dna"), _reader("gama.reader", "read_gama")
_read_starnet = _reader("starnet.reader", "read_starnet")

READERS: dict[str, Reader] = {
    ".comp": _read_comp3d,
    ".gkf": _read_gama,
    ".snx": _reader("sinex.reader", "read_sinex"),
    ".csv": _reader("tables.reader", "read_tables"),
    ".dat": _read_starnet,
    ".snproj": _read_starnet,
    ".prj": _read_starnet_project,
    ".stn": _read_dna,
    ".msr": _read_dna,
}
"""Who reads the files with each suffix."""
ROOTS: dict[str, Reader] = {
    "DnaXmlFormat": _reader("dynadjust.reader", "read_dynaml"),
    "gama-local": _read_gama,
    "gama-xml": _read_gama,
    "LandXML": _reader("landxml.reader", "read_landxml"),
}
"""Who reads the XML files (.xml) with each root element."""
XML = ".xml"
FIELD_FILES = frozenset({".obs", ".cor"})
_FIRST_ELEMENT = re.compile(r"<([A-Za-z_][\w.:-]*)")
_DATA_FILE = re.compile(r"[^\s=\"'<>|,;*?\x00-\x1f][^=\"'<>|,;*?\x00-\x1f]{0,120}\.dat\b", re.IGNORECASE)
MOST_NAMED = 5
"""Data files that a message names."""
_START = 4096
DEFAULTS = Reading()


def read_project(paths: str | Path | Sequence[str | Path], reading: Reading = DEFAULTS) -> Project:
    """Reads what files of another program describe.

    Args:
        paths: The file, or the files that belong together.
        reading: How to read them.

    Raises:
        InputError: nobody reads such files, or something in them is wrong.
    """
    listed = [paths] if isinstance(paths, str | Path) else list(paths)
    named = tuple(Path(path) for path in listed)
    if not named:
        raise InputError("read_project: name a file")
    require_distinct(named)
    return reader_of(named[0])(named, reading)


def reader_of(path: Path) -> Reader:
    """Who reads a file.

    Raises:
        InputError: Nobody does.
    """
    suffix = path.suffix.lower()
    if suffix == XML:
        return _reader_of_root(path)
    reader = READERS.get(suffix)
    if reader is None:
        suffixes = ", ".join([*(known for known in READERS if known != ".prj"), XML])
        pair = "; observations and points in files of their own go with --obs and --cor"
        hint = pair if suffix in FIELD_FILES else ""
        raise InputError(f"{path}: files that can be adjusted by themselves end in {suffixes}{hint}")
    return reader


def _reader_of_root(path: Path) -> Reader:
    """By the first element; the whole file is looked at only where that is not found at its start."""
    start = read_bytes(path)[:_START]
    found = _FIRST_ELEMENT.search(start.decode(encoding_of(start), "replace"))
    name = found.group(1).rpartition(":")[2] if found else _root(path)
    reader = ROOTS.get(name)
    if reader is None:
        raise InputError(
            f"{path}: <{quoted(name)}> is not the root of a file that can be adjusted; these are "
            f"{', '.join(ROOTS)}"
        )
    return reader


def _root(path: Path) -> str:
    """The name of the first element, however far from the start it is."""
    from obseq.reading.xml import read_xml

    return read_xml(path).name
