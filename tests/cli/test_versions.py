import tomllib
from importlib import metadata
from pathlib import Path

import pytest

import obseq
from obseq.cli.main import main


def test_every_component_has_its_version(capsys) -> None:
    assert main(["versions"]) == 0
    lines = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert lines["obseq"] == metadata.version("obseq")
    assert lines["numpy"] == metadata.version("numpy")
    assert "processors" in lines["system"]
    assert {"python", "scipy", "numba", "llvmlite", "pyproj", "PROJ", "sympy", "jinja2"} <= lines.keys()


def test_what_is_not_installed_is_said(monkeypatch, capsys) -> None:
    monkeypatch.setattr("obseq.cli.versions.PACKAGES", ("no-such-package",))
    main(["versions"])
    assert "no-such-package not installed" in capsys.readouterr().out


def test_the_version_is_that_of_the_project(capsys) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    settings = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))
    assert capsys.readouterr().out == f"obseq {settings['project']['version']}\n"
    assert obseq.__version__ == settings["project"]["version"]
