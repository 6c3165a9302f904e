"""Ctrl-C and SIGTERM at work: exit code 130, one message, no file but whole ones."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from obseq.cli import main as command
from obseq.cli import versions
from obseq.cli.guard import guarded
from obseq.cli.main import main

LENDER = """\
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a runner in the background has it ignored
import numpy, pyproj, pyproj.transformer  # which each copy would load before it adjusts
from obseq.cli.main import main
from obseq import survey
adjust = survey.Network.adjust

def told(*args, **kwargs):
    while True:
        print("adjusting", os.getpid(), flush=True)
        if adjust(*args, **kwargs).failures:  # its search alone was interrupted
            signal.raise_signal(signal.SIGINT)

def run(out, errors):
    signal.alarm(60)
    os.dup2(os.open(errors, os.O_WRONLY | os.O_CREAT), 2)
    survey.Network.adjust = told
    sys.exit(main(["demo", "--out", out]))

for line in sys.stdin:
    child = os.fork() or run(*line.rstrip("\\n").split("\\t"))
    print("ended", os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""
"""A process that has loaded the command; it runs each one, which adjusts without end, in a copy of itself."""


@pytest.fixture(scope="module")
def lender() -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-c", LENDER]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        yield process


@pytest.mark.slow  # a process that computes in compiled loops until it is interrupted
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("adjustments", [0, 1])
def test_a_command_that_is_interrupted_while_it_computes(
    number: int, adjustments: int, tmp_path: Path, lender: subprocess.Popen[str]
) -> None:
    """During the first adjustment, while what computes is loaded, or after it."""
    assert lender.stdin is not None and lender.stdout is not None
    out, errors = tmp_path / "out", tmp_path / "errors"
    print(out, errors, sep="\t", file=lender.stdin, flush=True)
    for _ in range(adjustments + 1):
        word, process = lender.stdout.readline().split()
        assert word == "adjusting"
    os.kill(int(process), number)
    word, code = next(words for words in map(str.split, lender.stdout) if words[0] == "ended")
    assert (code, errors.read_text()) == ("130", "\nobseq: interrupted; no file is half-written.\n")
    assert not out.exists()


def test_sigterm_ends_a_command_as_the_keyboard_does_and_is_given_back(monkeypatch, capsys) -> None:
    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(command, "parser", command.parser.__wrapped__)
    monkeypatch.setattr(versions, "run", lambda _: signal.raise_signal(signal.SIGTERM))
    assert main(["versions"]) == 130
    assert "interrupted" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGTERM) == before


def test_an_interruption_that_hits_a_callback_is_not_lost(capsys) -> None:
    class Held:
        def __del__(self) -> None:
            raise KeyboardInterrupt

    def work() -> int:
        held = Held()
        del held  # Python prints what this raises, and goes on
        end = time.monotonic() + 20.0
        while time.monotonic() < end:
            pass
        return 0

    assert guarded("obseq", work) == 130
    assert capsys.readouterr().err == "\nobseq: interrupted; no file is half-written.\n"


LOADING = """\
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from obseq.cli import start, gencode
class Loading:
    def find_spec(self, name, path=None, target=None):
        if name == sys.argv[2]:
            signal.raise_signal(signal.SIGINT)
sys.meta_path.insert(0, Loading())
begin = {"obseq": start.main, "gencode": gencode.main}[sys.argv[1]]
sys.exit(begin())
"""


@pytest.mark.parametrize(
    ("program", "module"), [("obseq", "obseq.cli.main"), ("gencode", "obseq.codegen.ondemand")]
)
def test_a_command_that_is_interrupted_while_it_loads(program: str, module: str) -> None:
    command = [sys.executable, "-c", LOADING, program, module]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == f"\n{program}: interrupted; no file is half-written.\n"
