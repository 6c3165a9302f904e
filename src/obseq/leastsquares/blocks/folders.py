"""Folders of runs: each run has its own, which nobody else takes as long as it lives."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import gettempdir, mkdtemp
from typing import IO

from obseq.errors import InputError

PREFIX = "obseq-blocks-"


def claimed(work: str | Path | None, resume: bool, tell: Callable[[str], None]) -> tuple[IO[str], Path]:
    """A folder of one's own, with the file that says so as long as it is open.

    Args:
        work: where it is made; None for where temporary files are.
        resume: take the newest one there that a run has left.
        tell: receives what else is there.

    Raises:
        InputError: the folder cannot be made or written.
    """
    place = Path(gettempdir() if work is None else work)
    try:
        place.mkdir(parents=True, exist_ok=True)
        left = _left(place) if work is not None else []
        if resume and left:
            for claim, _ in left[1:]:
                claim.close()
            tell(f"blocks: {left[0][1]} is taken up")
            return left[0]
        for claim, folder in left:
            tell(f"blocks: {folder} is left of a run that was stopped: resume takes it up, or remove it")
            claim.close()
        if resume:
            tell(f"blocks: nothing is left in {place} to be taken up")
        folder = Path(mkdtemp(prefix=PREFIX, dir=place))
        own = _claim(folder)
    except OSError as error:
        raise InputError(f"{place}: blocks cannot be kept there: {error.strerror or error}") from error
    if own is None:
        raise InputError(f"{place}: blocks cannot be kept there: its files cannot be locked")
    return own, folder


def _left(place: Path) -> list[tuple[IO[str], Path]]:
    """The folders of runs that have ended before their end, the newest first, claimed."""
    folders = sorted(place.glob(f"{PREFIX}*"), key=lambda folder: folder.stat().st_mtime, reverse=True)
    claims = [(_claim(folder), folder) for folder in folders if folder.is_dir()]
    return [(claim, folder) for claim, folder in claims if claim is not None]


def _claim(folder: Path) -> IO[str] | None:
    """The lock of a folder; None where a living process has it."""
    file = (folder / "lock").open("a")
    try:
        import fcntl
    except ImportError:  # Windows: an open file cannot be removed, which is as good
        return file
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        return None
    return file
