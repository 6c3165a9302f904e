"""The same data given twice: files that are named twice are refused."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from obseq.errors import InputError
from obseq.reading.text import read_bytes

TWICE = "what it holds would count twice; name it once"


def require_distinct(paths: Sequence[str | Path]) -> None:
    """Refuses a file that is named twice, through a link or by its content too.

    Raises:
        InputError: naming both.
    """
    if len(paths) < 2:
        return
    files = [Path(path) for path in paths]
    places: dict[Path, Path] = {}
    for file in files:
        first = places.setdefault(_place(file), file)
        if first is not file:
            raise InputError(f"{file}: is the same file as {first}: {TWICE}")
    contents: dict[str, Path] = {}
    for file in _of_equal_size(files):
        first = contents.setdefault(hashlib.sha256(read_bytes(file)).hexdigest(), file)
        if first is not file:
            raise InputError(f"{file}: holds the same as {first}, to the last byte: {TWICE}")


def require_another(paths: Sequence[str | Path], others: Sequence[str | Path]) -> None:
    """Refuses files of an epoch all of which are, through a link too, files of the epoch before.

    Raises:
        InputError: naming the first.
    """
    before = {_place(Path(path)) for path in others}
    if paths and all(_place(Path(path)) in before for path in paths):
        raise InputError(
            f"{paths[0]}: is given for both epochs, between which nothing can have moved then; give the "
            "files of the second epoch"
        )


def _place(file: Path) -> Path:
    """Where a file is; as it is written where links lead nowhere, or no file can be called so."""
    try:
        return file.resolve()
    except (OSError, RuntimeError, ValueError):
        return file


def _of_equal_size(files: Sequence[Path]) -> list[Path]:
    """Those of which another one has the same size; readers complain of what is no file."""
    sizes = [file.stat().st_size if file.is_file() else -1 for file in files]
    return [file for file, size in zip(files, sizes, strict=True) if size > 0 and sizes.count(size) > 1]
