"""The shape of the project: what imports what, what `import obseq` loads, and what is in the repository."""

import ast
import importlib.util
import json
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path
from types import ModuleType

import pytest
from sources import imports

ROOT = Path(__file__).resolve().parents[1]


def table() -> ModuleType:
    """The maintenance script that holds the table of what may import what."""
    spec = importlib.util.spec_from_file_location("architecture", ROOT / "tools" / "architecture.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


ARCHITECTURE = table()
ARROWS, INSIDE, FILES = ARCHITECTURE.ARROWS, ARCHITECTURE.INSIDE, ARCHITECTURE.FILES
modules_of = ARCHITECTURE.modules_of
FROM_KERNELS = {"obseq.kernels.layout", "obseq.kernels.functions"}
LOADERS = ("obseq.kernels.loading", "obseq.kernels.ondemand")  # codegen.ondemand alone: kernels under trial
FOLDERS = {".ci", "codegen", "docs", "formulas", "generated", "requirements", "src", "tests", "tools"}
LARGEST_FILE = 1_500_000
MOST_FILES = 20


def imports_of(path: Path) -> Iterator[tuple[int, str]]:
    """Line and full name of everything a module imports, wherever in the module."""
    for node in imports(path):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        else:
            assert not node.level, f"{path}:{node.lineno}: import by the installed name"
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)


def tracked_files() -> list[Path]:
    if not (ROOT / ".git").exists():
        pytest.skip(reason="this copy of the project is not a git repository")
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    return [ROOT / name for name in listed.split("\0") if name]


def test_every_room_has_its_arrows() -> None:
    packages = ARCHITECTURE.PACKAGE.glob(
        "*/__init__.py"
    )  # a room that is gone may leave what Python compiled
    found = {path.parent.name for path in packages if not path.parent.is_symlink()}
    assert found | set(ARCHITECTURE.BESIDE) == ARROWS.keys()


@pytest.mark.parametrize("room", sorted(INSIDE))
def test_every_room_within_a_room_has_its_arrows(room: str) -> None:
    folder = ARCHITECTURE.folder_of(room)
    found = {path.parent.name for path in folder.glob("*/__init__.py")} | {
        p.stem for p in folder.glob("*.py")
    }
    assert found - {"__init__"} == INSIDE[room].keys()


@pytest.mark.parametrize("room", sorted(ARROWS))
def test_dependencies_point_one_way(room: str) -> None:
    allowed = {*ARROWS[room], *FILES, room}
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {room} may not import {name}"
        for path in modules_of(room)
        for line, name in imports_of(path)
        if name.startswith("obseq.")
        and name.split(".")[1] not in allowed
        and not name.split(".")[1][0].isupper()
    ]
    assert wrong == []


def test_files_for_everybody_stand_on_nothing() -> None:
    for name in FILES:
        path = ARCHITECTURE.PACKAGE / f"{name}.py"
        found = [target for _, target in imports_of(path) if target.startswith("obseq.")]
        assert [target for target in found if target.split(".")[1] not in FILES] == []


@pytest.mark.parametrize("room", sorted(INSIDE))
def test_dependencies_inside_a_room_point_one_way(room: str) -> None:
    wrong = []
    for path in modules_of(room):
        within = path.relative_to(ARCHITECTURE.folder_of(room)).parts[0].removesuffix(".py")
        allowed = {within, *INSIDE[room].get(within, INSIDE[room])}
        wrong += [
            f"{path.relative_to(ROOT)}:{line}: {within} may not import {name}"
            for line, name in imports_of(path)
            if name.startswith(f"obseq.{room}.") and name.split(".")[2] not in allowed
        ]
    assert wrong == []


def test_no_circle_of_files() -> None:
    """Imports for types and imports inside functions included; the sorter raises where it finds a circle."""
    files = {name_of(path, room): path for room in ARROWS for path in modules_of(room)}
    files |= {f"obseq.{name}": ARCHITECTURE.PACKAGE / f"{name}.py" for name in FILES}
    graph = {
        name: {full if full in files else full.rpartition(".")[0] for _, full in imports_of(path)}
        for name, path in files.items()
    }
    assert set(TopologicalSorter(graph).static_order()) > files.keys()


def name_of(path: Path, room: str) -> str:
    """Name by which a file is imported."""
    parts = path.relative_to(ARCHITECTURE.folder_of(room)).with_suffix("").parts
    return ".".join(("obseq", room, *parts)).removesuffix(".__init__")


def test_the_page_draws_the_table() -> None:
    assert ARCHITECTURE.PAGE.read_text(encoding="utf-8") == ARCHITECTURE.page(), (
        "write docs/architecture.md anew: python tools/architecture.py"
    )


@pytest.mark.parametrize("room", ["codegen", "generated"])
def test_what_generation_takes_from_the_kernels_is_their_layout_and_functions(room: str) -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path in modules_of(room)
        for line, name in imports_of(path)
        if name.startswith("obseq.kernels.")
        and not any(name.startswith(allowed) for allowed in FROM_KERNELS)
        and not (name.startswith(LOADERS) and path == ROOT / "codegen" / "ondemand.py")
    ]
    assert wrong == []


NAMED = r"[^\n]*(?<![.\w])(?:formulas|codegen|generated)\b"
FOLDER_NAMED = tuple(map(re.compile, (r"\\\n", r"from\s*\.", f"import{NAMED}", f"from{NAMED}")))
"""What a file has that imports a folder, or relative to its own; few others have it.

Each begins with letters, for which a text is looked through ten times as fast.
"""


def may_name_a_folder(text: str) -> bool:
    return any(named.search(text) for named in FOLDER_NAMED)


def test_folders_are_imported_by_their_installed_names() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: import obseq.{name}"
        for path in tracked_files()
        if path.suffix == ".py" and may_name_a_folder(path.read_text("utf-8"))
        for line, name in imports_of(path)
        if name.split(".")[0] in ("formulas", "codegen", "generated")
    ]
    assert wrong == []


@pytest.mark.parametrize("package", ["sympy", "jinja2", "numba", "llvmlite", "scipy", "pyproj"])
def test_import_obseq_loads_nothing_heavy(package: str, loaded_by_obseq: set[str]) -> None:
    assert package not in loaded_by_obseq


def test_the_run_time_never_loads_sympy() -> None:
    script = (
        "import sys\nsys.modules['sympy'] = sys.modules['jinja2'] = None\n"
        "import obseq, obseq.survey, obseq.images, obseq.crs, obseq.leastsquares, obseq.kernels\n"
        "import obseq.report.formats, obseq.report.page\n"
        "obseq.calculator('TopoHz')"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def loaded_by_obseq() -> set[str]:
    script = "import json, sys, obseq; json.dump(sorted(sys.modules), sys.stdout)"
    listed = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    return set(json.loads(listed))


def test_the_top_level_is_as_designed() -> None:
    found = {
        path.relative_to(ROOT).parts[0] for path in tracked_files() if len(path.relative_to(ROOT).parts) > 1
    }
    assert found == FOLDERS


def test_no_room_is_above_twenty_files() -> None:
    rooms = Counter(path.parent for room in ARROWS for path in modules_of(room) if room != "generated")
    full = {path.relative_to(ROOT).as_posix(): count for path, count in rooms.items() if count > MOST_FILES}
    assert full == {}, "make a room inside of files that belong together"


def test_every_module_has_a_file_of_tests() -> None:
    named = tomllib.loads((ROOT / "tests" / "modules.toml").read_text(encoding="utf-8"))
    rooms = (room for room in ARROWS if room not in ARCHITECTURE.BESIDE)
    inside = [path for room in rooms for path in modules_of(room)]
    alone = [ARCHITECTURE.PACKAGE / f"{name}.py" for name in FILES]
    wanted = {
        path.relative_to(ARCHITECTURE.PACKAGE).as_posix()
        for path in (*inside, *alone)
        if not path.name.startswith("__")
    }
    own = {path.stem.removeprefix("test_") for path in (ROOT / "tests").rglob("test_*.py")}
    without = [module for module in wanted - set(named) if Path(module).stem not in own]
    assert without == [], "write tests/ROOM/test_MODULE.py, or add a line to tests/modules.toml"
    assert set(named) - wanted == set(), "tests/modules.toml names modules that are gone"
    assert [file for file in named.values() if not (ROOT / file).is_file()] == []


def test_no_large_file_is_tracked() -> None:
    large = [path.name for path in tracked_files() if path.is_file() and path.stat().st_size > LARGEST_FILE]
    assert large == []
