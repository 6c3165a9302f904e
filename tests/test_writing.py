import errno
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import IO

import pytest

from obseq.errors import InputError
from obseq.writing import check_writable, write_all


def test_writable_places_leave_nothing_behind(tmp_path: Path) -> None:
    check_writable([tmp_path / "a.json", tmp_path / "new" / "deeper" / "b.html"])
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_not_a_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a folder"):
        check_writable([tmp_path])


def test_a_file_is_not_a_folder(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("x")
    with pytest.raises(InputError, match="cannot be written there"):
        check_writable([tmp_path / "plain" / "a.json"])


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="this system has no /proc")
def test_a_file_system_that_refuses_is_found_out() -> None:
    with pytest.raises(InputError, match=r"/proc/a\.json: the results cannot be written there"):
        check_writable([Path("/proc/a.json")])


def test_a_name_too_long_is_found_out(tmp_path: Path) -> None:
    with pytest.raises((InputError, OSError)):
        check_writable([tmp_path / ("n" * 300)])


def test_an_input_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "a.obs").write_text("x")
    with pytest.raises(InputError, match="would replace an input"):
        check_writable([tmp_path / "b" / ".." / "a.obs"], [tmp_path / "a.obs"])


def test_two_results_do_not_share_a_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="same file"):
        check_writable([tmp_path / "a", tmp_path / "a"])


def test_files_replace_what_was_there_and_make_their_folder(tmp_path: Path) -> None:
    old, new = tmp_path / "old.txt", tmp_path / "folder" / "new.txt"
    old.write_text("before")
    write_all({old: "é", new: "b"})
    assert old.read_text(encoding="utf-8") == "é"
    assert new.read_text() == "b"
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["folder", "new.txt", "old.txt"]


def test_when_one_cannot_be_written_none_is(tmp_path: Path) -> None:
    old = tmp_path / "old.txt"
    old.write_text("before")
    (tmp_path / "plain").write_text("x")
    with pytest.raises(InputError, match="cannot be written"):
        write_all({old: "after", tmp_path / "plain" / "b.txt": "b"})
    assert old.read_text() == "before"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["old.txt", "plain"]


def test_an_interruption_leaves_no_temporary_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_all({tmp_path / "a.txt": "a"})
    assert list(tmp_path.iterdir()) == []


def test_a_link_goes_on_pointing_to_the_file(tmp_path: Path) -> None:
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("before")
    link.symlink_to(target)
    write_all({link: "after"})
    assert link.is_symlink()
    assert target.read_text() == "after"


def test_a_device_is_written_to_and_not_replaced() -> None:
    check_writable([Path(os.devnull)])
    write_all({Path(os.devnull): "x"})
    assert not Path(os.devnull).is_file()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_device_that_is_full_is_named() -> None:
    with pytest.raises(InputError, match=r"^/dev/full: the results cannot be written \(No space left"):
        write_all({Path("/dev/full"): "x"})


def test_a_disk_that_is_full_while_a_file_is_written_is_said_with_the_name_of_the_file(tmp_path) -> None:
    def fills(file: IO[bytes]) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(InputError, match=r"page.html: the results cannot be written \(No space left"):
        write_all({tmp_path / "list.txt": "x", tmp_path / "page.html": fills})
    assert not list(tmp_path.iterdir())


def test_permissions_are_kept(tmp_path: Path) -> None:
    old, new = tmp_path / "old.txt", tmp_path / "new.txt"
    old.write_text("before")
    old.chmod(0o640)
    write_all({old: "after", new: "x"})
    assert old.stat().st_mode & 0o777 == 0o640
    umask = os.umask(0)
    os.umask(umask)
    assert new.stat().st_mode & 0o777 == 0o666 & ~umask


@pytest.mark.parametrize("name", ["link", "folder/a.txt", "folder/deeper/a.txt"])
def test_a_link_to_nothing_is_refused(name: str, tmp_path: Path) -> None:
    for link in ("link", "folder"):
        (tmp_path / link).symlink_to(tmp_path / "gone")
    for refuse in (check_writable, lambda paths: write_all(dict.fromkeys(paths, "x"))):
        with pytest.raises(InputError, match="link to something that does not exist"):
            refuse([tmp_path / name])
    assert not (tmp_path / "gone").exists()


def test_a_link_to_itself_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "a")
    with pytest.raises(InputError, match="link to something that does not exist"):
        check_writable([tmp_path / "a"])


def test_what_a_killed_run_left_is_deleted_and_what_another_writes_is_not(tmp_path: Path) -> None:
    script = (
        "import os, sys; from pathlib import Path; from obseq import writing\n"
        "os.fsync = lambda _: os.kill(os.getpid(), 9)\n"
        "writing.write_all({Path(sys.argv[1]): 'half'})"
    )
    killed = subprocess.run([sys.executable, "-c", script, str(tmp_path / "a.txt")], check=False)
    assert killed.returncode == -9
    (left,) = tmp_path.iterdir()
    alive = tmp_path / left.name.replace(left.stem.rpartition("-")[2], str(os.getppid()))
    alive.write_text("being written")
    write_all({tmp_path / "a.txt": "whole"})
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([alive.name, "a.txt"])


def test_when_one_cannot_be_replaced_the_others_are_given_back(tmp_path: Path, monkeypatch) -> None:
    for name in ("a", "b", "c"):
        (tmp_path / name).write_text(f"old {name}")
    replace = Path.replace

    def refusing(self: Path, target: Path) -> Path:
        if target.name == "c" and self.suffix == ".part":
            raise PermissionError(13, "refused", str(target))
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", refusing)
    with pytest.raises(InputError, match="c: the results cannot be written"):
        write_all({tmp_path / name: "new" for name in ("a", "new", "b", "c")})
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        "a": "old a",
        "b": "old b",
        "c": "old c",
    }


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_waits_until_all_files_are_replaced(number, tmp_path: Path, monkeypatch) -> None:
    replace = Path.replace

    def interrupted(self: Path, target: Path) -> Path:
        signal.raise_signal(number)
        return replace(self, target)

    def stop(*_) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    before = signal.signal(number, stop)
    try:
        with pytest.raises(KeyboardInterrupt):
            write_all({tmp_path / name: "new" for name in ("a", "b")})
        assert signal.getsignal(number) is stop
    finally:
        signal.signal(number, before)
    assert [path.read_text() for path in sorted(tmp_path.iterdir())] == ["new", "new"]


def test_what_is_not_text_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written in UTF-8"):
        write_all({tmp_path / "a": "\udc80"})
    assert list(tmp_path.iterdir()) == []


def test_what_is_not_a_name_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not the name of a file"):
        write_all({tmp_path / "a\0b": "x"})
