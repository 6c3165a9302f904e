"""An interruption of a cold compilation: no half file in the cache, and the next call gives the result."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("interrupted.py")


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="the system has no timers that send signals")
@pytest.mark.parametrize(("delay", "count", "least"), [(0.1, 0, 1), (0.25, 0, 0), (0.4, 12, 1)])
def test_interrupted_compilations(tmp_path: Path, delay: float, count: int, least: int) -> None:
    command = [sys.executable, str(SCRIPT), str(delay), str(count)]
    environment = os.environ | {"OBSEQ_CACHE": str(tmp_path / "cache")}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) >= least  # a quick machine is done after a quarter of a second
    assert not done.stderr  # an interruption that nobody is told of is one that was lost
    assert len(list((tmp_path / "cache").rglob("*.nbc"))) == count + 1
