"""Objects compiled ahead of time: which is chosen, what is said without them, and the list of loops."""

import ast
import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest
from sources import nodes

from obseq.compilation import objects

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("objects_tool", ROOT / "tools" / "objects.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_the_best_kind_that_the_processor_has(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    monkeypatch.setattr(sys, "platform", "linux")
    for features, expected in [
        (objects.V4, ["x86-64-v4", "x86-64-v3"]),
        (objects.V3 | {"avx512f"}, ["x86-64-v3"]),
        (objects.V3 - {"fma"}, []),
    ]:
        monkeypatch.setattr(objects, "_features", lambda features=features: frozenset(features))
        assert objects.levels_here() == expected


def test_a_tree_without_objects_finds_none(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(objects, "FOLDER", tmp_path)
    assert objects.level() == objects.NONE


def test_the_list_names_every_loop_that_python_calls(tool: ModuleType) -> None:
    """What other files than those of loops import of them is listed, with a signature."""
    listed = {f"{loop.python.__module__}.{loop.name}" for loop in tool.loops()}
    assert all(str(loop.routine.signature).startswith("(") for loop in tool.loops())
    for path in (ROOT / "src" / "obseq").rglob("*.py"):
        text = path.read_text("utf-8")
        if "compiled" in text or not any(module in text for module in tool.LOOPS):
            continue
        if any(parent.is_symlink() for parent in path.parents):
            continue
        for node in nodes(path, ast.ImportFrom):
            if node.module in tool.LOOPS:
                found = importlib.import_module(node.module)
                names = {alias.name for alias in node.names if hasattr(getattr(found, alias.name), "routine")}
                assert {f"{node.module}.{name}" for name in names} <= listed, path


def test_without_objects_and_without_numba_the_message_says_so(tmp_path: Path) -> None:
    script = (
        "import sys\nsys.modules['numba'] = sys.modules['llvmlite'] = None\nimport obseq\n"
        "try:\n    obseq.calculator('Dist3D').values([[0.0] * 6], [[1.0]])\n"
        "except obseq.ObseqError as error:\n    print(error)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert "pip install numba" in done.stdout, done.stderr
