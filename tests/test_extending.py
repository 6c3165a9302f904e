"""The pages on adding things, followed to the letter in a copy of the project; then its checks run.

What is added touches the files that the page names and no other: a place that the page forgets would make
one of the checks fail.
"""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from shutil import copytree, ignore_patterns

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "extend.md").read_text("utf-8")
FORMULA_PAGE = (ROOT / "docs" / "write-a-formula.md").read_text("utf-8")
BLOCK = re.compile(r"^```(python|diff) (\S+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
ROOMS = ("formulas", "codegen", "generated")
FAMILIES = sorted(path.name for path in (ROOT / "generated").iterdir() if (path / "__init__.py").is_file())
OTHERS = [family for family in FAMILIES if family not in ("space", "topography", "special_topography")]
LEFT_OUT = {"formulas": [], "codegen": [], "generated": OTHERS}
FEW = f"""
REGISTRY = tuple(f for f in REGISTRY if not type(f).__module__.endswith({tuple(OTHERS)}))
"""
"""Keeps the registry of the copy short: generating all of it takes many seconds, and shows nothing more."""

CHECKS = """
import sys, pytest
from functools import cache
from obseq.codegen import files
from obseq.codegen.main import main
files.generate = cache(files.generate)
if main([]) or main(["--check"]):
    sys.exit("gencode")
sys.exit(pytest.main(["-q", "-x", "-p", "no:cacheprovider", *sys.argv[1:]]))
"""

REGISTERED = (
    "tests/formulas/test_registry.py::test_generated_modules_are_those_of_the_registry",
    "tests/codegen/test_operations.py::test_the_report_records_the_operations_of_every_kernel",
    "tests/test_packaging.py::test_every_folder_of_modules_is_a_listed_package",
)
ABOUT_ONE = (
    "test_kernel_computes_the_residual_written_in_the_formula",
    "test_derivatives_are_those_of_the_values",
    "test_hashes_are_current",
    "test_every_formula_says_what_it_is",
)
EACH = {
    "A family of formulas": [
        f"tests/formulas/test_registry.py::{test}[PolynomialFit_2]" for test in ABOUT_ONE
    ],
    "An operator": [
        "tests/codegen/test_c99.py::test_every_operator_has_a_c_text",
        "tests/codegen/test_c99.py::test_the_c_text_of_an_operator_gives_its_value",
    ],
    "A kind of survey observation": [
        *(f"tests/formulas/test_registry.py::{test}[TopoHDist]" for test in ABOUT_ONE),
        "tests/survey/test_kinds.py",
    ],
    "A kind of unknown": [],
    "An output format": [],
    "A robust loss": [],
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project with a short registry, imported from where it is; what Python compiled is as good there."""
    tmp_path = tmp_path_factory.mktemp("copy") / "obseq"
    ignored = ignore_patterns(*ROOMS, "*.egg-info")
    copytree(ROOT / "src", tmp_path / "src", ignore=ignored)
    for room in ROOMS:
        copytree(ROOT / room, tmp_path / room, ignore=ignore_patterns(*LEFT_OUT[room]))
        (tmp_path / "src" / "obseq" / room).symlink_to(Path("..") / ".." / room)
    copytree(ROOT / "tests", tmp_path / "tests")
    (tmp_path / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text("utf-8"), "utf-8")
    registry = tmp_path / "formulas" / "__init__.py"
    registry.write_text(registry.read_text("utf-8") + FEW, "utf-8")
    return tmp_path


@pytest.fixture
def copy(whole: Path) -> Iterator[Path]:
    """The copy as it was made: what a test writes is taken back."""
    before = texts(whole)
    yield whole
    for path in texts(whole).keys() - before.keys():
        path.unlink()
    for path, (changed, content) in before.items():
        if not path.exists() or path.stat().st_mtime_ns != changed:
            path.write_bytes(content)
            os.utime(path, ns=(changed, changed))


def texts(project: Path) -> dict[Path, tuple[int, bytes]]:
    """When each file that people or the generator write was changed, and what is in it."""
    written = (path for path in project.rglob("*") if path.suffix in (".py", ".md", ".toml"))
    return {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in written}


def sections() -> Iterator[tuple[str, str]]:
    for section in PAGE.split("\n## ")[1:]:
        title, _, text = section.partition("\n")
        yield title, text


def follow(text: str, project: Path) -> list[str]:
    """Writes the files and makes the edits of a section; the tests among them."""
    tests = []
    for language, name, block in BLOCK.findall(text):
        path = project / name
        if language == "diff":
            edit(path, block)
            continue
        assert not path.exists(), f"{name} is not new"
        path.write_text(block, "utf-8")
        tests += [name] if name.startswith("tests/") else []
    return tests


def edit(path: Path, block: str) -> None:
    """Replaces the lines of a difference that are there, which must be there once, by those that shall be."""
    lines = block.rstrip("\n").split("\n")
    before = "\n".join(line[1:] for line in lines if line[0] in " -")
    after = "\n".join(line[1:] for line in lines if line[0] in " +")
    text = path.read_text("utf-8")
    assert text.count(f"\n{before}") == 1, f"{path.name} has {text.count(before)} times: {before}"
    path.write_text(text.replace(f"\n{before}", f"\n{after}", 1), "utf-8")


def check(project: Path, *tests: str) -> str:
    """Generates what is due, then runs some tests of the copy; what was printed."""
    command = [sys.executable, "-c", CHECKS, f"--basetemp={project.parent / 'inner'}", *tests]
    environment = {**os.environ, "PYTHONPATH": str(project / "src")}
    done = subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return done.stdout


def test_every_section_is_followed() -> None:
    assert [title for title, _ in sections()] == list(EACH)


@pytest.mark.slow
@pytest.mark.parametrize(("title", "text"), list(sections()), ids=[title for title, _ in sections()])
def test_the_page_is_followed_to_the_letter(title: str, text: str, copy: Path) -> None:
    """A few seconds each: a process, a short registry generated, the tests of what was added."""
    own = follow(text, copy)
    assert own, "each section has a test"
    check(copy, *own, *REGISTERED, *EACH[title])


@pytest.mark.slow
def test_three_edits_enter_a_formula_in_the_library(copy: Path) -> None:
    """The class, the line in the registry, the test of the page on writing a formula."""
    first, *_, test = re.findall(r"^```python\n(.*?)^```$", FORMULA_PAGE, re.MULTILINE | re.DOTALL)
    imports, formula, _ = first.split("\n\n\n")
    kept = [line for line in imports.splitlines() if "blocks" in line or "functions" in line]
    head = ['"""A curve."""', "from obseq.formulas.base import Formula", *kept]
    (copy / "formulas" / "curve.py").write_text("\n".join(head) + "\n\n\n" + formula + "\n", "utf-8")
    edit(copy / "formulas" / "__init__.py", "     Dist3D(),\n+    FitCube(),")
    edit(
        copy / "formulas" / "__init__.py",
        "+from obseq.formulas.curve import FitCube\n from obseq.formulas.distortion import DISTORTIONS",
    )
    use = 'import obseq\n\nfit = obseq.calculator("FitCube")\n\n\n'
    (copy / "tests" / "formulas" / "test_curve.py").write_text(use + test, "utf-8")
    about_it = (f"tests/formulas/test_registry.py::{test}[FitCube]" for test in ABOUT_ONE)
    printed = check(copy, "tests/formulas/test_curve.py", *REGISTERED, *about_it)
    assert "wrote generated/curve/fit_cube.py" in printed and "wrote docs/formulas/curve.md" in printed
    shown = subprocess.run(
        [sys.executable, "-c", "from obseq.cli.main import main; main(['formulas', 'FitCube'])"],
        cwd=copy / "src",
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    (equation,) = re.findall(r"^```text\n(.*?)^```$", FORMULA_PAGE, re.MULTILINE | re.DOTALL)
    assert equation in shown
