"""The page on writing a formula: its code is run as it stands (`test_extending` enters it in the library)."""

import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from obseq.codegen.equations.documentation import equation_text
from obseq.formulas import Formula, functions

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "write-a-formula.md"


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "page.py"
    path.write_text("\n\n".join(blocks("python")), "utf-8")
    return path


def run(*command: str, folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_code_of_the_page_runs_as_it_stands_and_writes_no_file(script: Path) -> None:
    check = "\ntest_fit_cube()\nassert result.converged\nassert abs(result.values(x)[0, 0] - 2 / 3) < 1e-6\n"
    whole = script.with_name("whole.py")
    whole.write_text(script.read_text("utf-8") + check, "utf-8")
    before = set(script.parent.iterdir())
    run(sys.executable, "-B", str(whole), folder=script.parent)
    assert set(script.parent.iterdir()) == before


def test_the_equation_shown_is_the_one_of_the_class(script: Path) -> None:
    fit_cube = runpy.run_path(str(script))["FitCube"]
    assert isinstance(fit_cube, type) and issubclass(fit_cube, Formula)
    shown = [line.strip() for line in blocks("text")[0].splitlines()[1:]]
    assert equation_text(fit_cube(), ("residual",)).splitlines() == shown


def test_every_block_and_function_that_the_page_names_exists() -> None:
    text = PAGE.read_text("utf-8")
    from obseq.formulas import blocks as room

    for name in "Number Length Angle Pixel Point2 Point3 Rotation Pose Direction Vector".split():
        assert f"`{name}`" in text and hasattr(room, name)
    assert hasattr(functions, "let")
    for path in re.findall(r"`((?:formulas|codegen|src|tests)/[\w/.]*)`", text):
        assert (ROOT / path).exists(), path
