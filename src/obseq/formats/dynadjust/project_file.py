"""Project files of DynAdjust (`.dnaproj`): the files of a network, and options that change it.

A section begins with `#`; a line of it is the name of an option, then its value. What becomes of a network in
another way than here (segmentation, iterations, reports) has no part. What changes its measurements is
refused, unless it has the value of a new project.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from obseq.errors import InputError
from obseq.formats.dynadjust.reader import read_dna, read_dynaml
from obseq.formats.includes import Folder
from obseq.formats.project import Project, Reading, only_one
from obseq.reading.text import TextFile, quoted, read_text

SECTION = "import"
FILES, GEOID, GRID = "stn-msr-file", "geo-file", "ntv2-file"
UNCHANGED = {
    "override-input-ref-frame": "no",
    "include-msr-types": "",
    "exclude-msr-types": "",
    "bounding-box": "",
    "stn-renaming-file": "",
    "discontinuity-file": "",
    "baseline-scalar-file": "",
    "simulate-msr-file": "no",
    "v-scale": "1",
    "p-scale": "1",
    "l-scale": "1",
    "h-scale": "1",
    "constraints": "",
}
"""Options that change what is adjusted, and the value that leaves it as it is."""


def read_dnaproj(paths: tuple[Path, ...], reading: Reading) -> Project:
    """Reads the network of a project file.

    Raises:
        InputError: It names no files, or changes them in a way that nothing here does.
    """
    path = only_one(paths)
    file = read_text(path, reading.encoding)
    folder = Folder(path.parent, reading.encoding, reading.outside)
    files: list[Path] = []
    grids: list[str] = []
    for index, section, name, value in _options(file):
        if name in UNCHANGED and value not in (UNCHANGED[name], ""):
            raise file.error(
                index, f"{name} {quoted(value)} changes what is adjusted, which nothing here does: remove it"
            )
        if section == SECTION and value and name == FILES:
            files.append(folder.path(value))
        elif section == SECTION and value and name == GEOID and reading.geoid is None:
            reading = replace(reading, geoid=folder.path(value))
        elif value and name == GRID:
            grids.append(value)
    if not files:
        raise InputError(f"{path}: no {FILES} of the section #{SECTION} names a file of the network")
    are_xml = [found.suffix.lower() == ".xml" for found in files]
    if any(are_xml) and not all(are_xml):
        raise InputError(f"{path}: DNA files and DynaML files together are not read; give those of one form")
    found = (read_dynaml if all(are_xml) else read_dna)(tuple(files), reading)
    told = [
        f"{path}: {GRID} {grid} is not read: give its values at the stations (--geoid FILE)" for grid in grids
    ]
    return replace(found, book=found.book.warned(*told))


def _options(file: TextFile) -> list[tuple[int, str, str, str]]:
    """Line (from 0), section, name and value of each option."""
    found, section = [], ""
    for index, line in enumerate(file.lines):
        words = line.split()
        if line.startswith("#"):
            section = words[0][1:].lower() if words else ""
        elif words and not line.startswith("--"):
            found.append((index, section, words[0].lower(), " ".join(words[1:])))
    return found
