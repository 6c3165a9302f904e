import os
from pathlib import Path

import pytest

from obseq.cli.files import check_writable, write_all
from obseq.errors import InputError


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
    def interrupted(self: Path, text: str, encoding: str) -> int:
        os.close(os.open(self, os.O_CREAT))
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "write_text", interrupted)
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
