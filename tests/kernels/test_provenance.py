"""A kernel that is older than its formula is told; a text that is not whole is known."""

import os
import shutil
import subprocess
import sys
from logging import LogRecord
from pathlib import Path

import pytest

from obseq.kernels import loading, provenance
from obseq.module_texts import is_whole

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("formulas", "codegen", "generated")


@pytest.fixture
def changed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The files of the equations are not those of the modules."""
    monkeypatch.setattr(provenance, "_have_sources_changed", lambda package: True)
    for cached in (loading.load, provenance.tell):
        cached.cache_clear()


def test_files_that_changed_without_their_mathematics_are_no_matter(changed: None) -> None:
    assert provenance.staleness("TopoHz") == provenance.staleness("RadiomVignetLin_5") == ""


def test_another_formula_is_told_once(
    changed: None, monkeypatch: pytest.MonkeyPatch, logged: list[LogRecord]
) -> None:
    monkeypatch.setattr(provenance, "_recorded", lambda name: "of before")
    for _ in range(2):
        loading.load.cache_clear()
        loading.load("TopoHz")
    (said,) = [record.getMessage() for record in logged]
    assert said == "TopoHz: its formula has changed since its kernel was generated; run gencode"


def test_without_the_generator_nobody_can_say(changed: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(provenance, "missing", lambda *packages: ["sympy"])
    assert 'pip install "obseq[gencode]", then run gencode' in provenance.staleness("TopoHz")


def test_the_equations_are_those_of_the_modules() -> None:
    assert provenance.checkout() == ROOT
    assert not provenance._have_sources_changed("obseq")


def test_a_text_that_is_cut_or_changed_is_not_whole() -> None:
    text = (ROOT / "generated/topography/topo_hz.py").read_text("utf-8")
    assert is_whole(text)
    for damaged in (text[:-1], text[:500], "", text.replace("atan2", "hypot", 1), text + "\n"):
        assert damaged != text and not is_whole(damaged)


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout of its own, which `run` runs."""
    root = tmp_path_factory.mktemp("checkout")
    ignored = shutil.ignore_patterns("__pycache__", *FOLDERS)
    shutil.copytree(ROOT / "src", root / "src", ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", root)
    for name in FOLDERS:
        shutil.copytree(ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
        (root / "src/obseq" / name).symlink_to(root / name)
    return root


def run(copy: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """A command in a checkout of its own."""
    environment = os.environ | {"PYTHONPATH": str(copy / "src")}
    return subprocess.run(
        [sys.executable, "-m", *command],
        cwd=copy,
        env=environment,
        text=True,
        capture_output=True,
        check=False,
    )


@pytest.mark.slow
def test_a_checkout_whose_formula_was_edited(copy: Path) -> None:
    equations = copy / "formulas/topography.py"
    text = equations.read_text("utf-8")
    edited = text.replace(
        "return norm(target - origin) - distance", "return 2 * norm(target - origin) - distance"
    )
    assert edited != text
    equations.write_text(edited, "utf-8")
    for command in (["check-derivatives", "TopoDist", "TopoHz"], ["formulas", "TopoDist"]):
        done = run(copy, "obseq", *command)
        assert done.returncode == (command[0] == "check-derivatives")
        assert "TopoDist: its formula has changed since" in done.stdout + done.stderr
        assert "TopoHz: its formula" not in done.stdout + done.stderr
    equations.write_text(f"{text}\n# a comment\n", "utf-8")
    done = run(copy, "obseq", "check-derivatives", "TopoDist")
    assert done.returncode == 0 and "changed" not in done.stdout + done.stderr


@pytest.mark.slow
def test_gencode_does_not_check_another_folder_than_the_one_that_one_stands_in(
    copy: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from obseq.codegen.main import main

    monkeypatch.chdir(copy / "formulas")
    assert main(["--check"]) == main(["TopoHz"]) == 2
    assert f"you are in the project {copy}, but the obseq that runs" in capsys.readouterr().err
    first, second = run(copy, "obseq.codegen.main", "TopoHz", "--check").stdout.splitlines()
    assert first == f"reads obseq.formulas of {copy}" and second.startswith(str(copy / "generated"))
