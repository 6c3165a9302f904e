"""What has no end is refused by what it is, by every command that reads files."""

import ast
import os
import stat
import time
from pathlib import Path

import pytest
from sources import nodes

import obseq
from obseq.cli.main import main
from obseq.errors import InputError
from obseq.reading.text import read_bytes

COMMANDS = {
    "adjust": ["adjust", "F.gkf"],
    "adjust dat": ["adjust", "F.dat", "--outside"],
    "adjust xml": ["adjust", "F.xml"],
    "adjust csv": ["adjust", "F.csv"],
    "adjust snx": ["adjust", "F.snx"],
    "adjust comp": ["adjust", "F.comp"],
    "obs": ["adjust", "--obs", "F.obs", "--cor", "F.cor"],
    "report": ["report", "F.json"],
    "convert": ["convert", "F.json", "--to", "x.cor"],
    "bal": ["bundle", "--bal", "F.txt"],
    "bal bz2": ["bundle", "--bal", "F.txt.bz2"],
    "bundler": ["bundle", "--bundler", "F.out"],
    "metashape": ["bundle", "--metashape", "F.xml"],
    "dbat": ["bundle", "--dbat", "F.xml"],
    "photomodeler": ["bundle", "--photomodeler", "F.txt", "--size", "10", "10"],
    "tables": ["bundle", "--cameras", "F.csv", "--images", "F.csv", "--measures", "F.csv"],
    "formulas": ["adjust", "--formulas", "F.py", "F.csv"],
    "intersect": [
        "intersect",
        "--shots",
        "F.opk",
        "--cameras",
        "F.txt",
        "--crs",
        "EPSG:2154",
        "--points",
        "F.mes",
    ],
}


@pytest.fixture(params=["pipe", "device"])
def endless(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A folder in which any name is that of a pipe, or leads to a device."""
    for ending in ("gkf", "dat", "xml", "csv", "snx", "comp", "obs", "cor", "json", "txt", "txt.bz2", "out"):
        make(request.param, tmp_path / f"F.{ending}")
    for ending in ("py", "opk", "mes"):
        make(request.param, tmp_path / f"F.{ending}")
    return tmp_path


def make(kind: str, path: Path) -> None:
    if kind == "pipe":
        os.mkfifo(path)
    elif not Path("/dev/zero").exists():
        pytest.skip("this system has no /dev/zero")
    else:
        path.symlink_to("/dev/zero")


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_refuses_what_has_no_end(
    name: str, endless: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(endless)
    begin = time.monotonic()
    assert main(COMMANDS[name]) == 2
    told = capsys.readouterr().err
    assert "which may have no end; save what it gives in a file" in told and "F." in told
    assert time.monotonic() - begin < 10.0


def test_a_socket_and_a_large_file_are_refused(tmp_path: Path) -> None:
    os.mknod(tmp_path / "s", stat.S_IFSOCK | 0o600)
    with pytest.raises(InputError, match="s: is a socket"):
        read_bytes(tmp_path / "s")
    (tmp_path / "f").write_bytes(bytes((2 << 20) + 1))
    with pytest.raises(InputError, match="f: the file is larger than 2 MiB"):
        read_bytes(tmp_path / "f", 2 << 20)


OWN = {"cli/mmvii/project_imports.py", "survey/maps.py", "report/page.py"}
"""What they read is theirs: written by themselves just before, or part of the package."""


def test_files_are_read_in_one_place() -> None:
    """Whoever reads a file of the user's asks `obseq.reading`, which looks what it is."""
    package = Path(obseq.__file__).parent
    rooms = ("cli", "formats", "images", "project", "report", "survey", "targets", "reading/tables.py")
    files = [
        path
        for room in rooms
        for path in ([package / room] if room.endswith(".py") else (package / room).rglob("*.py"))
    ]
    wrong = [
        f"{path.relative_to(package)}:{node.lineno}"
        for path in sorted(files)
        if path.relative_to(package).as_posix() not in OWN
        for node in nodes(path, ast.Call)
        if reads(node)
    ]
    assert wrong == []


def reads(call: ast.Call) -> bool:
    """Whether a call is `open(...)`, `path.open("r...")`, `path.read_bytes()` or `path.read_text(...)`."""
    if isinstance(call.func, ast.Name):
        return call.func.id == "open"
    if not isinstance(call.func, ast.Attribute):
        return False
    mode = call.args[0].value if call.args and isinstance(call.args[0], ast.Constant) else ""
    return call.func.attr in ("read_bytes", "read_text") or (
        call.func.attr == "open" and str(mode).startswith("r")
    )
