"""tools/quickstart and tools/test with a Python that only notes what it is asked: nothing is installed."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PYTHON = """\
#!/bin/sh
printf '%s\\n' "$*" >>"$NOTES"
case "$*" in
    *'-m venv'*)
        for folder; do :; done
        rm -rf "$folder"
        mkdir -p "$folder/bin"
        cp "$0" "$folder/bin/python"
        printf 'made by a stand-in\\n' >"$folder/pyvenv.cfg"
        printf '#!/bin/sh\\necho "obseq $*"\\n' >"$folder/bin/obseq"
        chmod +x "$folder/bin/obseq"
        ;;
    *'-m pip install'*) exit "${PIP:-0}" ;;
    *find_spec*) exit "${FOUND:-0}" ;;
    *version_info*) exit "${OLD:-0}" ;;
    *'-m pytest'*) echo "tested in $PWD" ;;
esac
"""


class Project:
    """A copy of what the scripts need, in a folder whose name has a space."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "my project"
        shutil.copytree(ROOT / "requirements", self.root / "requirements")
        shutil.copytree(ROOT / "tools", self.root / "tools")
        shutil.copy(ROOT / "pyproject.toml", self.root)
        self.notes = folder / "notes"
        self.python = folder / "python"
        self.python.write_text(PYTHON, encoding="utf-8")
        self.python.chmod(0o755)
        self.elsewhere = folder

    def run(
        self, script: str, *arguments: str, **variables: str
    ) -> tuple[subprocess.CompletedProcess[str], str]:
        """Run a script from another folder; what it did, and what Python was asked that changes something."""
        self.notes.write_text("", encoding="utf-8")
        names = {"PATH": os.environ["PATH"], "NOTES": str(self.notes), "PYTHON": str(self.python)}
        command = [str(self.root / "tools" / script), *arguments]
        done = subprocess.run(
            command, cwd=self.elsewhere, env=names | variables, capture_output=True, text=True, check=False
        )
        asked = self.notes.read_text(encoding="utf-8").splitlines()
        return done, " ".join("venv" if "-m venv" in line else "pip" for line in asked if is_change(line))


def is_change(line: str) -> bool:
    return "-m venv" in line or "-m pip install" in line


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return Project(tmp_path)


def test_the_first_run_installs_and_the_second_does_nothing(project: Project) -> None:
    done, asked = project.run("quickstart", "--out", "a b")
    assert (done.returncode, done.stdout, asked) == (0, "obseq demo --out a b\n", "venv pip pip")
    assert "--require-hashes" in project.notes.read_text(encoding="utf-8")
    done, asked = project.run("quickstart")
    assert (done.returncode, done.stdout, done.stderr, asked) == (0, "obseq demo\n", "", "")


def test_the_tests_complete_the_environment_and_run_at_the_root(project: Project) -> None:
    project.run("quickstart")
    done, asked = project.run("test", "-q")
    assert (done.stdout, asked) == (f"tested in {project.root}\n", "pip pip")
    assert "requirements/test.txt" in project.notes.read_text(encoding="utf-8")
    assert "-m pytest -n auto --dist worksteal -q" in project.notes.read_text(encoding="utf-8")
    for script in ("quickstart", "test"):
        assert project.run(script)[1] == ""


@pytest.mark.parametrize("file", ["pyproject.toml", "requirements/run.txt", "requirements/dev.txt"])
def test_other_versions_are_installed(file: str, project: Project) -> None:
    project.run("quickstart")
    with (project.root / file).open("a", encoding="utf-8") as text:
        text.write("# changed\n")
    assert project.run("quickstart")[1] == "pip pip"


def test_a_broken_environment_is_made_anew(project: Project) -> None:
    project.run("quickstart")
    (project.root / ".venv" / "bin" / "python").unlink()
    assert project.run("quickstart")[1] == "venv pip pip"


def test_a_damaged_environment_is_made_anew(project: Project) -> None:
    project.run("quickstart")
    assert project.run("quickstart", FOUND="1")[1] == "venv pip pip"


def test_a_project_that_was_moved_makes_its_environment_anew(project: Project) -> None:
    project.run("quickstart")
    project.root = project.root.rename(project.root.with_name("my"))
    assert project.run("quickstart")[1] == "venv pip pip"


def test_an_installation_that_fails_is_said_and_tried_again(project: Project) -> None:
    done, _ = project.run("quickstart", PIP="1")
    assert done.returncode == 2
    assert "The installation failed" in done.stderr
    assert project.run("quickstart")[1] == "pip pip"


def test_without_a_suitable_python_it_says_so(project: Project) -> None:
    done, asked = project.run("quickstart", OLD="1")
    assert (done.returncode, asked) == (2, "")
    assert "No Python 3.11 or later was found" in done.stderr


def test_the_environment_may_lie_elsewhere(project: Project, tmp_path: Path) -> None:
    done, _ = project.run("test", OBSEQ_VENV="other")
    assert done.stdout == f"tested in {project.root}\n"
    assert (tmp_path / "other" / "obseq-stamp").is_file()
    assert not (project.root / ".venv").exists()


@pytest.mark.parametrize("level", ["run", "test", "dev"])
def test_every_pin_has_the_hashes_of_its_wheels(level: str) -> None:
    text = (ROOT / "requirements" / f"{level}.txt").read_text(encoding="utf-8").replace("\\\n", "")
    pins = [line for line in text.splitlines() if not line.startswith(("#", "-r "))]
    assert pins
    for pin in pins:
        assert re.fullmatch(r"[a-z0-9-]+==\S+ (; .*?\S )?(\s*--hash=sha256:[0-9a-f]{64})+", pin), pin


def test_what_is_compiled_has_a_wheel_for_each_python_and_platform() -> None:
    text = (ROOT / "requirements" / "run.txt").read_text(encoding="utf-8").replace("\\\n", "")
    count = {line.partition("==")[0]: line.count("--hash") for line in text.splitlines()}
    for name in ("numpy", "scipy", "numba", "llvmlite", "pyproj"):
        assert count[name] == 9  # 3.11, 3.12, 3.13; Linux x86-64, Linux aarch64, macOS arm64
