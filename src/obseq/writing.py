"""Writing files: refused before the work when impossible, never half-written, replaced together."""

import hashlib
import os
import re
import signal
import stat
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from typing import IO, TypeAlias

from obseq.errors import InputError

DAY = 86400.0
"""Age in seconds at which a leftover of another machine is no longer taken for a file being written."""

STANDARD_OUTPUT = Path("/dev/stdout")
"""What is written there goes to where the program prints, in its turn."""
SECOND = "-without-accused"
"""What the names of the files of a second adjustment end with."""
INTERRUPTIONS = (signal.SIGINT, signal.SIGTERM)
LEFTOVER = re.compile(r"\.obseq-[0-9a-f]{12}-(?P<machine>[0-9a-f]{8})-(?P<process>\d+)\.(part|old)")


def check_writable(outputs: Iterable[Path], inputs: Iterable[Path] = ()) -> None:
    """Find out, before any computation, that an output cannot be written.

    Raises:
        InputError: An output is a folder or a link to nothing, is given twice, would replace an input, or its
            folder refuses it.
    """
    read = {_resolved(path) for path in inputs}
    seen: set[Path] = set()
    for path in outputs:
        _refuse_dangling(path)
        place = _resolved(path)
        if place in read:
            raise InputError(f"{path}: writing the results here would replace an input; choose another name.")
        if place in seen:
            raise InputError(f"{path}: two results cannot be written to the same file; choose another name.")
        seen.add(place)
        _check(path)


def second_of(path: Path) -> Path:
    """Where a second adjustment goes, beside the first one."""
    return path.with_name(f"{path.stem}{SECOND}{path.suffix}")


def forget_second(paths: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Delete second adjustments of earlier runs beside new results, which they do not belong to."""
    read = {_resolved(path) for path in inputs}
    for path in map(second_of, paths):
        if path.is_file() and _resolved(path) not in read:
            path.unlink()


Content: TypeAlias = str | bytes | Callable[[IO[bytes]], None]
"""Of a file: a text, bytes, or what writes it."""


def write_all(texts: Mapping[Path, Content], told: Callable[[str, Exception], None] | None = None) -> None:
    """Write all the files or none: each is written beside its place, then they replace what was there.

    Texts are written in UTF-8 as they are, bytes too; what is too long for memory, a function writes. A file
    that is replaced hands its permissions on. What killed runs left behind for the same files is deleted. An
    interruption while files are being replaced waits until all are.

    Args:
        texts: What each file holds.
        told: Is told which function failed, and how; the other files are written then.

    Raises:
        InputError: A file cannot be written (a full disk, for instance).
    """
    staged: dict[Path, Path] = {}
    try:
        for path, text in texts.items():
            _refuse_dangling(path)
            path.parent.mkdir(parents=True, exist_ok=True)
            target = _resolved(path)
            if target == STANDARD_OUTPUT:
                _print(_encoded(text))
            elif _is_stream(target):
                _pour(target, text)
            else:
                _clean(target)
                staged[_beside(target, "part")] = target
                if not _is_written(_beside(target, "part"), text, target, told):
                    del staged[_beside(target, "part")]
        _replace_together(staged)
    except OSError as error:
        where = error.filename2 or path
        raise InputError(f"{where}: the results cannot be written ({error.strerror}).") from error
    except UnicodeEncodeError as error:
        raise InputError(f"{path}: {error.object[error.start]!r} cannot be written in UTF-8.") from error
    finally:
        for temporary in staged:
            temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write one file, as `write_all` does."""
    write_all({Path(path): text})


def _refuse_dangling(path: Path) -> None:
    if path == STANDARD_OUTPUT:
        return
    for place in (path, *path.parents):
        if place.is_symlink() and not place.exists():
            raise InputError(f"{path}: {place} is a link to something that does not exist; remove the link.")


def _resolved(path: Path) -> Path:
    if path == STANDARD_OUTPUT:
        return path
    try:
        return path.resolve()
    except (OSError, ValueError, RuntimeError) as error:  # a loop of links, a zero byte
        raise InputError(f"{str(path)!r} is not the name of a file ({error}).") from error


def _check(path: Path) -> None:
    if path == STANDARD_OUTPUT:
        return
    if path.is_dir():
        raise InputError(f"{path} is a folder; give the name of a file.")
    if _is_stream(path):
        return
    folder = next(parent for parent in path.resolve().parents if parent.exists())
    try:
        if path.exists() and not os.access(path, os.W_OK):
            raise PermissionError(None, "the file is read-only")
        trial = _beside(folder / path.name, "part")
        trial.touch(exist_ok=False)
        trial.unlink()
    except OSError as error:
        raise InputError(f"{path}: the results cannot be written there ({error.strerror}).") from error


def _is_stream(path: Path) -> bool:
    """Whether the path is something to write to as it is: a terminal, a pipe, /dev/null."""
    return path.exists() and not path.is_file() and not path.is_dir()


def _encoded(content: Content) -> bytes:
    if callable(content):
        held = BytesIO()
        content(held)
        return held.getvalue()
    return content.encode("utf-8") if isinstance(content, str) else content


def _print(data: bytes) -> None:
    sys.stdout.flush()
    sys.stdout.buffer.write(data)
    sys.stdout.flush()


def _pour(stream: Path, text: Content) -> None:
    """The text into something that is no file on a disk."""
    try:
        stream.write_bytes(_encoded(text))
    except OSError as error:  # which does not say itself where it was
        raise OSError(error.errno, error.strerror, str(stream)) from error


def _write(temporary: Path, text: Content, target: Path) -> None:
    """The text on the disk, with the owner and the permissions of the file that it will replace."""
    with temporary.open("wb") as file:
        if callable(text):
            text(file)
        else:
            file.write(_encoded(text))
        file.flush()
        os.fsync(file.fileno())
    if target.exists():
        before = target.stat()
        with suppress(PermissionError):
            os.chown(temporary, before.st_uid, before.st_gid)
        temporary.chmod(stat.S_IMODE(before.st_mode))


def _is_written(
    temporary: Path, text: Content, target: Path, told: Callable[[str, Exception], None] | None
) -> bool:
    """Write it; where its function fails by itself, that is told, and nothing is left."""
    try:
        _write(temporary, text, target)
    except (OSError, UnicodeEncodeError):
        raise
    except Exception as error:
        if told is None:
            raise
        told(str(target), error)
        temporary.unlink(missing_ok=True)
        return False
    return True


def _replace_together(staged: Mapping[Path, Path]) -> None:
    """Put all files in their places; when one refuses, those before it get their predecessors back."""
    done: list[Path] = []
    with _interruptions_held():
        kept = {target: _kept(target) for target in staged.values() if target.exists()}
        try:
            for temporary, target in staged.items():
                temporary.replace(target)
                done.append(target)
        except OSError:
            for target in done:
                _give_back(target, kept)
            raise
        finally:
            for old in filter(None, kept.values()):
                old.unlink(missing_ok=True)


def _kept(target: Path) -> Path | None:
    """A second name for a file that is to be replaced; None on a file system that has none."""
    old = _beside(target, "old")
    try:
        os.link(target, old)
    except OSError:
        return None
    return old


def _give_back(target: Path, kept: Mapping[Path, Path | None]) -> None:
    """Put the predecessor of a file back, or what was there when there was none: nothing."""
    if target not in kept:
        target.unlink()
    elif old := kept[target]:
        old.replace(target)


@contextmanager
def _interruptions_held() -> Iterator[None]:
    """Ctrl-C and SIGTERM wait until the block is done."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = {number: signal.signal(number, lambda n, _: came.append(n)) for number in INTERRUPTIONS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)
        if came:
            signal.raise_signal(came[0])


def _beside(path: Path, ending: str) -> Path:
    """A temporary file for `path`: in the same folder, so that the replacement is atomic."""
    return path.with_name(f"{_stem(path)}{_machine()}-{os.getpid()}.{ending}")


def _stem(path: Path) -> str:
    """What the names of the temporary files of one file begin with, however long its own name is."""
    return f".obseq-{hashlib.sha256(os.fsencode(path.name)).hexdigest()[:12]}-"


def _machine() -> str:
    return hashlib.sha256(os.uname().nodename.encode()).hexdigest()[:8]


def _clean(path: Path) -> None:
    """Delete what runs that were killed while writing this file left beside it."""
    for entry in path.parent.glob(f"{_stem(path)}*"):
        found = LEFTOVER.fullmatch(entry.name)
        if found and not _is_being_written(entry, found["machine"], int(found["process"])):
            entry.unlink(missing_ok=True)


def _is_being_written(entry: Path, machine: str, process: int) -> bool:
    if machine != _machine():
        return time.time() - entry.stat().st_mtime < DAY
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return process != os.getpid()
