"""The time of the suite is told in yardsticks, and is too long beyond a tenth more than was written down."""

import importlib.util
from pathlib import Path
from types import SimpleNamespace

import pytest

PATH = Path(__file__).parents[2] / "tools" / "suite_time.py"


@pytest.mark.parametrize(("seconds", "code"), [(109.0, 0), (111.0, 1)])
def test_a_suite_that_takes_a_tenth_longer_fails(monkeypatch, tmp_path, capsys, seconds, code):
    spec = importlib.util.spec_from_file_location("suite_time", PATH)
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    clock = iter([5.0, 5.0 + seconds])
    monkeypatch.setattr(tool, "yardstick", lambda: 1.0)
    monkeypatch.setattr(tool, "children", lambda: next(clock))
    monkeypatch.setattr(tool.subprocess, "run", lambda *_, **__: SimpleNamespace(returncode=0))
    monkeypatch.setattr(tool, "WRITTEN", tmp_path / "t.json")
    tool.WRITTEN.write_text('{"yardsticks": 100}')
    assert tool.main([]) == code
    assert f"{seconds:.0f} yardsticks of 1.000 s" in capsys.readouterr().out
