"""Compiled code kept in a folder of the user, one file per function, named by its digest.

The folder is `$OBSEQ_CACHE`, else `$NUMBA_CACHE_DIR`, else the platform's; each version of obseq and of the
compiler, and each kind of processor, has its own folder in it. A file is read whole or not at all: it begins
with a digest of the rest, and takes its name when it is complete. What is in the folder is run: a file or a
folder that others may write is not read. What cannot be read or written costs a compilation, never a run.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import stat
import sys
from functools import cache
from pathlib import Path

from obseq.packages import version

LOGGER = logging.getLogger(__name__)
DIGEST_SIZE = hashlib.sha256().digest_size
KEPT_IN = "machine-code"
BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH
"""Permissions of others to write."""


def user_folder() -> Path:
    """The user's folder for what obseq builds: `$OBSEQ_CACHE`, `$NUMBA_CACHE_DIR`, or the platform's."""
    if chosen := os.environ.get("OBSEQ_CACHE") or os.environ.get("NUMBA_CACHE_DIR"):
        return Path(chosen)
    if sys.platform == "darwin":
        return _home() / "Library" / "Caches" / "obseq"
    return Path(os.environ.get("XDG_CACHE_HOME") or _home() / ".cache") / "obseq"


def _home() -> Path:
    """The home of the user; where nobody knows it, a place where nothing can be kept."""
    try:
        return Path.home()
    except RuntimeError:
        return Path(os.devnull)


def folder() -> Path:
    """Where code compiled by these versions for this processor is kept."""
    return user_folder() / KEPT_IN / _versions()


@cache
def _versions() -> str:
    from obseq.compilation.host import description

    names = ("obseq", "numba", "llvmlite")
    versions = [f"{name}-{version(name)}" for name in names]
    return "_".join([*versions, hashlib.sha256(description().encode()).hexdigest()[:12]])


def read(symbol: str) -> bytes | None:
    """The compiled code of that name; None if there is none that is whole. A damaged file is deleted."""
    path = folder() / f"{symbol}.nbc"
    content = read_own(path)
    if content is None:
        return None
    if hashlib.sha256(content[DIGEST_SIZE:]).digest() == content[:DIGEST_SIZE]:
        return content[DIGEST_SIZE:]
    LOGGER.warning("%s is damaged: it is compiled again", path)
    with contextlib.suppress(OSError):
        path.unlink()
    return None


def write(symbol: str, code: bytes) -> None:
    """Keeps compiled code for other processes; says once when that is not possible."""
    try:
        keep(folder() / f"{symbol}.nbc", hashlib.sha256(code).digest() + code)
    except OSError as error:
        _say_once(str(folder()), error.strerror or str(error))


def read_own(path: Path) -> bytes | None:
    """What a file below the user's folder holds; None without one, or where others may write it."""
    try:
        content = path.read_bytes()
        reason = written_by_others(path)
    except OSError:
        return None
    if reason:
        _warn_once(f"{reason}: what is kept there is not run, and made anew in each process")
        return None
    return content


def written_by_others(path: Path) -> str:
    """Why what is in a file may not be the user's own, in words; empty where nobody else may write it.

    The file counts, and the folders from it up to the user's folder. The administrator may write everything.
    """
    places = [path, *path.parents]
    last = places.index(user_folder()) if user_folder() in places else 0
    for place in places[: last + 1]:
        status = place.stat()
        if status.st_uid not in (os.geteuid(), 0):
            return f"{place} belongs to somebody else; remove it, or set OBSEQ_CACHE to a folder of your own"
        if status.st_mode & BY_OTHERS:
            return f"{place} may be written by others (chmod go-w {place})"
    return ""


def keep(path: Path, content: bytes) -> None:
    """Writes a file below the user's folder: beside its place first, so that others see all of it or none.

    Nobody else may write the folders that it needs, or the file.

    Raises:
        OSError: nothing can be written there.
    """
    for parent in reversed(path.parents):
        if not parent.exists():
            parent.mkdir(mode=0o700, exist_ok=True)
        elif user_folder() in parent.parents:
            _close_to_others(parent)
    import tempfile

    descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=".writing-")
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
        Path(name).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(name).unlink()
        raise


def _close_to_others(folder: Path) -> None:
    """Takes others the right to write a folder that is the user's own: versions before did not."""
    status = folder.stat()
    if status.st_uid == os.geteuid() and status.st_mode & BY_OTHERS:
        folder.chmod(stat.S_IMODE(status.st_mode) & ~BY_OTHERS)


def _say_once(place: str, reason: str) -> None:
    _warn_once(
        f"compiled code cannot be kept in {place} ({reason}): each process compiles anew. "
        "Set OBSEQ_CACHE to a folder that can be written"
    )


@cache
def _warn_once(words: str) -> None:
    LOGGER.warning("%s", words)
