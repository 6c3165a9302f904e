import io
import time

import pytest

from obseq.cli import progress
from obseq.cli.progress import ERASE, Progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "PATIENCE", 0.02)
    monkeypatch.setattr(progress, "PERIOD", 0.01)


def shown_on(stream: io.StringIO, monkeypatch: pytest.MonkeyPatch, seconds: float) -> str:
    monkeypatch.setattr("sys.stderr", stream)
    with Progress("reading") as line:
        line("adjusting")
        time.sleep(seconds)
    return stream.getvalue()


def test_long_work_shows_what_it_does_then_erases_it(
    impatient: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = shown_on(Terminal(), monkeypatch, 0.2)
    assert text.startswith(f"{ERASE}adjusting ... 0 s")
    assert text.endswith(ERASE)


def test_short_work_shows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert shown_on(Terminal(), monkeypatch, 0.0) == ""


def test_what_is_not_a_terminal_gets_nothing(impatient: None, monkeypatch: pytest.MonkeyPatch) -> None:
    assert shown_on(io.StringIO(), monkeypatch, 0.05) == ""


def test_what_is_counted_says_how_long_the_rest_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 10.0, 14.0, 20.0, 20.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    line = Progress("reading")
    line("draw 1 of 5")
    assert line._message == "draw 1 of 5"
    line("draw 3 of 5")  # two are done in 4 s: three are left
    assert line._message == "draw 3 of 5, about 6 s left"
    line("iteration 3: sigma0 1.2")
    assert line._message == "iteration 3: sigma0 1.2"
