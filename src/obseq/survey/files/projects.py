"""Project files of other programs, by what they are called."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from obseq.errors import InputError
from obseq.survey.files.comp3d import read_comp3d

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.survey.files.comp3d import Project

READERS: dict[str, Callable[[str | Path, str, bool], Project]] = {".comp": read_comp3d}
"""Who reads the files with each suffix."""


def read_project(path: str | Path, encoding: str = "utf-8", outside: bool = False) -> Project:
    """Reads what a file of another program describes.

    Raises:
        InputError: nobody reads such files, or something in it is wrong.
    """
    reader = READERS.get(Path(path).suffix.lower())
    if reader is None:
        raise InputError(f"{path}: files that can be adjusted by themselves end in {', '.join(READERS)}")
    return reader(path, encoding, outside)
