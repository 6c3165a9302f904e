import sys

import pytest

from obseq.cli.gencode import main


def test_it_is_the_generator(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.setattr(sys, "argv", ["gencode", "--list"])
    assert main() == 0
    assert "TopoHz" in capsys.readouterr().out.split()


def test_without_the_generator_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.setattr("obseq.kernels.ondemand.can_build", lambda: False)
    assert main() == 2
    assert "pip install 'obseq[gencode]'" in capsys.readouterr().err
