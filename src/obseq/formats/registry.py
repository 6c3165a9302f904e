"""Files of other programs, by what they are called and what they hold (see `catalogue`)."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path

from obseq.errors import InputError
from obseq.formats.catalogue import Format, Role, format_of, listing
from obseq.formats.once import require_distinct
from obseq.formats.project import Project, Reading
from obseq.printable import printable
from obseq.reading.text import read_bytes

_DATA_FILE = re.compile(r"[^\s=\"'<>|,;*?\x00-\x1f][^=\"'<>|,;*?\x00-\x1f]{0,120}\.dat\b", re.IGNORECASE)
MOST_NAMED = 5
"""Data files that a message names."""
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
    found = _format_of_project(named[0])
    return reader_of(found)(named, reading)


def reader_of(found: Format) -> Callable[..., Project]:
    """What reads files of a format, which is loaded here."""
    module, _, name = found.reader.partition(":")
    reader: Callable[..., Project] = getattr(import_module(f"obseq.formats.{module}"), name)
    return reader


def _format_of_project(path: Path) -> Format:
    """The format of a file that is adjusted by itself.

    Raises:
        InputError: It holds observations or points alone, or is of a form that nobody knows.
    """
    found = format_of(path)
    if found.role in (Role.OBSERVATIONS, Role.POINTS):
        other = "points" if found.role is Role.OBSERVATIONS else "observations"
        raise InputError(
            f"{path}: holds {found.role.value} alone ({found.name}); name the file of {other} too. Files "
            f"that are read: {listing()}"
        )
    if found.suffixes[-1:] == (".prj",) and not read_bytes(path).lstrip().startswith(b"*STAR*NET"):
        _refuse_starnet_project(path)
    return found


def _refuse_starnet_project(path: Path) -> None:
    """Says which data files to give in place of a project file of STAR*NET in a form that is not known."""
    text = read_bytes(path).decode("latin-1")
    named = [match.group(0).strip() for match in _DATA_FILE.finditer(text)]
    found = dict.fromkeys([*named, *([f"{path.stem}.dat"] if path.with_suffix(".dat").exists() else [])])
    files = ", ".join(printable(name) for name in list(found)[:MOST_NAMED]) or "its .dat files"
    raise InputError(
        f"{path}: the form of STAR*NET's project files is not published; give its data files ({files}), and "
        "what the project says beside them: --sigmas distance=... direction=..., --refraction, --points-crs; "
        "units and dimension as .UNITS and .2D or .3D in the data file (several files: .INCLUDE)"
    )
