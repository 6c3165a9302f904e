"""The pages on adding things, followed to the letter in a copy of the project; then its checks run.

What is added touches the files that the page names and no other: a place that the page forgets would make
one of the checks fail.
"""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from shutil import copy2, copytree, ignore_patterns

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted(set((ROOT / "docs" / "extend").glob("*.md")) - {ROOT / "docs" / "extend" / "README.md"})
FORMULA_PAGE = (ROOT / "docs" / "write-a-formula.md").read_text("utf-8")
BLOCK = re.compile(r"^```(python|diff) (\S+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
ROOMS = ("formulas", "codegen", "generated")
ALL = {path.name for path in (ROOT / "generated").iterdir() if (path / "__init__.py").is_file()}
FEW = """
REGISTRY = tuple(f for f in REGISTRY if not type(f).__module__.endswith({others}))
"""
"""Keeps the registry of the copy short: generating all of it takes many seconds, and shows nothing more."""

LENDER = """
import gc, json, os, sys
import hypothesis, jinja2, llvmlite.binding, numba, numpy, pytest, scipy.sparse.linalg, scipy.special, sympy

def check(folder, output, *arguments):
    os.chdir(folder)
    sys.path.insert(0, os.path.join(folder, "src"))
    file = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(file, 1)
    os.dup2(file, 2)
    from functools import cache
    from obseq.codegen import files
    from obseq.codegen.main import main
    files.generate = cache(files.generate)
    if main([]) or main(["--check"]):
        return "gencode"
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    loaded = "ignore::pytest.PytestAssertRewriteWarning"
    return int(pytest.main(["-q", "-x", "-p", "no:cacheprovider", "-W", loaded, *arguments]))

gc.collect()
gc.freeze()
for line in sys.stdin:
    child = os.fork()
    if not child:
        sys.exit(check(*json.loads(line)))
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""
"""A process that has loaded the packages of others, none of ours; it runs each check in a copy of itself."""

REGISTERED = (
    "tests/formulas/test_registry.py::test_generated_modules_are_those_of_the_registry",
    "tests/codegen/test_operations.py::test_the_report_records_the_operations_of_every_kernel",
    "tests/test_packaging.py::test_every_folder_of_modules_is_a_listed_package",
)
ABOUT_EACH = (
    "test_kernel_computes_the_residual_written_in_the_formula",
    "test_derivatives_are_those_of_the_values",
    "test_hashes_are_current",
    "test_every_formula_says_what_it_is",
)
SURVEY = ("topography", "special_topography")
WITH_ALL_SIGHTS = ("A kind of survey observation", "A cause of errors")
"""Sections whose tests need sights beside their marks; one family is enough for the others."""

EACH = {
    "A family of formulas": [f"tests/formulas/test_registry.py::{test}[curves]" for test in ABOUT_EACH],
    "An operator": [
        "tests/codegen/test_c99.py::test_every_operator_has_a_c_text",
        "tests/codegen/test_c99.py::test_the_c_text_of_an_operator_gives_its_value",
    ],
    "A kind of survey observation": [
        *(f"tests/formulas/test_registry.py::{test}[topography]" for test in ABOUT_EACH),
        "tests/survey/test_kinds.py",
    ],
    "A kind of unknown": [],
    "An output format": [],
    "A robust loss": [],
    "A format of points": [],
    "A cause of errors": ["tests/survey/test_planted_slips.py"],
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project without what is generated; what Python compiled is as good there."""
    tmp_path = tmp_path_factory.mktemp("copy") / "obseq"
    copytree(ROOT / "src", tmp_path / "src", ignore=ignore_patterns(*ROOMS, "*.egg-info"))
    for room in ROOMS:
        (tmp_path / "src" / "obseq" / room).symlink_to(Path("..") / ".." / room)
    for room in ("formulas", "codegen", "tests"):
        copytree(ROOT / room, tmp_path / room)
    (tmp_path / "generated").mkdir()
    for path in (ROOT / "generated").glob("*.*"):
        copy2(path, tmp_path / "generated")
    copy2(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def before(whole: Path) -> dict[Path, tuple[int, bytes]]:
    """When each file that people or the generator write was changed, and what is in it."""
    return {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in written(whole)}


@pytest.fixture
def copy(whole: Path, before: dict[Path, tuple[int, bytes]]) -> Iterator[Path]:
    """The copy as it was made: what a test writes is taken back."""
    yield whole
    for path in set(written(whole)) - before.keys():
        path.unlink()
    for path, (changed, content) in before.items():
        if not path.exists() or path.stat().st_mtime_ns != changed:
            path.write_bytes(content)
            os.utime(path, ns=(changed, changed))


def keep(project: Path, families: tuple[str, ...]) -> None:
    """Makes the registry of the copy one of a few families, with what is generated for them."""
    for family in families:
        copytree(ROOT / "generated" / family, project / "generated" / family, dirs_exist_ok=True)
    registry = project / "formulas" / "__init__.py"
    others = tuple(sorted(ALL.difference(families)))
    registry.write_text(registry.read_text("utf-8") + FEW.format(others=others), "utf-8")


def written(project: Path) -> Iterator[Path]:
    """The files that people or the generator write."""
    return (path for path in project.rglob("*") if path.suffix in (".py", ".md", ".toml"))


def sections() -> Iterator[tuple[str, str]]:
    for page in PAGES:
        title, _, text = page.read_text("utf-8").partition("\n")
        yield title.removeprefix("# "), text


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


@pytest.fixture(scope="module")
def lender() -> Iterator[subprocess.Popen[str]]:
    """Waits for checks to run, one line of arguments each."""
    with subprocess.Popen(
        [sys.executable, "-c", LENDER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        yield process


def check(lender: subprocess.Popen[str], project: Path, *tests: str) -> str:
    """Generates what is due, then runs some tests of the copy; what was printed."""
    assert lender.stdin is not None and lender.stdout is not None
    output = project.parent / "output"
    arguments = [str(project), str(output), f"--basetemp={project.parent / 'inner'}", *tests]
    print(json.dumps(arguments), file=lender.stdin, flush=True)
    status = lender.stdout.readline()
    printed = output.read_text("utf-8")
    assert status == "0\n", printed[-8000:]
    return printed


def test_every_section_is_followed() -> None:
    assert {title for title, _ in sections()} == set(EACH)


@pytest.mark.slow
@pytest.mark.parametrize(("title", "text"), list(sections()), ids=[title for title, _ in sections()])
def test_the_page_is_followed_to_the_letter(
    title: str, text: str, copy: Path, lender: subprocess.Popen[str]
) -> None:
    """A few seconds each: a process, a short registry generated, the tests of what was added."""
    keep(copy, SURVEY[: 1 + (title in WITH_ALL_SIGHTS)])
    own = follow(text, copy)
    assert own, "each section has a test"
    check(lender, copy, *own, *REGISTERED, *EACH[title])


@pytest.mark.slow
def test_three_edits_enter_a_formula_in_the_library(copy: Path, lender: subprocess.Popen[str]) -> None:
    """The class, the line in the registry, the test of the page on writing a formula."""
    keep(copy, SURVEY[:1])
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
    about_it = (f"tests/formulas/test_registry.py::{test}[curve]" for test in ABOUT_EACH)
    printed = check(lender, copy, "tests/formulas/test_curve.py", *REGISTERED, *about_it)
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
