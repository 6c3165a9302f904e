"""Files of a run: named by the digest of all that they are made of, and written whole or not at all.

So a file that is there is right. What a stopped run left is taken up, what a lost worker did not finish is
done again, twice the same task gives twice the same file, and other numbers never meet the old ones.
"""

from __future__ import annotations

import errno
import hashlib
import os
import pickle
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import mkstemp
from typing import IO, Any, TypeAlias

import numpy as np

from obseq.arrays import FloatArray, IndexArray
from obseq.errors import InputError
from obseq.version import __version__

Value: TypeAlias = Any
"""What a task is given and gives: arrays, names, what a file has; or what Dask is made of."""

VERSIONS = f"obseq {__version__}, numpy {np.__version__}, Python {sys.version_info[0]}.{sys.version_info[1]}"
"""What makes the numbers: it is part of every digest, and must be alike on all workers."""


def digest_of(*parts: object) -> str:
    """The name of what is made of these arrays, tuples of arrays, texts and numbers."""
    found = hashlib.blake2b(VERSIONS.encode(), digest_size=12)
    for part in parts:
        if isinstance(part, tuple):
            found.update(digest_of(*part).encode())
        elif isinstance(part, np.ndarray):
            found.update(repr(part.shape).encode())
            found.update(np.ascontiguousarray(part).data)
        else:
            found.update(repr(part).encode())
        found.update(b"|")
    return found.hexdigest()


def write(path: Path, save: Callable[[IO[bytes]], object]) -> None:
    """Writes a file beside its place, which it takes when it is complete.

    Raises:
        InputError: the disk is full, or refuses it.
    """
    if path.exists():
        return
    name = None
    try:
        descriptor, name = mkstemp(dir=path.parent, prefix=".")
        with os.fdopen(descriptor, "wb") as file:
            save(file)
        Path(name).replace(path)
    except BaseException as error:
        if name is not None:
            with suppress(OSError):
                Path(name).unlink()
        if isinstance(error, OSError):
            raise _told(path, error) from error
        raise


def _told(path: Path, error: OSError) -> InputError:
    if error.errno == errno.ENOSPC:
        return InputError(f"{path.parent}: the disk is full; make room, or name another folder (--work)")
    return InputError(f"{path.parent}: blocks cannot be written: {error.strerror or error}")


def write_numbers(path: Path, numbers: FloatArray | IndexArray) -> None:
    """Writes numbers as they are in memory."""
    write(path, np.ascontiguousarray(numbers).tofile)


def read_numbers(path: Path) -> FloatArray:
    """What `write_numbers` wrote."""
    return np.fromfile(path)


def write_object(path: Path, thing: object) -> None:
    """Writes anything that can be copied."""
    write(path, lambda file: pickle.dump(thing, file, protocol=5))


def read_object(path: Path) -> Value:
    """What `write_object` wrote."""
    with path.open("rb") as file:
        return pickle.load(file)
