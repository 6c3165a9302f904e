"""The installed package: what is in the wheel, and that it works where nothing else of the project is."""

import importlib.metadata
import json
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from pathlib import Path

import pytest
from packaging.markers import Marker
from packaging.requirements import Requirement
from packaging.tags import sys_tags
from packaging.utils import canonicalize_name, parse_wheel_filename

from obseq.cli.main import main
from obseq.compilation import objects

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PACKAGES = SETTINGS["tool"]["setuptools"]["packages"]
FOLDERS = SETTINGS["tool"]["setuptools"]["package-dir"]
LEVELS = ("run", "test", "dev")
IGNORED = shutil.ignore_patterns(
    ".*", "build", "dist", "*.egg-info", "obseq-demo", "tests", "docs", "*.nb[ci]"
)
BUILD = """
import os, shutil, sys, zlib
from setuptools import build_meta

deflate = zlib.compressobj
zlib.compressobj = lambda level, *options: deflate(0, *options)
quiet = {"--global-option": "--quiet"}
dist, project = os.path.abspath("dist"), sys.argv[1]
sdist = os.path.join(dist, build_meta.build_sdist(dist, quiet))
shutil.unpack_archive(sdist, "unpacked")
os.chdir(os.path.join("unpacked", os.path.basename(sdist).removesuffix(".tar.gz")))
build_meta.build_wheel(dist, quiet)
os.chdir(project)
build_meta.build_editable(os.path.join(dist, "editable"), quiet)
"""
"""What build tools ask of the project, in one process where they start eight; nothing is squeezed.

The editable wheel is made where the first argument says: it leads there, and pip installs what it has built.
"""


def folder_of(package: str) -> Path:
    """Where a package of the map lies: its own entry, or inside that of its nearest listed ancestor."""
    if package in FOLDERS:
        return ROOT / FOLDERS[package]
    parent, _, name = package.rpartition(".")
    return folder_of(parent) / name


def pins(level: str) -> dict[str, str]:
    """Name and version of everything that a level installs here."""
    found = {}
    for line in (ROOT / "requirements" / f"{level}.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("-r "):
            found |= pins(line.removeprefix("-r ").removesuffix(".txt"))
        match = re.match(r"([\w.-]+)==(\S+)(?: ; ([^\\]+))?", line)
        if match and (match[3] is None or Marker(match[3]).evaluate()):
            found[match[1]] = match[2]
    return found


def test_every_folder_of_modules_is_a_listed_package() -> None:
    own = [ROOT / folder for folder in ("formulas", "codegen", "generated", "src/obseq")]
    on_disk = {path.parent for folder in own for path in folder.rglob("*.py")}  # which follows no link
    assert {folder_of(package) for package in PACKAGES} == on_disk


@pytest.mark.parametrize("level", LEVELS)
def test_pins_are_what_pyproject_asks_for(level: str) -> None:
    project = SETTINGS["project"]
    texts = project["dependencies"] + SETTINGS["build-system"]["requires"]
    for extra in LEVELS[1 : LEVELS.index(level) + 1]:
        texts = texts + project["optional-dependencies"][extra] + project["optional-dependencies"]["gencode"]
    versions = pins(level)
    for requirement in (Requirement(text) for text in texts if not text.startswith("obseq[")):
        version = versions[canonicalize_name(requirement.name)]
        assert requirement.specifier.contains(version), f"{requirement} is pinned to {version}"


@pytest.mark.parametrize("level", ["run", "test"])
def test_pins_are_complete(level: str) -> None:
    """What the pinned packages need is pinned too, at a version they accept."""
    versions = pins(level)
    for name in versions:
        for text in importlib.metadata.requires(name) or []:
            needed = Requirement(text)
            if needed.marker is None or needed.marker.evaluate({"extra": ""}):
                assert needed.specifier.contains(versions[canonicalize_name(needed.name)]), (
                    f"{name}: {needed}"
                )


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project as a clone has it: building leaves nothing in the real one, and finds nothing old there.

    Without what no package is made of; what Python compiled is as good there, and nothing that may be packed.
    """
    target = tmp_path_factory.mktemp("clone") / "obseq"
    shutil.copytree(ROOT, target, ignore=IGNORED, symlinks=True)
    for link in (target / "src" / "obseq").iterdir():
        if link.is_symlink():
            link.unlink()
    return target


@pytest.fixture(scope="module")
def built(copy: Path) -> Path:
    """The sdist and the wheel made from it, of a copy with links for type checkers; and an editable one."""
    linked = copy.parent / "linked"
    shutil.copytree(copy, linked, ignore=IGNORED)
    run(sys.executable, "tools/links.py", where=linked)
    run(sys.executable, "tools/links.py", where=linked)
    assert (linked / "src" / "obseq" / "formulas" / "base.py").is_file()
    (linked / "dist" / "editable").mkdir(parents=True)
    run(sys.executable, "-c", BUILD, copy, where=linked)
    return linked / "dist"


def files_in(dist: Path) -> set[str]:
    (wheel,) = dist.glob("*.whl")
    return {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}


def install(folder: Path, *what: str) -> Path:
    """A new environment with `what` and the packages of this one, obseq excepted; its folder of commands."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    site = Path(sysconfig.get_path("purelib", "venv", {"base": str(folder), "platbase": str(folder)}))
    (site / "borrowed.pth").write_text(f"{sysconfig.get_path('purelib')}\n", encoding="utf-8")
    options = ["--no-deps", "--no-index", "--no-build-isolation", "--no-compile", "--quiet"]
    pip = [str(folder / "bin" / "python"), "-m", "pip", "install", *options, *what]
    done = subprocess.run(pip, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "bin"


def run(*command: str | Path, where: Path) -> str:
    done = subprocess.run(
        [str(part) for part in command], cwd=where, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


COMMANDS = """
import os, runpy, sys
for command in sys.argv[1:]:
    sys.argv = command.split()
    try:
        runpy.run_path(os.path.join(os.path.dirname(sys.executable), sys.argv[0]), run_name="__main__")
    except SystemExit as end:
        if end.code:
            raise
"""
"""Runs commands that were installed, one after the other where each would load the same."""


def files_of_packages() -> set[str]:
    """What a wheel holds: every file of the packages, whether links for type checkers are there or not."""
    expected = {
        f"{package.replace('.', '/')}/{path.name}"
        for package in PACKAGES
        for path in folder_of(package).iterdir()
        if path.is_file()
    }
    data = {
        "obseq/codegen/templates": "codegen/templates",
        "obseq/report/web": "src/obseq/report/web",
        "obseq/formats/data": "src/obseq/formats/data",
        "obseq/survey/data": "src/obseq/survey/data",
    }
    return expected | {
        f"{inside}/{path.name}" for inside, folder in data.items() for path in (ROOT / folder).iterdir()
    }


@pytest.mark.slow
def test_the_wheel_holds_every_file_of_the_packages_and_no_link(built: Path) -> None:
    assert files_in(built) == files_of_packages()


@pytest.mark.slow
def test_the_installed_wheel_works_by_itself(built: Path, tmp_path: Path) -> None:
    (wheel,) = built.glob("*.whl")
    commands = install(tmp_path / "environment", str(wheel))
    place = run(commands / "python", "-c", "import obseq; print(obseq.__file__)", where=tmp_path)
    assert place.startswith(str(tmp_path))
    shown = run(
        commands / "python", "-c", COMMANDS, "obseq formulas", "obseq demo --out results", where=tmp_path
    )
    assert "TopoHz" in shown
    assert "sigma0            1.766" in shown
    result = json.loads((tmp_path / "results" / "adjustment.json").read_text(encoding="utf-8"))
    assert result["sigma0"] == pytest.approx(1.7655, abs=5e-4)
    assert [point["name"] for point in result["points"]] == ["PtA", "PtB", "PtC", "PtD"]


@pytest.mark.slow
def test_an_editable_install_reads_the_folders_of_the_project(
    built: Path, copy: Path, tmp_path: Path
) -> None:
    (wheel,) = (built / "editable").glob("*.whl")
    commands = install(tmp_path / "environment", str(wheel))
    new = copy / "generated" / "newly_written.py"
    new.write_text("NAME = 'new'\n", encoding="utf-8")
    names = [*PACKAGES, "obseq.generated.newly_written"]
    script = f"import importlib\nfor name in {names}: print(importlib.import_module(name).__file__)"
    expected = [copy / folder_of(package).relative_to(ROOT) / "__init__.py" for package in PACKAGES] + [new]
    printed = run(commands / "python", "-c", script + COMMANDS, "gencode --help", where=tmp_path).splitlines()
    new.unlink()
    assert printed[: len(expected)] == [str(path) for path in expected]
    assert "generated" in "".join(printed[len(expected) :])


BETWEEN = "\n-----\n"
WITHOUT_COMPILER = f"""
import sys
sys.path.insert(0, sys.argv[1])
sys.modules.update(dict.fromkeys(("numba", "llvmlite", "sympy")))
import obseq
from obseq.cli.main import main
print(obseq.__file__, end={BETWEEN!r})
assert main(["demo", "--out", "objects"]) == 0
print(end={BETWEEN!r})
assert main(["versions"]) == 0
"""
DEMO_FORMULAS = ("TopoHz", "TopoZen", "TopoDist")
DEMO_LOOPS = (
    "obseq.leastsquares.assembly.small_loops",
    "obseq.leastsquares.loops.accumulation",
    "obseq.leastsquares.loops.block_places",
    "obseq.leastsquares.loops.blocks_to_matrix",
    "obseq.leastsquares.loops.leverages",
    "obseq.leastsquares.loops.sorting",
    "obseq.leastsquares.solvers.dense_loops",
)


@pytest.mark.slow
@pytest.mark.skipif(not (objects.levels_here() and shutil.which("cc")), reason="no objects can be made here")
def test_a_wheel_with_objects_needs_no_compiler(copy: Path, tmp_path: Path) -> None:
    """Loops of the demo compiled ahead of time give what numba gives, to the last digit, without it."""
    level = objects.levels_here()[0]
    command = [sys.executable, "tools/objects.py", "--wheel", str(tmp_path), "--levels", level, "--jobs", "1"]
    run(*command, "--formulas", *DEMO_FORMULAS, "--modules", *DEMO_LOOPS, where=copy)
    (wheel,) = tmp_path.glob("*.whl")
    assert wheel.name.startswith("obseq-") and not wheel.name.endswith("-any.whl")
    assert files_in(tmp_path) == files_of_packages() | {f"obseq/compilation/objects/{level}.so"}
    assert parse_wheel_filename(wheel.name)[3] & set(sys_tags()), "it can be installed here"
    site = tmp_path / "site"
    zipfile.ZipFile(wheel).extractall(site)
    assert main(["demo", "--out", str(tmp_path / "numba")]) == 0
    place, *_, shown = run(sys.executable, "-c", WITHOUT_COMPILER, site, where=tmp_path).split(BETWEEN)
    assert Path(place).is_relative_to(site)
    assert f"compiled ahead of time for {level}" in shown
    texts = [(tmp_path / name / "adjustment.json").read_text("utf-8") for name in ("numba", "objects")]
    results = [json.loads(re.sub(r'[^"(]*/survey/data/', "", text)) for text in texts]
    for result in results:
        for changing in ("phases", "run"):
            result.pop(changing, None)
    assert results[0] == results[1]


@pytest.mark.slow
def test_a_package_of_formulas_of_ones_own(built: Path, tmp_path: Path) -> None:
    """Made, tested, built, installed and used; where it is stale, gencode refuses it and loading tells."""
    (wheel,) = built.glob("*.whl")
    commands = install(tmp_path / "environment", str(wheel))
    run(commands / "gencode", "--new", "mylib", where=tmp_path)
    root = tmp_path / "mylib"
    install(tmp_path / "environment", str(root))
    assert "3 passed" in run(commands / "python", "-m", "pytest", "-q", "-p", "no:cacheprovider", where=root)
    script = "import obseq; print(obseq.calculator('FitCube').kernel.module.__file__)"
    installed = Path(run(commands / "python", "-c", script, where=tmp_path).strip())
    assert installed.is_relative_to(tmp_path / "environment")
    assert "cos(line^2) - y" in run(commands / "obseq", "formulas", "FitCube", where=tmp_path)
    for package in (root / "src" / "mylib", installed.parents[2]):
        equation = package / "formulas" / "curves.py"
        equation.write_text(equation.read_text("utf-8").replace("** 2", "** 3"), "utf-8")
    check = [commands / "gencode", "--project", root, "--check"]
    done = subprocess.run(check, capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "curves/fit_cube.py (due)" in done.stdout
    used = subprocess.run([commands / "python", "-c", script], capture_output=True, text=True, check=False)
    assert used.returncode == 0
    assert used.stderr.startswith("FitCube: its formula has changed since its kernel was generated")
    assert "wrote generated/curves/fit_cube.py" in run(
        commands / "gencode", "--project", root, where=tmp_path
    )
