"""Results in files by their suffix."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from obseq.errors import InputError
from obseq.writing import Content, write_all


def save(writers: Mapping[str, Callable[[], Content]], path: str | Path) -> None:
    """Writes a result in the format that the suffix says.

    Args:
        writers: What makes the text, by suffix.
        path: Of the file.

    Raises:
        InputError: The suffix is that of no format, or the file cannot be written.
    """
    write = writers.get(Path(path).suffix.lower())
    if write is None:
        raise InputError(f"{path}: a result is saved as {', '.join(writers)}; end the name so")
    write_all({Path(path): write()})
