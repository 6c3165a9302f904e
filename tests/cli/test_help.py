"""What the command says of itself: groups, screens, topics, completion."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from obseq.cli.commands import COMMANDS, GROUPS, LATER, parser
from obseq.cli.main import main

SCREEN = 50
"""Lines of a terminal of a usual height."""


def helped(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == 0
    return capsys.readouterr().out


def test_every_command_is_in_the_help_once_or_named_as_later(capsys: pytest.CaptureFixture[str]) -> None:
    lines = helped(["--help"], capsys).splitlines()
    assert len(lines) <= SCREEN
    shown = [line.split()[0] for line in lines if line.startswith("  ")]
    names = [name for group in COMMANDS.values() for name in group]
    assert all((shown.count(name) == 1) is (name not in LATER) for name in names)
    assert [line for line in lines if line in GROUPS] == list(GROUPS)
    assert f"  and {len(LATER)} more: obseq help mmvii" in lines


RESULTS = "adjust demo plan compare bundle report topo-adjust bundle-adjust"
"""Commands that print a summary."""


@pytest.mark.parametrize("name", RESULTS.split())
def test_every_summary_can_be_brief_or_long_or_with_tables(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    text = helped(
        [name, "--help-all" if name in ("adjust", "plan", "compare", "bundle") else "--help"], capsys
    )
    assert all(option in text for option in ("--quiet", "--verbose", "--show TABLE"))


@pytest.mark.parametrize("name", ["adjust", "plan", "compare", "bundle"])
def test_help_is_a_screen_with_three_examples_and_help_all_has_the_rest(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    short, long = helped([name, "--help"], capsys), helped([name, "--help-all"], capsys)
    assert len(short.splitlines()) <= SCREEN
    assert short.count(f"\n  obseq {name} ") == 3
    command = parser(name).commands.choices[name]
    assert all(option in long for option in command._option_string_actions)
    assert all(option in short for option in ("--out", "--help-all"))
    assert "exit code: 0" in long


def test_the_arguments_of_a_screen_exist() -> None:
    for name, command in parser().commands.choices.items():
        known = {action.dest for action in command._actions}
        assert getattr(command, "common", set()) - known <= {"quiet", "verbose", "show"}, name


@pytest.mark.parametrize(
    ("topic", "said"),
    [
        ("exit-codes", "130  interrupted"),
        ("formats", "GNU Gama (.gkf)"),
        ("crs", "RTL*X0*Y0*Z0*DEFINITION"),
        ("mmvii", "resection-11p"),
        ("completion", "register-python-argcomplete"),
        ("S120", "turned circle"),
    ],
)
def test_topics_are_explained(topic: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["help", topic]) == 0
    assert said in capsys.readouterr().out


def test_help_of_a_command_is_all_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert helped(["help", "adjust"], capsys) == helped(["adjust", "--help-all"], capsys)
    assert "exit-codes" in helped(["help"], capsys)


def test_a_misspelt_topic_is_told_what_it_may_have_been(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["help", "format"]) == 2
    assert "no topic format; did you mean formats?" in capsys.readouterr().err


def completed(line: str, tmp_path: Path) -> list[str]:
    """What a shell is told of how a line may go on."""
    out = tmp_path / "completions"
    environment = os.environ | {
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_IFS": " ",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(out),
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
    }
    subprocess.run([sys.executable, "-m", "obseq"], env=environment, check=True, capture_output=True)
    return out.read_text(encoding="utf-8").split()


def test_a_shell_is_told_how_a_line_goes_on(tmp_path: Path) -> None:
    pytest.importorskip("argcomplete", reason="the extra completion is not installed")
    assert completed("obseq adj", tmp_path) == ["adjust"]
    assert completed("obseq adjust --point-s", tmp_path) == ["--point-sigma"]
    assert completed("obseq adjust x.obs --datum ", tmp_path) == ["given", "fixed", "inner"]


@pytest.fixture
def demo(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    main(["demo", "--out", str(tmp_path / "results")])
    capsys.readouterr()
    return tmp_path / "results"


def test_open_shows_the_page_of_a_folder_a_result_or_a_page(
    demo: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) or True)
    page = demo / "adjustment.html"
    for result in (demo, demo / "adjustment.json", page):
        assert main(["open", str(result)]) == 0
    assert opened == [page.resolve().as_uri()] * 3
    assert capsys.readouterr().out == f"{page}\n" * 3


def test_open_makes_a_page_that_is_not_there_and_says_where_it_is_without_a_browser(
    demo: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("webbrowser.open", lambda address: False)
    page = demo / "adjustment.html"
    text = page.read_text(encoding="utf-8")
    page.unlink()
    assert main(["open", str(demo / "adjustment.json")]) == 0
    assert page.read_text(encoding="utf-8") == text
    said = capsys.readouterr().out
    assert f"Written: {page}" in said
    assert said.endswith(f"There is no browser here; open this page in one:\n{page}\n")


def test_open_refuses_what_has_no_page(demo: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["open", str(demo / "none.json")]) == 2
    shutil.copy(demo / "adjustment.html", demo / "other.html")
    assert main(["open", str(demo)]) == 2
    said = capsys.readouterr().err
    assert "there is no such result" in said
    assert "several pages; name one" in said


def test_a_quiet_plan_and_a_quiet_comparison_are_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A levelling between known points, planned, and compared with another one."""
    points = "5 A 0 0 0 0.001\n5 B 0 0 1 0.001\n4 C 0 0 2\n"
    (tmp_path / "p.cor").write_text(points, encoding="utf-8")
    for name, height in (("one", 2.0), ("two", 2.5)):
        lines = f"4 A C {height} 0.001\n4 B C {height - 1.0} 0.001\n4 A C {height} 0.001\n"
        (tmp_path / f"{name}.obs").write_text(lines, encoding="utf-8")
    files = [str(tmp_path / "one.obs"), str(tmp_path / "p.cor"), "--frame", "Local"]
    assert main(["plan", *files, "-q"]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("Every point will be known to ")
    assert main(["compare", *files, "--obs-2", str(tmp_path / "two.obs"), "-q"]) == 1
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith(("No verdict on movements", "C has moved by"))
