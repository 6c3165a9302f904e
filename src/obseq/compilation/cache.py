"""Compiled code kept in a folder of the user, one file per function, named by its digest.

The folder is `$OBSEQ_CACHE`, else `$NUMBA_CACHE_DIR`, else the platform's; each version of obseq and of the
compiler, and each kind of processor, has its own folder in it. A file is read whole or not at all: it begins
with a digest of the rest, and takes its name when it is complete. What cannot be read or written costs a
compilation, never a run.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import sys
import tempfile
from functools import cache
from pathlib import Path

from obseq.packages import version

LOGGER = logging.getLogger(__name__)
DIGEST_SIZE = hashlib.sha256().digest_size
KEPT_IN = "machine-code"


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
    try:
        content = path.read_bytes()
    except OSError:
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
        folder().mkdir(parents=True, exist_ok=True)
        _write_whole(folder() / f"{symbol}.nbc", hashlib.sha256(code).digest() + code)
    except OSError as error:
        _say_once(str(folder()), error.strerror or str(error))


def _write_whole(path: Path, content: bytes) -> None:
    """Writes beside, then renames: other processes see no file or the whole one."""
    descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=".writing-")
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
        Path(name).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(name).unlink()
        raise


@cache
def _say_once(place: str, reason: str) -> None:
    LOGGER.warning(
        "compiled code cannot be kept in %s (%s): each process compiles anew. "
        "Set OBSEQ_CACHE to a folder that can be written",
        place,
        reason,
    )
