"""Ctrl-C and SIGTERM at work: exit code 130, one message, no file but whole ones."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from obseq.cli import main as command
from obseq.cli import versions
from obseq.cli.guard import guarded
from obseq.cli.main import main

SCRIPT = """\
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a runner in the background has it ignored
from obseq.cli.main import main
from obseq import survey
adjust = survey.Network.adjust
def told(*args, **kwargs):
    print("adjusting", flush=True)
    while True:
        adjust(*args, **kwargs)
survey.Network.adjust = told
sys.exit(main(["demo", "--out", sys.argv[1]]))
"""


@pytest.mark.slow  # starts a process that computes in compiled loops until it is interrupted
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("delay", [0.0, 0.37])
def test_a_command_that_is_interrupted_while_it_computes(number, delay: float, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with subprocess.Popen(
        [sys.executable, "-c", SCRIPT, str(out)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "adjusting\n"
        time.sleep(delay)
        process.send_signal(number)
        try:
            _, err = process.communicate(timeout=60)
        finally:
            process.kill()
    assert (process.returncode, err) == (130, "\nobseq: interrupted; no file is half-written.\n")
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
    ("program", "module"), [("obseq", "obseq.cli.main"), ("gencode", "obseq.codegen.main")]
)
def test_a_command_that_is_interrupted_while_it_loads(program: str, module: str) -> None:
    command = [sys.executable, "-c", LOADING, program, module]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == f"\n{program}: interrupted; no file is half-written.\n"
