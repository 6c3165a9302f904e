"""The cache of compiled code: whole files or none, and never an error."""

import errno
import os
import tempfile
from logging import LogRecord
from pathlib import Path

import pytest

from obseq.compilation import cache

CODE = bytes(range(256)) * 9


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("OBSEQ_CACHE", str(tmp_path / "cache"))
    cache._warn_once.cache_clear()
    return tmp_path / "cache"


def test_what_was_written_is_read(place: Path) -> None:
    assert cache.read("loop_1") is None
    cache.write("loop_1", CODE)
    assert cache.read("loop_1") == CODE
    assert place in cache.folder().parents
    assert [path.name for path in cache.folder().iterdir()] == ["loop_1.nbc"]


def test_versions_and_processor_name_the_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    assert cache.folder().name.startswith("obseq-")
    assert "numba-" in cache.folder().name and "llvmlite-" in cache.folder().name


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: content[:10],
        lambda content: content[: len(content) // 2],
        lambda content: content[:-1],
        lambda content: content[:500] + bytes(len(content) - 500),
        lambda content: bytes(reversed(content)),
        lambda content: content + b"more",
    ],
)
def test_a_damaged_file_is_discarded(damage, logged: list[LogRecord]) -> None:
    cache.write("loop_1", CODE)
    path = cache.folder() / "loop_1.nbc"
    path.write_bytes(damage(path.read_bytes()))
    assert cache.read("loop_1") is None
    assert not path.exists() and str(path) in logged[0].getMessage()
    cache.write("loop_1", CODE)
    assert cache.read("loop_1") == CODE


def test_a_full_disk_leaves_nothing_behind_and_is_said_once(
    monkeypatch: pytest.MonkeyPatch, logged: list[LogRecord]
) -> None:
    cache.write("loop_1", CODE)

    class Full:
        def __init__(self, descriptor: int, mode: str) -> None:
            os.close(descriptor)

        def __enter__(self) -> "Full":
            raise OSError(errno.ENOSPC, "No space left on device")

        def __exit__(self, *details: object) -> None: ...

    monkeypatch.setattr(os, "fdopen", Full)
    cache.write("loop_2", CODE)
    cache.write("loop_3", CODE)
    (said,) = [record.getMessage() for record in logged]
    assert "cannot be kept" in said and "No space left" in said
    assert [path.name for path in cache.folder().iterdir()] == ["loop_1.nbc"]


def test_a_place_that_cannot_be_written(monkeypatch: pytest.MonkeyPatch, logged: list[LogRecord]) -> None:
    with tempfile.NamedTemporaryFile() as file:
        monkeypatch.setenv("OBSEQ_CACHE", str(Path(file.name) / "below-a-file"))
        cache.write("loop_1", CODE)
        assert cache.read("loop_1") is None
    assert "OBSEQ_CACHE" in logged[0].getMessage()


def test_a_user_without_a_home(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OBSEQ_CACHE")
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)

    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", homeless)
    cache.write("loop_1", CODE)
    assert cache.read("loop_1") is None


@pytest.mark.parametrize("which", ["file", "folder", "folder above", "file of another"])
def test_what_others_may_write_is_not_run(
    which: str, place: Path, monkeypatch: pytest.MonkeyPatch, logged: list[LogRecord]
) -> None:
    cache.write("loop_1", CODE)
    path = cache.folder() / "loop_1.nbc"
    if which == "file of another":
        monkeypatch.setattr(os, "geteuid", lambda: path.stat().st_uid + 1)
        if path.stat().st_uid == 0:  # the administrator, whom everybody trusts
            os.chown(path, 12345, -1)
    else:
        changed = {"file": path, "folder": path.parent, "folder above": place}[which]
        changed.chmod(changed.stat().st_mode | 0o020)
    assert cache.read("loop_1") is None and cache.read("loop_1") is None
    (said,) = [record.getMessage() for record in logged]
    assert ("belongs to somebody else" if "another" in which else "may be written by others") in said
    assert "is not run" in said


def test_what_is_written_anew_is_the_user_s_own(place: Path) -> None:
    """Folders that an earlier version left open are closed, whatever the mask."""
    before = os.umask(0)
    try:
        cache.write("loop_1", CODE)
        modes = [path.stat().st_mode & 0o777 for path in (cache.folder(), cache.folder() / "loop_1.nbc")]
        assert modes == [0o700, 0o600] and place.stat().st_mode & 0o022 == 0
        cache.folder().chmod(0o777)
        cache.write("loop_1", CODE)
        assert cache.read("loop_1") == CODE
    finally:
        os.umask(before)
