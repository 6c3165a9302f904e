import io
import time

import pytest

from obseq.cli import progress
from obseq.cli.main import main
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


def test_an_adjustment_counts_what_its_search_may_spend_and_its_files(tmp_path, monkeypatch) -> None:
    said: list[str] = []
    monkeypatch.setattr(Progress, "__call__", lambda _, message: said.append(message))
    (tmp_path / "n.cor").write_text("1 A 0 0 0 0.001\n1 B 100 0 0 0.001\n0 C 60 80 0\n", encoding="utf-8")
    lines = ["4 A C 0 0.001", "4 B C 0.5 0.001", "4 B C 0 0.001", "3 A C 100 0.001", "3 B C 89.443 0.001"]
    more = ["3 A C 100 0.001", "3 B C 89.443 0.001"]
    (tmp_path / "n.obs").write_text("\n".join([*lines, *more]) + "\n", encoding="utf-8")
    given = [str(tmp_path / "n.obs"), str(tmp_path / "n.cor"), "--frame", "Local"]
    assert main(["adjust", *given, "--out", str(tmp_path / "out")]) == 1
    search = [line.split() for line in said if line.startswith("search for errors: iteration ")]
    assert search and all(int(words[4]) <= int(words[6]) for words in search)
    assert [line for line in said if line.startswith("write: ")] == [
        f"write: file {k} of 3" for k in (1, 2, 3)
    ]


def test_what_is_read_and_placed_is_counted(tmp_path, monkeypatch) -> None:
    """Every line and every point is due where no time passes between two counts."""
    from obseq import stopwatch
    from obseq.reading import text

    monkeypatch.setattr(stopwatch, "PERIOD", 0.0)
    monkeypatch.setattr(text, "_STRIDE", 1)
    said: list[str] = []
    monkeypatch.setattr(Progress, "__call__", lambda _, message: said.append(message))
    (tmp_path / "n.cor").write_text("1 A 0 0 0 0.001\n1 B 100 0 0 0.001\n0 C 60 80 0\n", encoding="utf-8")
    (tmp_path / "n.obs").write_text("7 A B 0 0.001\n5 A C 40.97 0.001\n3 A C 100 0.001\n", encoding="utf-8")
    names = tmp_path / "n.obs", tmp_path / "n.cor"
    main(["adjust", *map(str, names), "--frame", "Local"])
    for name, lines in zip(names, (4, 4), strict=True):
        read = [line for line in said if line.startswith(f"read {name}: line ")]
        assert read == [f"read {name}: line {k} of {lines}" for k in range(1, lines + 1)]
    assert "initial values: point 3 of 3" in said


def test_nobody_is_told_of_counts_outside_of_what_is_counted(tmp_path) -> None:
    from obseq.reading.text import read_text
    from obseq.stopwatch import Stopwatch

    said: list[str] = []
    path = tmp_path / "a.txt"
    path.write_text("a\n" * 5, encoding="utf-8")
    with Stopwatch(said.append).phase("read"):
        assert type(read_text(path).lines) is list
    with Stopwatch(said.append).counted("read"):
        assert type(read_text(path).lines) is not list
    with Stopwatch().counted("read"):
        assert type(read_text(path).lines) is list


def test_tables_and_xml_are_counted_too(tmp_path, monkeypatch) -> None:
    from obseq import stopwatch
    from obseq.reading import text
    from obseq.reading.tables import Table
    from obseq.reading.xml import read_xml
    from obseq.stopwatch import Stopwatch

    monkeypatch.setattr(stopwatch, "PERIOD", 0.0)
    monkeypatch.setattr(text, "_STRIDE", 1)
    said: list[str] = []
    table, xml = tmp_path / "t.csv", tmp_path / "t.xml"
    table.write_text("name,x\nA,1\nB,2\n", encoding="utf-8")
    xml.write_text("<a>\n<b/>\n<b/>\n</a>\n", encoding="utf-8")
    with Stopwatch(said.append).counted("read"):
        Table.read(table)
        read_xml(xml)
    assert f"read {table}: line 3 of 3" in said
    assert f"read {xml}: line 3 of 4" in said


def test_blocks_in_text_are_counted_too(tmp_path, monkeypatch) -> None:
    from obseq import stopwatch
    from obseq.formats.colmap.model import lines
    from obseq.reading import text
    from obseq.stopwatch import Stopwatch

    monkeypatch.setattr(stopwatch, "PERIOD", 0.0)
    monkeypatch.setattr(text, "_STRIDE", 1)
    said: list[str] = []
    points = tmp_path / "points3D.txt"
    points.write_text("# a list\n1 0 0 0\n2 0 0 1\n", encoding="utf-8")
    with Stopwatch(said.append).counted("read"):
        assert [number for number, _ in lines(points)] == [2, 3]
    assert f"read {points}: line 3 of 3" in said
