"""Projects of formulas of one's own: what is found, and what is refused with what to do."""

import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from obseq.codegen.main import main
from obseq.errors import FormulaError
from obseq.kernels import formula_names, index, load
from obseq.module_texts import GROUP

NAMES = iter(f"own{k}" for k in range(100))


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A project as `gencode --new` makes it, whose package is forgotten afterwards."""
    name = next(NAMES)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.chdir(tmp_path)
    assert main(["--new", name]) == 0
    yield tmp_path / name
    for module in [module for module in sys.modules if module.partition(".")[0] == name]:
        del sys.modules[module]


def change(path: Path, before: str, after: str) -> None:
    text = path.read_text("utf-8")
    assert before in text
    path.write_text(text.replace(before, after), "utf-8")


def test_the_project_that_one_stands_in_is_taken(
    project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(project / "tests")
    capsys.readouterr()
    assert main(["--check"]) == 0
    assert capsys.readouterr().out.startswith(f"reads {project.name}.formulas of {project}\n")
    assert main(["--list"]) == 0
    assert capsys.readouterr().out == "FitCube\n"
    assert main(["FitCub"]) == 2
    assert "'FitCub'; nearest names: FitCube" in capsys.readouterr().err


def test_its_formulas_are_found_by_name(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import importlib.metadata

    point = EntryPoint(project.name, project.name, GROUP)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [point])
    index.registered.cache_clear()
    assert load("FitCube").unknowns == ("x", "y")
    assert "FitCube" in formula_names()
    index.registered.cache_clear()
    change(project / "src" / project.name / "generated" / "index.py", "FitCube", "TopoHz")
    del sys.modules[f"{project.name}.generated.index"]
    with pytest.raises(FormulaError, match=f"obseq and {project.name} both have a formula TopoHz"):
        formula_names()
    load.cache_clear()
    index.registered.cache_clear()


@pytest.mark.parametrize(
    ("path", "before", "after", "said"),
    [
        ("pyproject.toml", "[tool.gencode]", "[tool.other]", "`gencode --new NAME` makes a project"),
        ("pyproject.toml", '"obseq.formulas"', '"others"', 'add\n[project.entry-points."obseq.formulas"]'),
        ("pyproject.toml", 'package = "', 'package = "absent_', "of"),
        ("pyproject.toml", "[tool.gencode]", "[tool.gencode", "cannot be read"),
        ("src/{}/formulas/__init__.py", "REGISTRY", "LIST", "has no list REGISTRY"),
        ("src/{}/formulas/__init__.py", "FitCube(),", "FitCube,", "which is no formula: list objects"),
        ("src/{}/formulas/curves.py", "class FitCube", "class FitCub", "cannot be imported: ImportError"),
    ],
)
def test_what_is_wrong_is_said(
    path: str, before: str, after: str, said: str, project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change(project / path.format(project.name), before, after)
    for module in [module for module in sys.modules if module.startswith(f"{project.name}.")]:
        del sys.modules[module]
    assert main(["--project", str(project), "--check"]) == 2
    assert said in capsys.readouterr().err


def test_a_name_of_obseq_is_not_for_others(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = project / "src" / project.name / "formulas"
    for path in (folder / "__init__.py", folder / "curves.py"):
        change(path, "FitCube", "TopoHz")
    for module in [module for module in sys.modules if module.startswith(f"{project.name}.")]:
        del sys.modules[module]
    assert main(["--project", str(project)]) == 2
    assert "obseq has a formula TopoHz already; give yours another name" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["My", "my-lib", "class", "obseq", "json"])
def test_names_that_cannot_be(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--new", name, "--project", str(tmp_path)]) == 2
    assert f"{name} is " in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_nothing_is_overwritten(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--new", project.name]) == 2
    assert f"{project} exists already" in capsys.readouterr().err
