import argparse
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from obseq import InputError
from obseq.cli import commands as command
from obseq.cli import versions
from obseq.cli.main import main

HEAVY = ("numpy", "numba", "scipy", "pyproj", "sympy", "jinja2")


def raising(error: BaseException):
    def run(arguments) -> int:
        raise error

    return run


@pytest.fixture
def fail_with(monkeypatch):
    """Make `obseq versions` raise an error."""
    monkeypatch.setattr("obseq.cli.main.parser", command.parser.__wrapped__)
    return lambda error: monkeypatch.setattr(versions, "run", raising(error))


def test_bad_input_is_one_message_and_exit_code_2(fail_with, capsys) -> None:
    fail_with(InputError("site.obs:3: unknown code 9"))
    assert main(["versions"]) == 2
    assert capsys.readouterr() == ("", "obseq: site.obs:3: unknown code 9\n")


def test_a_file_that_cannot_be_read_is_named(fail_with, capsys) -> None:
    fail_with(PermissionError(13, "Permission denied", "secret.obs"))
    assert main(["versions"]) == 2
    assert capsys.readouterr().err == "obseq: secret.obs: Permission denied\n"


def test_an_interruption_is_exit_code_130(fail_with, capsys) -> None:
    fail_with(KeyboardInterrupt())
    assert main(["versions"]) == 130
    assert "interrupted" in capsys.readouterr().err


def test_not_enough_memory_is_said(fail_with, capsys) -> None:
    fail_with(MemoryError())
    assert main(["versions"]) == 2
    assert capsys.readouterr().err == "obseq: There is not enough memory for this computation.\n"


def test_a_defect_shows_where_it_is_and_asks_for_a_report(fail_with, capsys) -> None:
    fail_with(ZeroDivisionError("x"))
    assert main(["versions"]) == 2
    error = capsys.readouterr().err
    assert "ZeroDivisionError" in error
    assert "obseq versions" in error


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["unknown"],
        ["adjust", "--obs", "a.obs", "--cor", "a.cor", "--point-sigma", "-1"],
        ["adjust", "--obs", "a.obs", "--cor", "a.cor", "--point-sigma", "thin"],
        ["adjust", "--obs", "a.obs", "--cor", "a.cor", "--iterations", "0"],
        ["adjust", "--obs", "a.obs", "--cor", "a.cor", "--iterations", "2.5"],
    ],
)
def test_wrong_arguments_are_exit_code_2(arguments, capsys) -> None:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert capsys.readouterr().err


def test_a_command_without_files_says_what_it_needs(capsys) -> None:
    assert main(["adjust"]) == 2
    assert "Files of observations and of points (obseq adjust site.obs site.cor" in capsys.readouterr().err


def test_every_command_explains_itself(capsys) -> None:
    for name in ("demo", "adjust", "formulas", "check-derivatives", "versions"):
        with pytest.raises(SystemExit) as end:
            main([name, "--help"])
        assert end.value.code == 0
        assert f"usage: obseq {name}" in capsys.readouterr().out


def test_help_loads_nothing_heavy() -> None:
    script = (
        "import sys\nfrom obseq.cli.main import main\n"
        "try: main(['--help'])\nexcept SystemExit: pass\n"
        f"sys.exit(', '.join(sorted(set({HEAVY}) & set(sys.modules))) or None)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_reader_that_leaves_is_not_an_error() -> None:
    script = "from obseq.cli.main import main; import sys; sys.exit(main(['versions']))"
    with subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        process.stdout.close()
        assert (process.stderr.read(), process.wait()) == ("", 0)


def test_a_service_without_standard_output_gets_its_files(tmp_path) -> None:
    script = "from obseq.cli.main import main; import sys; sys.exit(main(['demo', '--out', sys.argv[1]]))"
    command = f"{shlex.join([sys.executable, '-c', script, str(tmp_path / 'out')])} >&-"
    done = subprocess.run(command, shell=True, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "out" / "adjustment.json").is_file()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_disk_behind_standard_output_is_said() -> None:
    script = "from obseq.cli.main import main; import sys; sys.exit(main(['versions']))"
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-c", script], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 2
    assert done.stderr == "obseq: the output cannot be written: No space left on device\n"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["adjust", "--iteratons", "3"],
            "obseq adjust: there is no option --iteratons; did you mean --iterations?",
        ),
        (["demo", "--ou=x", "--oot=x"], "obseq demo: there is no option --oot; did you mean --out?"),
        (["demo", "--zzzzzzzzz"], "there is no option --zzzzzzzzz"),
        (["adjust", "--datum", "innr"], "; did you mean inner?"),
        (["adjst"], "; did you mean adjust?"),
    ],
)
def test_a_misspelt_word_is_told_what_it_may_have_been(arguments, said: str, capsys) -> None:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert capsys.readouterr().err.endswith(f"{said}\n")


def test_positional_arguments_may_follow_options() -> None:
    parsed = command.parser().parse_args(["bundle-adjust", "A", "B", "C", "X=1", "--json", "r.json", "Y=2"])
    assert parsed.options == ["X=1", "Y=2"]
    parsed = command.parser().parse_args(["bundle-adjust", "A", "--json", "r.json", "B", "C", "Y=2"])
    assert (parsed.options, parsed.json) == (["Y=2"], Path("r.json"))
    parsed = command.parser().parse_args(["adjust", "--strict", "a.stn", "--a-priori", "a.msr"])
    assert parsed.project == [Path("a.stn"), Path("a.msr")]


def test_a_line_loads_the_module_of_its_command_only() -> None:
    """What all modules of commands offer together, each offers alone."""
    everything = [name for names in command.COMMANDS.values() for name in names]
    assert offered("") == offered("nothing-of-ours") == everything
    for names in command.COMMANDS.values():
        assert all(offered(name) == list(names) for name in names)


def offered(name: str) -> list[str]:
    """The names of the subcommands of the parser of a line that begins with a name."""
    actions = command.parser(name)._actions
    (commands,) = (action for action in actions if isinstance(action, argparse._SubParsersAction))
    return list(commands.choices)


def test_the_module_is_the_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "obseq", "versions"], capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("obseq ")
