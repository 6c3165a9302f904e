"""Files of other programs, by what they are called and what they hold."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.errors import InputError
from obseq.survey.files import tables
from obseq.survey.files.comp3d import read_comp3d
from obseq.survey.files.dynadjust import MSR, STN, read_dna, read_dynaml
from obseq.survey.files.dynaml import ROOT
from obseq.survey.files.gama import read_gama
from obseq.survey.files.landxml import ROOT as LANDXML
from obseq.survey.files.landxml import read_landxml
from obseq.survey.files.project import Reading, only_one
from obseq.survey.files.sinex import SUFFIX, read_sinex
from obseq.survey.files.starnet import read_starnet
from obseq.survey.files.text import quoted, read_bytes
from obseq.survey.files.xml_file import read_xml

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.survey.files.project import Project, Reader

READERS: dict[str, Reader] = {
    ".comp": lambda paths, reading: read_comp3d(only_one(paths), reading),
    ".gkf": read_gama,
    SUFFIX: read_sinex,
    tables.SUFFIX: tables.read_tables,
    ".dat": read_starnet,
    STN: read_dna,
    MSR: read_dna,
}
"""Who reads the files with each suffix."""
ROOTS: dict[str, Reader] = {
    ROOT: read_dynaml,
    "gama-local": read_gama,
    "gama-xml": read_gama,
    LANDXML: read_landxml,
}
"""Who reads the XML files (.xml) with each root element."""
XML = ".xml"
_FIRST_ELEMENT = re.compile(r"<([A-Za-z_][\w.:-]*)")
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
        suffixes = ", ".join([*READERS, XML])
        raise InputError(f"{path}: files that can be adjusted by themselves end in {suffixes}")
    return reader


def _reader_of_root(path: Path) -> Reader:
    """By the first element; the whole file is looked at only where that is not found at its start."""
    found = _FIRST_ELEMENT.search(read_bytes(path)[:_START].decode("utf-8", "replace"))
    name = found.group(1).rpartition(":")[2] if found else read_xml(path).name
    reader = ROOTS.get(name)
    if reader is None:
        raise InputError(
            f"{path}: <{quoted(name)}> is not the root of a file that can be adjusted; these are "
            f"{', '.join(ROOTS)}"
        )
    return reader
