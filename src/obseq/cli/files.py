"""Writing results: refused before the work when they cannot be written, and never half-written."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from obseq.errors import InputError


def check_writable(outputs: Iterable[Path], inputs: Iterable[Path] = ()) -> None:
    """Find out, before any computation, that an output cannot be written.

    Raises:
        InputError: An output is a folder, is given twice, would replace an input, or its folder refuses it.
    """
    read = {path.resolve() for path in inputs}
    seen: set[Path] = set()
    for path in outputs:
        place = path.resolve()
        if place in read:
            raise InputError(f"{path}: writing the results here would replace an input; choose another name.")
        if place in seen:
            raise InputError(f"{path}: two results cannot be written to the same file; choose another name.")
        seen.add(place)
        _check(path)


def write_all(texts: Mapping[Path, str]) -> None:
    """Write all the files or none: each is written beside its place, then they replace what was there.

    Raises:
        InputError: A file cannot be written (a full disk, for instance).
    """
    staged: dict[Path, Path] = {}
    try:
        for path, text in texts.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            target = path.resolve()
            if _is_stream(target):
                target.write_text(text, encoding="utf-8")
            else:
                staged[_beside(target)] = target
                _beside(target).write_text(text, encoding="utf-8")
        for temporary, target in staged.items():
            temporary.replace(target)
    except OSError as error:
        raise InputError(f"{error.filename}: the results cannot be written ({error.strerror}).") from error
    finally:
        for temporary in staged:
            temporary.unlink(missing_ok=True)


def _check(path: Path) -> None:
    if path.is_dir():
        raise InputError(f"{path} is a folder; give the name of a file.")
    if _is_stream(path):
        return
    folder = next(parent for parent in path.resolve().parents if parent.exists())
    try:
        if path.exists() and not os.access(path, os.W_OK):
            raise PermissionError(None, "the file is read-only")
        trial = _beside(folder / path.name)
        trial.touch(exist_ok=False)
        trial.unlink()
    except OSError as error:
        raise InputError(f"{path}: the results cannot be written there ({error.strerror}).") from error


def _is_stream(path: Path) -> bool:
    """Whether the path is something to write to as it is: a terminal, a pipe, /dev/null."""
    return path.exists() and not path.is_file() and not path.is_dir()


def _beside(path: Path) -> Path:
    """The temporary file that becomes `path`: in the same folder, so that the replacement is atomic."""
    return path.with_name(f".{path.name}.{os.getpid()}.part")
